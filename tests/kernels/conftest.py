"""Literals shared by the kernels' tests (robots.py, geometry_cases.py), run on every installed build."""

import sys
from pathlib import Path
from typing import Any

import pytest

from ir_kernels import compiled

sys.path.insert(0, str(Path(__file__).parent))
sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the shapes of a scene in Coal


@pytest.fixture(params=["native", "baseline", "reference"])
def core(request: pytest.FixtureRequest) -> Any:
    """The compiled module, None for the NumPy reference."""
    return _build(request.param)


@pytest.fixture(params=["native", "baseline"])
def compiled_core(request: pytest.FixtureRequest) -> Any:
    """A compiled module, to be compared with the NumPy reference."""
    return _build(request.param)


def _build(name: str) -> Any:
    try:
        return compiled.load(name)[1]
    except ImportError as error:  # a machine without a compiler, or not the one that built `native`
        pytest.skip(str(error))
