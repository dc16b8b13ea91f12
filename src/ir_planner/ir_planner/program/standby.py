"""Which power mode a pause should be spent in, and when to wake: the mode whose energy over it is least.

A mode may be entered when the pause covers going in, the shortest stay and coming out. While going in the
power is that of the mode that is left (standing on motors), while coming out that of standing on motors as
well: an assumption of the power data that decides every break-even. Left to itself, the controller stands on
motors until its timer closes the brakes, and opens them when the next movement asks, which starts later then.
"""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.modes import REST_MODES, Mode
from ir_msgs_py.power import PowerMode
from ir_msgs_py.status import StatusCode
from ir_msgs_py.transitions import TransitionTimes
from ir_planner.checks import holding_watts
from ir_planner.errors import RequestError
from ir_planner.scene import PlanningScene

MOTORS, BRAKES = "STAND_ON_MOTORS", "STAND_ON_BRAKES"
PAUSE_MAX = 604_800.0  # s: a week


@dataclass(frozen=True)
class Standby:
    """chosen mode, wake_at [s from the start of the pause], energy over the pause [J].

    saving [J]: against what the controller does by itself (`timer` s on motors, then on brakes);
    saving_on_motors [J]: against standing on motors all the time. alternatives: all modes, shallow to deep,
    and their energies [J] (inf: the pause is too short); on motors with what the controller does itself.
    """

    chosen: PowerMode
    wake_at: float
    energy: float
    saving: float
    saving_on_motors: float
    timer: float
    alternatives: tuple[PowerMode, ...]
    energies: tuple[float, ...]

    @property
    def sentence(self) -> str:
        """What is saved, against what."""
        return (
            f"{self.chosen.name} saves {self.saving:.0f} J against the controller's own timer (brakes after "
            f"{self.timer:g} s on motors), {self.saving_on_motors:.0f} J against standing on motors"
        )


def mode_watts(name: str, q: FloatArray, scene: PlanningScene) -> float:
    """Mains power [W] in a mode at q (n,): controller, tool (its bus share while the drive bus is up),
    holding torque.
    """
    if name == MOTORS:
        return holding_watts(q, scene)
    always = sum(load.watts_always for load in scene.loads)
    bus = sum(load.watts_drive_bus for load in scene.loads) if name == BRAKES else 0.0
    return scene.power.mode(name).controller_watts + always + bus


def pause_energy(
    name: str, pause: float, q: FloatArray, scene: PlanningScene, times: TransitionTimes
) -> float:
    """Energy [J] of a pause [s] in a mode until the next movement can start, inf when it is too short for it.

    The robot stands at q (n,). On motors: with what the controller does by itself.
    """
    if name == MOTORS:
        return _energy_by_itself(pause, q, scene, times)
    change = times.enter(name) + times.leave(name)
    if pause < change + times.minimum_stay(name):
        return float("inf")
    return mode_watts(MOTORS, q, scene) * change + mode_watts(name, q, scene) * (pause - change)


def late_start(pause: float, scene: PlanningScene, times: TransitionTimes) -> float:
    """How much later than the end of a pause [s] on motors the next movement starts: the brakes that the
    controller has closed must open.
    """
    begun = pause - scene.power.motors_to_brakes_in_program
    if begun < 0.0:
        return 0.0
    closed = times.enter(BRAKES) + times.minimum_stay(BRAKES)
    return max(closed - begun, 0.0) + times.leave(BRAKES)


def _energy_by_itself(pause: float, q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> float:
    """Energy [J] of a pause that the controller is left to, and of opening its brakes afterwards."""
    motors, brakes = mode_watts(MOTORS, q, scene), mode_watts(BRAKES, q, scene)
    late = late_start(pause, scene, times)
    if late == 0.0:
        return motors * pause
    on_motors = scene.power.motors_to_brakes_in_program + times.enter(BRAKES) + times.leave(BRAKES)
    return motors * on_motors + brakes * (pause + late - on_motors)


def plan_standby(pause: float, q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> Standby:
    """The mode of least energy for a pause [s] at q (n,). Raises RequestError for a pause that is none."""
    if not (np.isfinite(pause) and 0.0 < pause <= PAUSE_MAX):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS, f"pause is {pause:g} s: it must be in (0, {PAUSE_MAX:g}] s"
        )
    modes = tuple(_mode(name, q, scene, times) for name in REST_MODES)
    energies = tuple(pause_energy(name, pause, q, scene, times) for name in REST_MODES)
    k = int(np.argmin(energies))
    return Standby(
        chosen=modes[k],
        wake_at=pause - times.leave(REST_MODES[k]),
        energy=energies[k],
        saving=energies[0] - energies[k],
        saving_on_motors=mode_watts(MOTORS, q, scene) * pause - energies[k],
        timer=scene.power.motors_to_brakes_in_program,
        alternatives=modes,
        energies=energies,
    )


def _mode(name: str, q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> PowerMode:
    data = scene.power.mode(name)
    motors = mode_watts(MOTORS, q, scene)
    enter, leave, stay = times.enter(name), times.leave(name), times.minimum_stay(name)
    return PowerMode(
        mode=Mode[name],
        name=name,
        pe_mode_id=data.pe_mode_id,
        power=mode_watts(name, q, scene),
        time_min_pause=enter + leave + stay,
        time_to_pause=enter,
        regular_time_to_operate=leave,
        time_min_length_of_stay=stay,
        energy_to_pause=motors * enter,
        energy_to_operate=motors * leave,
        break_even=break_even(name, q, scene, times),
    )


def break_even(name: str, q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> float:
    """Pause [s] at q (n,) from which a mode saves against the next shallower one, both entered from motors;
    inf: never.
    """
    k = REST_MODES.index(name)
    if k == 0:
        return 0.0
    motors = mode_watts(MOTORS, q, scene)
    shallower, deeper = REST_MODES[k - 1], name
    watts = [mode_watts(mode, q, scene) for mode in (shallower, deeper)]
    extra = [
        (motors - power) * (times.enter(mode) + times.leave(mode))
        for mode, power in zip((shallower, deeper), watts, strict=True)
    ]
    gain = watts[0] - watts[1]
    return float("inf") if gain <= 0.0 else max((extra[1] - extra[0]) / gain, 0.0)
