"""Pauses of a program as they are sent, with the mode that they are spent in and what they cost."""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_msgs_py.transitions import TransitionTimes
from ir_planner.program.standby import BRAKES, MOTORS, late_start, pause_energy, plan_standby
from ir_planner.scene import PlanningScene

AUTO = "AUTO"


@dataclass(frozen=True, eq=False)
class Pause:
    """Where (a name, and q (n,)), how long [s], in which mode it was asked for (AUTO; "": not said), and what
    is held.
    """

    here: str
    seconds: float
    requested: str
    q: FloatArray
    scene: PlanningScene


def planned_pause(pause: Pause, times: TransitionTimes) -> PlannedMovement:
    """In the mode that is asked for, the one of least energy (AUTO), or on motors; longer than the controller
    stands on motors: on brakes, which it would close anyway, so that they are open again in time.
    """
    mode = pause.requested
    if pause.requested == AUTO:
        least = pause.seconds > 0.0
        mode = plan_standby(pause.seconds, pause.q, pause.scene, times).chosen.name if least else ""
    elif not pause.requested and late_start(pause.seconds, pause.scene, times) > 0.0:
        mode = BRAKES
    return _spent(pause, mode, times)


def pause_by_itself(pause: Pause, times: TransitionTimes) -> PlannedMovement:
    """As the controller spends it when nobody asks for a mode."""
    return _spent(pause, "", times)


def _spent(pause: Pause, mode: str, times: TransitionTimes) -> PlannedMovement:
    energy = 0.0
    if pause.seconds > 0.0:
        energy = pause_energy(mode or MOTORS, pause.seconds, pause.q, pause.scene, times)
    if not np.isfinite(energy):  # asked for by name though it is too short: the runner stands on motors
        energy = pause_energy(MOTORS, pause.seconds, pause.q, pause.scene, times)
    report = TrajectoryReport(duration=pause.seconds, energy=energy, base_energy=energy, certified=True)
    return PlannedMovement(
        kind=MovementKind.PAUSE,
        from_station=pause.here,
        to_station=pause.here,
        duration=pause.seconds,
        power_mode=mode,
        load=pause.scene.load_text,
        report=report,
    )
