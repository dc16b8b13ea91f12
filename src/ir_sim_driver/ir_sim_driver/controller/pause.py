"""PROFIenergy: the modes with their powers, times and energies, and the one that suits a pause.

Rule: enter mode m for a pause T when T >= enter + leave + minimum stay, and
E_enter + E_leave + P_m (T - enter - leave) is below the energy of every other choice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise

from ir_msgs_py.modes import Mode
from ir_msgs_py.plc import OperatingMode
from ir_msgs_py.power import PowerMode
from ir_msgs_py.status import StatusCode
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plc.inputs import Plc
from ir_sim_driver.power.power_modes import PowerModes, Rest

PAUSE_MAX = 604_800.0  # s: a week
_MAY_PAUSE = (Mode.STAND_ON_MOTORS, Mode.MOVING, Mode.STAND_ON_BRAKES, Mode.TO_BRAKES)


class Pauses:
    """PROFIenergy's commands on the power modes. rest: the mode of the pause that is on, or None.

    power: watts at the mains in a mode with the present load and posture; pe_ids: PROFIenergy's numbers.
    """

    def __init__(
        self, modes: PowerModes, plc: Plc, power: Callable[[Mode], float], pe_ids: Mapping[Mode, int]
    ) -> None:
        self._modes, self._plc, self._power, self._pe_ids = modes, plc, power, pe_ids
        self.rest: Mode | None = None
        self.wants_motors = False

    def query_modes(self) -> tuple[PowerMode, ...]:
        """All modes with the present load and posture, entered from where the robot is now."""
        source = self._modes.level
        if source not in (Mode.STAND_ON_MOTORS, Mode.STAND_ON_BRAKES):
            source = Mode.STAND_ON_MOTORS
        return mode_table(self._modes.rests, self._power, self._pe_ids, source)

    def start(self, pause: float, executing: bool) -> PowerMode:
        """Start_Pause of `pause` [s]: go to the mode that takes least energy. Raises RequestRefusedError."""
        if not 0.0 < pause <= PAUSE_MAX:
            raise RequestRefusedError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"pause is {pause:g} s: it must be in (0, {PAUSE_MAX:g}] s",
            )
        reason = self._refusal(executing)
        if reason:
            raise RequestRefusedError(StatusCode.INVALID_ROBOT_STATE, f"no pause: {reason}")
        chosen = best_mode(self.query_modes(), pause)
        self.rest = None if chosen.mode is Mode.STAND_ON_MOTORS else chosen.mode
        return chosen

    def end(self) -> float:
        """End_Pause: back to motors; returns the seconds it takes, the rest of the minimum stay included."""
        self.rest = None
        self.wants_motors = True
        return self._modes.time_to_ready()

    def _refusal(self, executing: bool) -> str:
        plc, mode = self._plc, self._modes.mode
        if plc.operating_mode is not OperatingMode.EXT:
            return f"operating mode is {plc.operating_mode.name}, must be EXT"
        if plc.levels.ab or plc.levels.hib or plc.levels.ks:
            return "a power bit of the PLC is 1: PROFIenergy and AB, HIB, KS exclude each other"
        if executing:
            return "the robot is executing a trajectory"
        if mode not in _MAY_PAUSE:
            return f"the mode is {mode.name}, must be STAND_ON_MOTORS or STAND_ON_BRAKES"
        return ""


def mode_table(
    rests: Mapping[Mode, Rest], power: Callable[[Mode], float], pe_ids: Mapping[Mode, int], source: Mode
) -> tuple[PowerMode, ...]:
    """Modes from shallow to deep as they are when entered from `source` (motors or a rest).

    power: watts at the mains in a mode with the present load and posture.
    """
    motors = power(Mode.STAND_ON_MOTORS)
    table = [PowerMode(mode=Mode.STAND_ON_MOTORS, pe_mode_id=pe_ids[Mode.STAND_ON_MOTORS], power=motors)]
    table += [
        PowerMode(
            mode=rest.mode,
            pe_mode_id=pe_ids[rest.mode],
            power=power(rest.mode),
            time_min_pause=rest.enter + rest.leave + rest.minimum_stay,
            time_to_pause=rest.enter,
            regular_time_to_operate=rest.leave,
            time_min_length_of_stay=rest.minimum_stay,
            energy_to_pause=0.0 if source is rest.mode else rest.enter * power(source),
            energy_to_operate=rest.leave * motors,
        )
        for rest in rests.values()
    ]
    return tuple(_with_break_even(table))


def energy_of(mode: PowerMode, pause: float) -> float:
    """Energy [J] over a pause [s] that is spent in the mode, ways in and out included."""
    enter = mode.time_to_pause if mode.energy_to_pause > 0.0 else 0.0
    stay = pause - enter - mode.regular_time_to_operate
    return mode.energy_to_pause + mode.energy_to_operate + mode.power * stay


def best_mode(table: tuple[PowerMode, ...], pause: float) -> PowerMode:
    """The mode with the least energy among those that the pause [s] is long enough for."""
    fitting = [mode for mode in table if pause >= mode.time_min_pause]
    return min(fitting, key=lambda mode: energy_of(mode, pause))


def _with_break_even(table: list[PowerMode]) -> list[PowerMode]:
    """Pause from which each mode saves against the next shallower one; never shorter than its least pause."""
    result = table[:1]
    for shallower, mode in pairwise(table):
        slope = shallower.power - mode.power
        start = energy_of(mode, 0.0) - energy_of(shallower, 0.0)
        pays = start / slope if slope > 0.0 else math.inf
        result.append(replace(mode, break_even=max(pays, mode.time_min_pause)))
    return result
