"""All checks of a recording: of the requests, the program, its steps, the power at rest, the joint
states.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from ir_recorder.analysis.finding import Finding, at_least, at_most, near, unchecked
from ir_recorder.analysis.movement_checks import step_checks
from ir_recorder.analysis.plateaus import Plateau
from ir_recorder.analysis.results import Analysis
from ir_recorder.analysis.steps import ExecutedStep
from ir_recorder.analysis.tolerances import Tolerances

ENDED = "ended"
_SUCCEEDED = 4  # action_msgs/GoalStatus


def findings(analysis: Analysis, tolerances: Tolerances | None = None) -> tuple[Finding, ...]:
    """All checks of the cell and of this run; what can't be checked is listed as such."""
    bounds = (tolerances or Tolerances()).of_plant(analysis.recording.plant)
    steps = [result for result in analysis.steps if result.step.outcome == ENDED]
    return (
        *_requests(analysis),
        *_program(analysis),
        *(
            check
            for result in steps
            for check in step_checks(result, analysis.safety_distance, bounds)
        ),
        *_at_rest(analysis, bounds),
        *_grid(analysis),
    )


def _requests(analysis: Analysis) -> Iterator[Finding]:
    """Goals that were asked of planner and runner: all of them have to succeed."""
    for action in sorted({goal.action for goal in analysis.recording.goals}):
        own = [goal for goal in analysis.recording.goals if goal.action == action]
        done = sum(goal.status == _SUCCEEDED for goal in own)
        others = ", ".join(goal.outcome for goal in own if goal.status != _SUCCEEDED)
        why = "every goal that was sent has to succeed"
        yield at_least(f"goals of {action} that succeeded", done, len(own), "", why, others)


def _program(analysis: Analysis) -> Iterator[Finding]:
    """Whether a program was executed, and all of it."""
    if not analysis.steps:
        yield unchecked("program executed", "no step of a program was recorded")
        return
    for steps in _runs(analysis):
        ended = sum(step.outcome == ENDED for step in steps)
        open_ = [
            f"{s.index + 1} {s.label}: {s.outcome} {s.note}".strip()
            for s in steps
            if s.outcome != ENDED
        ]
        why = "every step of the program has to end"
        yield at_least(
            "steps of the program that ended", ended, steps[0].total, "", why, "; ".join(open_)
        )


def _runs(analysis: Analysis) -> Iterator[list[ExecutedStep]]:
    """The steps of each run of a program: a run begins where the index doesn't rise."""
    run: list[ExecutedStep] = []
    for result in analysis.steps:
        if run and result.step.index <= run[-1].index:
            yield run
            run = []
        run.append(result.step)
    yield run


def _at_rest(analysis: Analysis, bounds: Tolerances) -> Iterator[Finding]:
    for row in analysis.plateaus:
        share = f"{bounds.resting_relative * 100.0:g} %"
        note = f"{row.seconds:.1f} s at machine home"
        why = f"{share} of the data of controller, tool and robot"
        if math.isnan(row.expected):
            yield unchecked(f"power at rest, {row_name(row)}", "the load is unknown to the cell")
            continue
        bound = bounds.resting_relative * row.expected
        low = row.expected - bound
        high = row.expected + bound
        if bounds.within_interval and row.high > row.low:
            low = min(low, 2.0 * row.low - row.expected)
            high = max(high, 2.0 * row.high - row.expected)
            why += ", or twice the 90 % interval of what the drives draw"
        name = f"power at rest, {row_name(row)}"
        yield Finding(name, row.power, low, high, "W", why, row.expected, note)
        if not math.isnan(row.table_2):
            bound = bounds.resting_relative * row.table_2
            why = f"{share} of the paper's Table II"
            yield near(f"Table II, {row_name(row)}", row.power, row.table_2, bound, "W", why, note)
    if bounds.resting_rows:
        why = "the demonstration visits every mode with every load"
        yield at_least(
            "modes shown at machine home", len(analysis.plateaus), bounds.resting_rows, "", why
        )


def row_name(row: Plateau) -> str:
    """A mode with its load in words: "bus power off, gripper (155 kg)"."""
    mass = "" if math.isnan(row.payload) or not row.payload else f" ({row.payload:g} kg)"
    return (
        f"{row.mode.lower().replace('_', ' ')}, "
        f"{'no load' if row.load == 'none' else row.load}{mass}"
    )


def _grid(analysis: Analysis) -> Iterator[Finding]:
    grid = analysis.grid
    if grid is None:
        yield unchecked("joint states on a 2 ms grid", "none are recorded")
        return
    note = f"{grid.count} states, {grid.excused} pauses of hibernation"
    if grid.gaps:
        note += f"; first gap {grid.gaps[0][1] * 1e3:.0f} ms at {grid.gaps[0][0]:.2f} s"
    faults = len(grid.gaps) + grid.off_grid + grid.backward
    why = "500 Hz without a gap by contract"
    yield at_most(
        "joint states off a gap-free 2 ms grid",
        faults if grid.count else math.nan,
        0.0,
        "",
        why,
        note,
    )
