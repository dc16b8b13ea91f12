"""Pauses of a program as they are sent, with the mode that they are spent in and what they cost."""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.modes import DEEPER, TransitionTimes, modes_of
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_planner.program.rests import BRAKES, MOTORS, Rests, rests_at
from ir_planner.scene import PlanningScene

AUTO = "AUTO"


@dataclass(frozen=True, eq=False)
class Pause:
    """Where (a name, and q (n,)), how long [s], in which mode it was asked for (AUTO; "": not
    said), and what is held.
    """

    here: str
    seconds: float
    requested: str
    q: FloatArray
    scene: PlanningScene


def planned_pause(pause: Pause, times: TransitionTimes) -> PlannedMovement:
    """In the mode that is asked for, where the pause is long enough for it, the sequence of least
    energy (AUTO), or on motors; longer than the controller stands on motors: on brakes, which it
    would close anyway, so that they are open again in time.
    """
    rests = rests_at(pause.q, pause.scene, times)
    mode = pause.requested
    if pause.requested == AUTO:
        mode = DEEPER.join(step.rest.name for step in rests.known(pause.seconds)[1]) or MOTORS
    elif not np.isfinite(_rested(pause, mode, rests)) and rests.cost((), pause.seconds)[1] > 0.0:
        mode = BRAKES
    return _spent(pause, mode, rests)


def pause_by_itself(pause: Pause, times: TransitionTimes) -> PlannedMovement:
    """As the controller spends it when nobody asks for a mode."""
    return _spent(pause, "", rests_at(pause.q, pause.scene, times))


def _rested(pause: Pause, mode: str, rests: Rests) -> float:
    """Energy [J] in a mode that is entered and left in time; inf: on motors, or the pause is too
    short.
    """
    sequence = tuple(rests.named(each.name) for each in modes_of(mode))
    return rests.in_time(sequence, pause.seconds) if sequence else np.inf


def _spent(pause: Pause, mode: str, rests: Rests) -> PlannedMovement:
    energy = _rested(pause, mode, rests)
    if not np.isfinite(
        energy
    ):  # on motors, also where it is asked for by name though it is too short
        energy = rests.cost((), pause.seconds)[0]
    report = TrajectoryReport(
        duration=pause.seconds, energy=energy, base_energy=energy, certified=True
    )
    return PlannedMovement(
        kind=MovementKind.PAUSE,
        from_station=pause.here,
        to_station=pause.here,
        duration=pause.seconds,
        power_mode=mode,
        load=pause.scene.load_text,
        report=report,
    )
