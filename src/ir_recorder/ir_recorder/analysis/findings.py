"""Comparisons with a tolerance: what a recording has to show for the run to count as good."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from ir_msgs_py.report import TrajectoryReport
from ir_recorder.analysis.plateaus import Plateau
from ir_recorder.analysis.results import Analysis, StepResult


@dataclass(frozen=True)
class Tolerances:
    """How far measured may be from planned.

    energy_relative or energy_absolute [J], whichever is larger, per movement; duration [s]; tool_deviation
    [m]; safety_distance [m]: S_m, that the executed clearance keeps but for the deviation that was measured
    (or tolerated, where none was) and `slack` [m]; where a certified plan comes nearer, its clearance stands
    for the S_m it was made with, which no message carries; allowed pairs keep their own distance alike;
    table_2_relative; table_2_rows: how many rows the recording has to show; indirect_relative: indirect
    against direct measurement.
    """

    energy_relative: float = 0.05
    energy_absolute: float = 200.0
    duration: float = 0.05
    tool_deviation: float = 0.005
    safety_distance: float = 0.02
    slack: float = 1e-4
    table_2_relative: float = 0.01
    table_2_rows: int = 0
    indirect_relative: float = 0.05


@dataclass(frozen=True)
class Finding:
    """One check: what was measured, what was expected, within which bound, in which unit, and whether it
    holds.
    """

    name: str
    measured: float
    expected: float
    bound: float
    unit: str
    ok: bool
    note: str = ""


def findings(analysis: Analysis, tolerances: Tolerances | None = None) -> tuple[Finding, ...]:
    """All checks that the recording allows; a movement whose meter is missing fails."""
    bounds = tolerances or Tolerances()
    checks = [check for result in analysis.movements for check in _movement(result, bounds)]
    return (*checks, *_unfinished(analysis), *_table_2(analysis, bounds), *_grid(analysis))


def _unfinished(analysis: Analysis) -> Iterator[Finding]:
    for result in analysis.steps:
        step = result.step
        if step.outcome != "ended":
            note = f"{step.outcome} {step.note}".strip()
            yield Finding(f"end of {step.index + 1} {step.label}", 0.0, 1.0, 0.0, "", False, note)


def _movement(result: StepResult, bounds: Tolerances) -> Iterator[Finding]:
    planned, name = result.step.movement.report, f"{result.step.index + 1} {result.step.label}"
    bound = max(bounds.energy_relative * abs(planned.energy), bounds.energy_absolute)
    yield _near(f"energy of {name}", result.energy, planned.energy, bound, "J")
    yield _near(f"duration of {name}", result.seconds, planned.duration, bounds.duration, "s")
    if not math.isnan(result.indirect_energy):
        bound = max(bounds.indirect_relative * abs(result.energy), bounds.energy_absolute)
        yield _near(
            f"indirect measurement of {name}",
            result.indirect_energy,
            result.energy,
            bound,
            "J",
            "from torque",
        )
    if not math.isnan(result.tool_deviation):
        yield _below(f"tool deviation on {name}", result.tool_deviation, bounds.tool_deviation)
    near = result.clearance
    if near is not None:
        off = bounds.tool_deviation if math.isnan(result.tool_deviation) else result.tool_deviation
        off = min(off, bounds.tool_deviation) + bounds.slack
        kept, whose = _kept(planned, bounds)
        note = f"{near.least_pair}; to keep: {kept * 1e3:.1f} mm, {whose}"
        yield _above(f"clearance on {name}", near.least, kept - off, note)
        if math.isfinite(near.contact_margin):
            yield _above(f"allowed contacts on {name}", near.contact_margin, -off, "over their own")


def _kept(planned: TrajectoryReport, bounds: Tolerances) -> tuple[float, str]:
    """The distance [m] that the executed clearance is held against, and what it is."""
    if planned.certified and planned.min_clearance < bounds.safety_distance:
        return planned.min_clearance, "the certified plan's clearance"
    return bounds.safety_distance, "the safety distance"


def _table_2(analysis: Analysis, bounds: Tolerances) -> Iterator[Finding]:
    for row in analysis.plateaus:
        yield _near(
            _row_name(row),
            row.power,
            row.expected,
            bounds.table_2_relative * row.expected,
            "W",
            f"{row.seconds:.1f} s",
        )
    if bounds.table_2_rows:
        count, wanted = len(analysis.plateaus), bounds.table_2_rows
        yield Finding("rows of Table II shown", count, wanted, 0.0, "", count >= wanted)


def _row_name(row: Plateau) -> str:
    return f"Table II: {row.mode.lower().replace('_', ' ')}, {row.payload:g} kg"


def _grid(analysis: Analysis) -> Iterator[Finding]:
    grid = analysis.grid
    if grid is None:
        yield Finding("joint states on a 2 ms grid", 0.0, 1.0, 0.0, "", False, "none are recorded")
        return
    faults = len(grid.gaps) + grid.off_grid + grid.backward
    note = f"{grid.count} states, {grid.excused} pauses of hibernation"
    if grid.gaps:
        note += f"; first gap {grid.gaps[0][1] * 1e3:.0f} ms at {grid.gaps[0][0]:.2f} s"
    yield Finding("joint states off a gap-free 2 ms grid", faults, 0.0, 0.0, "", grid.clean, note)


def _near(name: str, measured: float, expected: float, bound: float, unit: str, note: str = "") -> Finding:
    ok = abs(measured - expected) <= bound  # false for NaN
    return Finding(name, measured, expected, bound, unit, ok, note)


def _below(name: str, measured: float, bound: float) -> Finding:
    return Finding(name, measured, 0.0, bound, "m", measured <= bound)


def _above(name: str, measured: float, bound: float, note: str) -> Finding:
    return Finding(name, measured, bound, 0.0, "m", measured >= bound, note)
