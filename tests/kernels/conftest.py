"""Literals shared by the kernels' tests (robots.py, geometry_cases.py), run on every build that is
here.

Set-up builds the core for this processor alone. The portable one is built by the test of colcon's
build, which runs these tests on it.
"""

import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from ir_kernels import compiled

sys.path.insert(0, str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the shapes of a scene in Coal


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


@pytest.fixture(params=[*BUILT, "reference"])
def core(request: pytest.FixtureRequest) -> Any:
    """The compiled module, None for the NumPy reference."""
    return BUILT.get(request.param)


@pytest.fixture(params=BUILT)
def compiled_core(request: pytest.FixtureRequest) -> Any:
    """A compiled module, to be compared with the NumPy reference."""
    return BUILT[request.param]


@pytest.fixture
def baseline() -> Any:
    """The portable module, to be compared with the native one."""
    if len(BUILT) < 2:
        pytest.skip(
            f"built here: {', '.join(BUILT) or 'nothing'}; the test of colcon's build runs this"
        )
    return BUILT["baseline"]
