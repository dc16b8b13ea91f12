"""The law of numbers across processors: the same request gives the same bytes, whichever kernels of
OpenBLAS, loops of NumPy and of the C library, and build of the core this processor would choose.

A dozen requests as an old processor would answer them; `make processors` asks all in every row.
"""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from ir_kernels import compiled

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tools"), str(ROOT / "benchmarks")]

import processors  # noqa: E402

ASKED = (
    "cnc_door press->cnc seed 0",
    "table_columns tL->side1 energy",
    "open home->p1 movement_cost",
    "deep_box home->bin time",
    "cnc_door home->cnc asynchronous",
    "table_columns mid->side2 genetic",
    "open home->p1 duration 4 s",
    "demo lathe_work entry",
    "demo lathe_work analytic",
    "open p1 ccd",
    "table_columns home->tL evaluated",
    "table_columns home->tL through 12 points",
    "open path spline",
    "open path free angle",
    "open stations",
    "standby 60 s",
)
ROWS = {row.name: row for row in processors.ROWS}


@pytest.fixture(scope="module")
def numbers() -> list[int]:
    with processors.Side(processors.ROOT) as side:
        names = [name for _, name in side.requests]
    return [names.index(name) for name in ASKED]


@pytest.fixture(scope="module")
def own(numbers: list[int]) -> list[dict[str, object]]:
    return processors.asked(numbers, {})


@pytest.mark.parametrize(
    "name", ["an old processor", pytest.param("OpenBLAS Haswell", marks=pytest.mark.long)]
)
def test_the_same_request_gives_the_same_bytes(
    name: str, numbers: list[int], own: list[dict[str, object]]
) -> None:
    row = ROWS[name]
    if lacks := processors.lacking(row):
        pytest.skip(f"{name}: this processor has no {lacks}")
    if compiled.NAME == "reference":
        pytest.skip("the NumPy reference agrees within tolerances")
    crashed = [one["name"] for one in own if "error" in one["answer"]]  # type: ignore[operator]
    assert crashed == []
    assert processors.compared(own, processors.asked(numbers, row.variables)) == []
