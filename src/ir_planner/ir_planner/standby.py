"""Which power mode a pause should be spent in, and when to wake: the mode whose energy over the pause is least.

A mode may be entered when the pause covers going in, the shortest stay and coming out. While going in the power is
that of standing on motors, while coming out as well: an assumption of the power data that decides every break-even.
"""

from dataclasses import dataclass

import numpy as np
from ir_description.power import PowerMode as ModeData
from ir_msgs_py.power import REST_MODES, Mode, PowerMode
from ir_msgs_py.status import StatusCode
from numpy.typing import NDArray

from ir_planner.energy import holding_watts
from ir_planner.errors import RequestError
from ir_planner.scene import PlanningScene

FloatArray = NDArray[np.float64]
PAUSE_MAX = 604_800.0  # s: a week


@dataclass(frozen=True)
class Standby:
    """chosen mode, wake_at [s from the start of the pause], energy over the pause [J], saving against motors on [J].

    alternatives: all modes, shallow to deep, and their energies [J] (inf: the pause is too short).
    """

    chosen: PowerMode
    wake_at: float
    energy: float
    saving: float
    alternatives: tuple[PowerMode, ...]
    energies: tuple[float, ...]


def mode_watts(name: str, q: FloatArray, scene: PlanningScene) -> float:
    """Mains power [W] in a mode: controller, tool (its bus share only while the drive bus is up), holding torque."""
    if name == "STAND_ON_MOTORS":
        return holding_watts(q, scene)
    always = sum(load.watts_always for load in scene.loads)
    bus = sum(load.watts_drive_bus for load in scene.loads) if name == "STAND_ON_BRAKES" else 0.0
    return scene.power.mode(name).controller_watts + always + bus


def pause_energy(name: str, pause: float, q: FloatArray, scene: PlanningScene, scale: float = 1.0) -> float:
    """Energy [J] of a pause [s] in a mode, inf when it is too short for it. `scale`: of the transition times."""
    motors = mode_watts("STAND_ON_MOTORS", q, scene)
    if name == "STAND_ON_MOTORS":
        return motors * pause
    mode = scene.power.mode(name)
    change = scale * (mode.time_to_pause + mode.regular_time_to_operate)
    if pause < max(change + scale * mode.minimum_stay, scale * mode.time_min_pause):
        return float("inf")
    return motors * change + mode_watts(name, q, scene) * (pause - change)


def plan_standby(pause: float, q: FloatArray, scene: PlanningScene, scale: float = 1.0) -> Standby:
    """The mode of least energy for a pause [s] at q (n,). Raises RequestError for a pause that is none."""
    if not (np.isfinite(pause) and 0.0 < pause <= PAUSE_MAX):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS, f"pause is {pause:g} s: it must be in (0, {PAUSE_MAX:g}] s"
        )
    modes = tuple(_mode(name, q, scene, scale) for name in REST_MODES)
    energies = tuple(pause_energy(name, pause, q, scene, scale) for name in REST_MODES)
    k = int(np.argmin(energies))
    wake = pause if k == 0 else pause - modes[k].regular_time_to_operate
    return Standby(modes[k], wake, energies[k], energies[0] - energies[k], modes, energies)


def _mode(name: str, q: FloatArray, scene: PlanningScene, scale: float) -> PowerMode:
    data = scene.power.mode(name)
    motors, watts = mode_watts("STAND_ON_MOTORS", q, scene), mode_watts(name, q, scene)
    resting = name != "STAND_ON_MOTORS"
    return PowerMode(
        mode=Mode[name],
        name=name,
        pe_mode_id=data.pe_mode_id,
        power=watts,
        time_min_pause=scale * max(data.time_min_pause, data.minimum_stay + _change(data)),
        time_to_pause=scale * data.time_to_pause,
        regular_time_to_operate=scale * data.regular_time_to_operate,
        time_min_length_of_stay=scale * data.minimum_stay,
        energy_to_pause=motors * scale * data.time_to_pause if resting else 0.0,
        energy_to_operate=motors * scale * data.regular_time_to_operate if resting else 0.0,
        break_even=break_even(name, q, scene, scale),
    )


def _change(data: ModeData) -> float:
    return data.time_to_pause + data.regular_time_to_operate


def break_even(name: str, q: FloatArray, scene: PlanningScene, scale: float = 1.0) -> float:
    """Pause [s] from which a mode saves against the next shallower one, both entered from motors; inf: never."""
    k = REST_MODES.index(name)
    if k == 0:
        return 0.0
    motors = mode_watts("STAND_ON_MOTORS", q, scene)
    offsets, watts = [], []
    for mode in REST_MODES[k - 1 : k + 1]:
        power = mode_watts(mode, q, scene)
        change = 0.0 if mode == "STAND_ON_MOTORS" else scale * _change(scene.power.mode(mode))
        offsets.append((motors - power) * change)
        watts.append(power)
    gain = watts[0] - watts[1]
    return float("inf") if gain <= 0.0 else (offsets[1] - offsets[0]) / gain
