"""Checks of one step of the program: energy, duration, tool, clearance; each with the reason of its
bound.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ir_msgs_py.report import PlannedMovement
from ir_recorder.analysis.finding import Finding, at_least, at_most, near, unchecked
from ir_recorder.analysis.results import StepResult
from ir_recorder.analysis.steps import UNSEEN
from ir_recorder.analysis.tolerances import Tolerances


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
    least = _least(result, bounds)
    below = above = max(bounds.indirect_relative * abs(result.energy), least)
    why = _share(bounds.indirect_relative, least)
    report = result.step.movement.report
    if bounds.within_interval and report.energy_high > report.energy_low:
        below = max(below, 2.0 * (report.energy_high - report.energy))
        above = max(above, 2.0 * (report.energy - report.energy_low))
        why += ", twice the plan's 90 % interval, whose data these are"
    return _between(
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
    yield _between(
        f"energy of {name}", result.energy, low - stored, high + result.lost_charge, planned, why
    )


def _expected(result: StepResult, share: float, bounds: Tolerances) -> tuple[float, float, str]:
    """Least and largest energy [J] of `share` of the planned time of a step, and the reason.

    A plant that is not the model is held against the plan's interval: what drives draw that the
    data put at zero is a large part of a small robot's power at rest, as of its movements.
    """
    report = result.step.movement.report
    least = _least(result, bounds)
    planned = share * report.energy
    if bounds.within_interval and report.energy_high > report.energy_low:
        low, high = (2.0 * share * end - planned for end in (report.energy_low, report.energy_high))
        why = f"the plant is not the model: twice the plan's 90 % interval and {least:.3g} J"
        return low - least, high + least, why
    bound = max(bounds.energy_relative * planned, least)
    return planned - bound, planned + bound, _share(bounds.energy_relative, least)


def _pause(name: str, result: StepResult, bounds: Tolerances) -> Iterator[Finding]:
    movement = result.step.movement
    if movement.duration <= 0.0:
        return  # a stop without a dwell: nothing is planned
    why = "wake margin and answers of the nodes; time of the plant, which a busy machine delays"
    yield near(
        f"duration of {name}", result.seconds, movement.duration, bounds.pause_duration, "s", why
    )
    if movement.report.energy <= 0.0:
        yield unchecked(f"energy of {name}", "the pause carries no plan")
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
    yield _between(
        f"energy of {name}", result.energy, low - stored, high + result.lost_charge, planned, why
    )


def _resting(result: StepResult, bounds: Tolerances) -> tuple[float, float, str]:
    """Least and largest energy [J] of a pause in a resting mode, and the reason."""
    later = bounds.pause_duration * result.motors_power
    planned = result.step.movement.report.energy
    least = _least(result, bounds)
    low = planned - least
    high = planned + least
    why = ""
    if bounds.within_interval:
        low, high, why = _expected(result, 1.0, bounds)
        why += ", and "
    why += f"{bounds.pause_duration:g} s less deep than planned, at {result.motors_power:.0f} W"
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


def _least(result: StepResult, bounds: Tolerances) -> float:
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


def _between(
    name: str, measured: float, low: float, high: float, expected: float, reason: str
) -> Finding:
    return Finding(name, measured, low, high, "J", reason, expected)
