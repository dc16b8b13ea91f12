"""Two that start the same nodes at the same time: one does, the other says why not."""

from __future__ import annotations

import os

import pytest

from ir_cli.errors import CommandError
from ir_cli.ros.domain import claim, claimed


def test_a_claim_is_refused_while_another_holds_it_and_free_after() -> None:
    namespace = f"/claimed_{os.getpid()}"
    first = claim("77", namespace)
    assert first is not None
    with pytest.raises(
        CommandError, match=f"another `ir ros up` or `ir demo` .* in {namespace} of domain 77"
    ):
        claim("77", namespace)
    others = [claim("78", namespace), claim("77", f"{namespace}_b")]
    first.close()
    again = claim("77", namespace)
    for held in (*others, again):
        assert held is not None
        held.close()


def test_whoever_looks_sees_the_claim_and_does_not_take_it() -> None:
    namespace = f"/seen_{os.getpid()}"
    assert not claimed("77", namespace)
    held = claim("77", namespace)
    assert held is not None
    with held:
        assert claimed("77", namespace)
        assert not claimed("78", namespace)
    assert not claimed("77", namespace)
