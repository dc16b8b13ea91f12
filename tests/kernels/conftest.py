"""Literals shared by the kernels' tests (robots.py, geometry_cases.py), run on every build that is
here.

Set-up builds the core for this processor alone. The portable one is built by the test of colcon's
build, which runs these tests on it.
"""

import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the shapes of a scene in Coal

from builds import BUILT


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
