"""Checks of a recording: a measured value, the interval in which it has to lie, and the reason."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import StrEnum

import numpy as np

from ir_msgs_py.report import PlannedMovement
from ir_recorder.analysis.resting_power import Plateau
from ir_recorder.analysis.results import Analysis, StepResult
from ir_recorder.analysis.steps import UNSEEN, ExecutedStep
from ir_recorder.format import contents
from ir_recorder.reading.recording import GoalEnd
from ir_values.settings import check_settings, setting

# How far measured may be from planned, with the reason of each bound.

MODEL_PLANTS = ("", "nominal", "ideal")
"""Plants whose figures are those that the planner's model has; "" for recordings that name none."""


@dataclass(frozen=True)
class Tolerances:
    """Bounds of the checks. The energy a movement may differ by is the larger of the relative and
    the absolute one; what the capacitors held at its start, as the voltage of the DC link shows,
    may be missing besides.
    """

    energy_relative: float = setting(
        0.01,
        "Energy against plan: the nominal plant agrees within this share.",
        minimum=0.0,
        maximum=1.0,
    )
    energy_absolute: float = setting(
        10.0,
        "Energy against plan: two readings of the meter at 500 W, whose ends straddle the step.",
        unit="J",
        minimum=0.0,
    )
    duration: float = setting(
        0.05,
        "Duration of a movement: its ends are extrapolated from states at 50 Hz.",
        unit="s",
        minimum=0.0,
    )
    pause_duration: float = setting(
        0.5,
        "Duration of a pause, and how long it may rest less deep than planned: wake margin 0.2 s "
        "and three answers of 0.1 s; to it comes what a busy computer delayed the plant meanwhile.",
        unit="s",
        minimum=0.0,
    )
    tool_deviation: float = setting(
        0.005,
        "Tool off its commanded point: beyond it the planned clearance is no proof.",
        unit="m",
        minimum=0.0,
    )
    safety_distance: float = setting(
        0.02, "S_m where the recording carries none: the default of requests.", unit="m"
    )
    slack: float = setting(
        1e-4, "Clearance: resolution of the exact distances and of the states.", unit="m"
    )
    resting_relative: float = setting(
        0.01, "Power at rest against the data of controller and tool.", minimum=0.0, maximum=1.0
    )
    resting_rows: int = setting(
        0,
        "How many modes with a load the recording has to show at machine home, where it doesn't "
        "say so itself.",
        minimum=0,
    )
    indirect_relative: float = setting(
        0.01, "Energy from joint states against the meter.", minimum=0.0, maximum=1.0
    )

    plant_relative: float = setting(
        0.2,
        "Energy and power of a plant that is not the model, where the plan has no interval: two "
        "standard deviations of figures of medium confidence.",
        minimum=0.0,
        maximum=1.0,
    )

    within_interval: bool = setting(
        False, "Energy of a movement against twice the plan's 90 % interval, where it has one."
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def of_plant(self, plant: str) -> Tolerances:
        """The bounds for a plant of this name: only those of its own data agree closely with the
        model.
        """
        if plant in MODEL_PLANTS:
            return self
        wide = self.plant_relative
        return replace(
            self,
            energy_relative=wide,
            indirect_relative=wide,
            resting_relative=wide,
            within_interval=True,
        )


# One check of a recording: what was measured, the interval in which it has to lie, and why
# there.

NAN = float("nan")
INF = float("inf")


class Verdict(StrEnum):
    """What came of a check; nothing to compare is `not checked`, never `holds`."""

    HOLDS = "holds"
    FAILS = "fails"
    NOT_CHECKED = "not checked"


@dataclass(frozen=True)
class Finding:
    """A check of the cell or of the run.

    measured, low and high have the same unit; low or high is infinite for a one-sided bound.
    expected: the planned or listed value, NaN where there is only a bound. reason: why the bound is
    where it is. note: what else the reader may want to know.
    """

    name: str
    measured: float
    low: float
    high: float
    unit: str
    reason: str
    expected: float = NAN
    note: str = ""
    applies: bool = True

    @property
    def verdict(self) -> Verdict:
        """Whether the measured value lies within its bounds; a value that is missing was not
        checked.
        """
        if (
            not self.applies
            or math.isnan(self.measured)
            or math.isnan(self.low)
            or math.isnan(self.high)
        ):
            return Verdict.NOT_CHECKED
        return Verdict.HOLDS if self.low <= self.measured <= self.high else Verdict.FAILS

    @property
    def ok(self) -> bool:
        """Whether it was checked and holds."""
        return self.verdict is Verdict.HOLDS


_SEEN_SLIP = 0.05  # s: less is the recorder's jitter, and not worth a word


def near(
    name: str,
    measured: float,
    expected: float,
    bound: float,
    unit: str,
    reason: str,
    note: str = "",
) -> Finding:
    """The measured value within `bound` of the expected one."""
    return Finding(name, measured, expected - bound, expected + bound, unit, reason, expected, note)


def at_most(
    name: str, measured: float, bound: float, unit: str, reason: str, note: str = ""
) -> Finding:
    """The measured value not above the bound."""
    return Finding(name, measured, -INF, bound, unit, reason, NAN, note)


def at_least(
    name: str, measured: float, bound: float, unit: str, reason: str, note: str = ""
) -> Finding:
    """The measured value not below the bound."""
    return Finding(name, measured, bound, INF, unit, reason, NAN, note)


def unchecked(name: str, why: str) -> Finding:
    """A check that this recording doesn't allow."""
    return Finding(name, NAN, NAN, NAN, "", "", NAN, why, applies=False)


def summary(findings: tuple[Finding, ...]) -> tuple[Verdict, str]:
    """The verdict over all checks with a sentence: it holds only where every check was made and
    holds.
    """
    failed = sum(check.verdict is Verdict.FAILS for check in findings)
    missing = sum(check.verdict is Verdict.NOT_CHECKED for check in findings)
    held = len(findings) - failed - missing
    if failed:
        return (
            Verdict.FAILS,
            f"{failed} of {len(findings)} checks {'fails' if failed == 1 else 'fail'}",
        )
    if not held:
        return Verdict.NOT_CHECKED, "nothing was checked"
    if missing:
        verb = "holds" if held == 1 else "hold"
        return (
            Verdict.NOT_CHECKED,
            f"{held} of {len(findings)} checks {verb}, {missing} not checked",
        )
    return Verdict.HOLDS, f"all {held} checks hold"


# Checks of one step of the program: energy, duration, tool, clearance; each with the reason of its
# bound.


def step_checks(
    result: StepResult, safety_distance: float, bounds: Tolerances
) -> Iterator[Finding]:
    """All checks of a movement or pause that ended; safety_distance [m]: S_m as recorded, NaN where
    not.
    """
    name = f"{result.step.index + 1} {result.step.label}"
    if result.step.movement.is_pause:
        yield from _pause(name, result, bounds)
        return
    yield from _energy(name, result, bounds)
    planned = result.step.movement.report.duration
    if planned > 0.0:
        why = "ends are extrapolated from states at 50 Hz"
        yield near(f"duration of {name}", result.seconds, planned, bounds.duration, "s", why)
    if (
        planned >= UNSEEN
    ):  # a shorter one has too few positions, and perhaps no state of the controller
        yield _from_joint_states(name, result, bounds)
        why = "beyond it the planned clearance is no proof"
        yield at_most(
            f"tool deviation on {name}", result.tool_deviation, bounds.tool_deviation, "m", why
        )
    yield from _clearance(name, result, safety_distance, bounds)


def _from_joint_states(name: str, result: StepResult, bounds: Tolerances) -> Finding:
    """What positions say by the data of the robot, against the meter."""
    least = _allowed_joules(result, bounds)
    below = max(bounds.indirect_relative * abs(result.energy), least)
    above = below
    why = _share(bounds.indirect_relative, least)
    report = result.step.movement.report
    if bounds.within_interval and report.energy_high > report.energy_low:
        below = max(below, 2.0 * (report.energy_high - report.energy))
        above = max(above, 2.0 * (report.energy - report.energy_low))
        why += ", twice the plan's 90 % interval, whose data these are"
    return _finding_between(
        f"energy of {name} from joint states",
        result.indirect_energy,
        result.energy - below,
        result.energy + above + _stored(result),
        result.energy,
        f"{why}, or the capacitors' charge at the start",
    )


def _energy(name: str, result: StepResult, bounds: Tolerances) -> Iterator[Finding]:
    planned = result.step.movement.report.energy
    stored = _stored(result)
    if planned <= 0.0:
        yield unchecked(f"energy of {name}", "the movement carries no plan")
        return
    low, high, why = _expected(result, 1.0, bounds)
    why += _of_capacitors(result)
    yield _finding_between(
        f"energy of {name}", result.energy, low - stored, high + result.lost_charge, planned, why
    )


def _expected(result: StepResult, share: float, bounds: Tolerances) -> tuple[float, float, str]:
    """Least and largest energy [J] of `share` of the planned time of a step, and the reason.

    A plant that is not the model is held against the plan's interval: what drives draw that the
    data put at zero is a large part of a small robot's power at rest, as of its movements.
    """
    report = result.step.movement.report
    least = _allowed_joules(result, bounds)
    planned = share * report.energy
    if bounds.within_interval and report.energy_high > report.energy_low:
        low, high = _twice(share * report.energy_low, share * report.energy_high)
        why = f"the plant is not the model: twice the plan's 90 % interval and {least:.3g} J"
        return low - least, high + least, why
    bound = max(bounds.energy_relative * planned, least)
    return planned - bound, planned + bound, _share(bounds.energy_relative, least)


def _twice(low: float, high: float) -> tuple[float, float]:
    """The interval about the same middle that is twice as wide: what is predicted may be an end of
    the given one, as of what the data put at zero.
    """
    half = (high - low) / 2.0
    return low - half, high + half


def _pause(name: str, result: StepResult, bounds: Tolerances) -> Iterator[Finding]:
    """Findings of a pause: its duration, and the energy that its modes take."""
    movement = result.step.movement
    if movement.duration <= 0.0:
        return  # a stop without a dwell: nothing is planned
    why = "wake margin and answers of the nodes"
    if result.slip > _SEEN_SLIP:
        why += f", and {result.slip:.3g} s by which the busy computer delayed the plant meanwhile"
    allowed = bounds.pause_duration + result.slip
    yield near(f"duration of {name}", result.seconds, movement.duration, allowed, "s", why)
    if movement.report.energy <= 0.0:
        yield unchecked(f"energy of {name}", "the pause carries no plan")
        return
    if _rests(movement) and not math.isfinite(result.motors_power):
        yield unchecked(f"energy of {name}", "what the motors would take meanwhile is not known")
        return
    planned = movement.report.energy
    stored = _stored(result)
    if _rests(movement):
        low, high, why = _resting(result, bounds)
    else:
        share = result.seconds / movement.duration  # the duration is a check of its own
        planned *= share
        low, high, why = _expected(result, share, bounds)
        why += " of the planned power"
    why += _of_capacitors(result)
    yield _finding_between(
        f"energy of {name}", result.energy, low - stored, high + result.lost_charge, planned, why
    )


def _resting(result: StepResult, bounds: Tolerances) -> tuple[float, float, str]:
    """Least and largest energy [J] of a pause in a resting mode, and the reason."""
    seconds = bounds.pause_duration + result.slip
    later = seconds * result.motors_power
    planned = result.step.movement.report.energy
    least = _allowed_joules(result, bounds)
    low = planned - least
    high = planned + least
    why = ""
    if bounds.within_interval:
        low, high, why = _expected(result, 1.0, bounds)
        why += ", and "
    why += f"{seconds:.3g} s less deep than planned, at {result.motors_power:.0f} W"
    return low - later, high + later, why


def _clearance(
    name: str, result: StepResult, recorded: float, bounds: Tolerances
) -> Iterator[Finding]:
    near_ = result.clearance
    if near_ is None:
        yield unchecked(f"clearance on {name}", "cell or joint states are missing")
        return
    off = bounds.tool_deviation if math.isnan(result.tool_deviation) else result.tool_deviation
    off = min(off, bounds.tool_deviation) + bounds.slack
    kept, whose = kept_distance(result, recorded, bounds)
    why = f"{whose} {kept * 1e3:.1f} mm, less {off * 1e3:.1f} mm that the tool was off its path"
    where = f"{near_.least_pair} at {near_.least_time:.2f} s"
    yield at_least(f"clearance on {name}", near_.least, kept - off, "m", why, where)
    if math.isfinite(near_.contact_margin):
        why = "excess over the own distance of pairs that may touch"
        yield at_least(f"allowed contacts on {name}", near_.contact_margin, -off, "m", why)


def kept_distance(result: StepResult, recorded: float, bounds: Tolerances) -> tuple[float, str]:
    """The distance [m] that the executed clearance is held against, and its source.

    S_m that the plan's report says, else the one among the facts; else the clearance of a certified
    plan that comes nearer than the default S_m.
    """
    planned = result.step.movement.report
    if planned.safety_distance > 0.0:
        return planned.safety_distance, "safety distance of the plan"
    if not math.isnan(recorded):
        return recorded, "safety distance of the recording"
    if planned.certified and planned.min_clearance < bounds.safety_distance:
        return planned.min_clearance, "clearance of the certified plan"
    return bounds.safety_distance, "default safety distance (none is recorded)"


def _rests(movement: PlannedMovement) -> bool:
    return movement.power_mode not in ("", "STAND_ON_MOTORS")


def _allowed_joules(result: StepResult, bounds: Tolerances) -> float:
    """J that any step may differ by: more where a reading at an end holds more, as if the next one
    moves.
    """
    return max(bounds.energy_absolute, float(np.nan_to_num(result.straddling_energy)))


def _of_capacitors(result: StepResult) -> str:
    """What they change in a bound, in words."""
    stored = _stored(result)
    lost = result.lost_charge
    less = f"; less {stored:.0f} J that the capacitors held at the start" if stored >= 1.0 else ""
    return less + (
        f"; and {lost:.0f} J that had gone from them as it began late" if lost >= 1.0 else ""
    )


def _stored(result: StepResult) -> float:
    return 0.0 if math.isnan(result.stored_energy) else result.stored_energy


def _share(relative: float, absolute: float) -> str:
    return f"{relative * 100.0:g} % or {absolute:.3g} J"


def _finding_between(
    name: str, measured: float, low: float, high: float, expected: float, reason: str
) -> Finding:
    return Finding(name, measured, low, high, "J", reason, expected)


# All checks of a recording: of the requests, the program, its steps, the power at rest, the joint
# states.

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
    by_action: dict[str, list[GoalEnd]] = {}
    for goal in analysis.recording.goals:
        by_action.setdefault(goal.action, []).append(goal)
    for action, own in sorted(by_action.items()):
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
    """Power of each plateau at machine home against the data, and against Table II."""
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
            least, most = _twice(row.low, row.high)
            low = min(low, least)
            high = max(high, most)
            why += ", or twice the 90 % interval of what the drives draw"
        name = f"power at rest, {row_name(row)}"
        yield Finding(name, row.power, low, high, "W", why, row.expected, note)
        if not math.isnan(row.table_2):
            bound = bounds.resting_relative * row.table_2
            why = f"{share} of the paper's Table II"
            yield near(f"Table II, {row_name(row)}", row.power, row.table_2, bound, "W", why, note)
    rows = max(bounds.resting_rows, _modes_to_show(analysis))
    if rows:
        why = "the demonstration visits every mode with every load"
        yield at_least("modes shown at machine home", len(analysis.plateaus), rows, "", why)


def _modes_to_show(analysis: Analysis) -> int:
    """How many modes with a load the recording says that it visits at machine home; 0 where it
    doesn't say so.
    """
    fact = analysis.recording.fact(contents.MODES_AT_REST)
    return int(fact) if fact.isdecimal() and len(fact) <= _DIGITS else 0


_DIGITS = 3  # of a count of modes: a longer one is none


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
