"""The builds of the core that are here, and how the tests choose among them."""

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
LONG_REFERENCE = pytest.param("reference", marks=pytest.mark.long)

slow_reference = pytest.mark.parametrize("core", [*BUILT, LONG_REFERENCE], indirect=True)
"""The builds alone in `make test`: the NumPy reference takes seconds."""
