"""The builds of the core that are here, and how the tests choose among them."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any

import pytest

from ir_kernels import compiled


def _built() -> dict[str, Any]:
    """The compiled modules that are here: `native` where it runs, `baseline` where it was built."""
    found = {}
    for name in ("native", "baseline"):
        with suppress(
            ImportError
        ):  # a machine without a compiler, or not the one that built `native`
            found[name] = compiled.load(name)[1]
    return found


BUILT = _built()


def every_build(names: str, cases: Iterable[Sequence[Any]], few: int = 1) -> pytest.MarkDecorator:
    """A test of every build and case; of the NumPy reference, a hundred times slower, only the
    first few cases are in `make test`.
    """
    params = [
        pytest.param(
            core, *case, marks=[pytest.mark.long] if core == "reference" and k >= few else []
        )
        for core in (*BUILT, "reference")
        for k, case in enumerate(cases)
    ]
    return pytest.mark.parametrize(f"core, {names}".rstrip(", "), params, indirect=["core"])


slow_reference = every_build("", [()], few=0)
"""Of the reference this takes seconds, and another test shows it too."""
