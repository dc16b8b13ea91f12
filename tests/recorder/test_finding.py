"""A check holds, fails, or was not made; the three are never mixed up."""

from __future__ import annotations

import math

from ir_recorder import Verdict, summary
from ir_recorder.analysis.checks import at_least, at_most, near, unchecked

GOOD = near("good", 1.0, 1.0, 0.1, "J", "why")
BAD = at_most("bad", 2.0, 1.0, "m", "why")
OPEN = unchecked("open", "nothing was recorded")


def test_bounds_belong_to_the_interval() -> None:
    assert near("a", 1.1, 1.0, 0.1, "J", "why").verdict is Verdict.HOLDS
    assert near("a", 1.2, 1.0, 0.1, "J", "why").verdict is Verdict.FAILS
    assert at_most("a", 1.0, 1.0, "m", "why").verdict is Verdict.HOLDS
    assert at_least("a", 0.9, 1.0, "m", "why").verdict is Verdict.FAILS


def test_what_was_not_measured_neither_holds_nor_fails() -> None:
    for check in (
        near("a", math.nan, 1.0, 0.1, "J", "why"),
        at_least("a", 1.0, math.nan, "m", "why"),
        OPEN,
    ):
        assert check.verdict is Verdict.NOT_CHECKED
        assert not check.ok


def test_the_sum_of_checks_is_green_only_where_all_were_made() -> None:
    assert summary(()) == (Verdict.NOT_CHECKED, "nothing was checked")
    assert summary((OPEN,)) == (Verdict.NOT_CHECKED, "nothing was checked")
    assert summary((GOOD, OPEN)) == (Verdict.NOT_CHECKED, "1 of 2 checks holds, 1 not checked")
    assert summary((GOOD, BAD, OPEN)) == (Verdict.FAILS, "1 of 3 checks fails")
    assert summary((GOOD, GOOD)) == (Verdict.HOLDS, "all 2 checks hold")
