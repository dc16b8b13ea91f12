"""PROFIenergy: the modes with their powers, times and energies, and the one that suits a pause.

Rule: enter mode m for a pause T when T >= enter + leave + minimum stay, and
E_enter + E_leave + P_m (T - enter - leave) is below the energy of every other choice. E_leave holds
what charges the DC link again where the drive bus was off: the whole charge in the table, in the
choice that of the time it was off.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import pairwise

from ir_description.robot import DcLink
from ir_msgs_py.modes import DRIVES_ON, PAUSE_ROUNDING, ROW, Mode, PowerMode, RestTimes

_ROUNDS = 50  # of a break-even whose cost depends on it
PAUSE_MAX = 604_800.0  # s: a week

Charging = Callable[[float], float]
"""J from the mains for a DC link that was cut from them for so many s."""


def charging_of(link: DcLink) -> Charging:
    """Of the controller's DC link, through its precharge resistor."""
    if link.discharge is None:
        return uncharged
    whole = link.capacitance * link.voltage**2
    return lambda seconds: whole * (1.0 - math.exp(-link.discharge_rate * seconds))


def uncharged(seconds: float) -> float:
    """Of a link that keeps its charge."""
    return 0.0


def mode_table(
    times: Mapping[Mode, RestTimes],
    power: Callable[[Mode], float],
    pe_ids: Mapping[Mode, int],
    source: Mode,
    charging: Charging = uncharged,
) -> tuple[PowerMode, ...]:
    """Modes from shallow to deep as they are when entered from `source` (motors or a rest).

    power: watts at the mains in a mode with the present load and posture.
    """
    whole = charging(math.inf)
    motors = power(Mode.STAND_ON_MOTORS)
    table = [
        PowerMode(mode=Mode.STAND_ON_MOTORS, pe_mode_id=pe_ids[Mode.STAND_ON_MOTORS], power=motors)
    ]
    table += [
        PowerMode(
            mode=mode,
            pe_mode_id=pe_ids[mode],
            power=power(mode),
            time_min_pause=rest.shortest,
            time_to_pause=rest.enter,
            regular_time_to_operate=rest.leave,
            time_min_length_of_stay=rest.stay,
            energy_to_pause=0.0 if source is mode else rest.enter * power(source),
            energy_to_operate=rest.leave * motors + (0.0 if mode in DRIVES_ON else whole),
        )
        for mode, rest in times.items()
    ]
    return tuple(_with_break_even(table, charging))


def energy_of(mode: PowerMode, pause: float, charging: Charging = uncharged) -> float:
    """Energy [J] over a pause [s] that is spent in the mode, transitions included."""
    enter = mode.time_to_pause if mode.energy_to_pause > 0.0 else 0.0
    stay = pause - enter - mode.regular_time_to_operate
    energy = mode.energy_to_pause + mode.energy_to_operate + mode.power * stay
    if mode.mode not in DRIVES_ON:
        energy += charging(max(stay, 0.0)) - charging(math.inf)
    return energy


def best_route(
    table: tuple[PowerMode, ...],
    pause: float,
    source: Mode,
    source_watts: float,
    charging: Charging = uncharged,
) -> tuple[PowerMode, ...]:
    """The modes that a pause [s] takes least energy in, one after the other, each no longer than it
    must be but for the last; empty: stay in `source`, which draws source_watts, on motors or in a
    rest.

    A mode is entered at the power of the one before. Of routes that cost the same the shallower
    one, as in the planner's choice for pauses of a program (`Rests.known` of ir_planner).
    """
    motors = table[0].power
    deeper = [
        mode
        for mode in table[1:]
        if ROW[mode.mode].depth >= ROW[source].depth and mode.mode is not source
    ]
    leave = next(mode.regular_time_to_operate for mode in table if mode.mode is source)
    route: tuple[PowerMode, ...] = ()
    best = motors * leave + source_watts * (pause - leave)
    if source not in DRIVES_ON:
        best += charging(pause - leave)
    for count in range(1, len(deeper) + 1):
        for modes in itertools.combinations(deeper, count):
            energy = 0.0
            left = pause
            watts = source_watts
            since = None if source in DRIVES_ON else 0.0
            for mode in modes:
                if since is None and mode.mode not in DRIVES_ON:
                    since = pause - left + mode.time_to_pause
                energy += watts * mode.time_to_pause + mode.power * mode.time_min_length_of_stay
                left -= mode.time_to_pause + mode.time_min_length_of_stay
                watts = mode.power
            left -= modes[-1].regular_time_to_operate
            energy += motors * modes[-1].regular_time_to_operate + watts * left
            if since is not None:
                woken = pause - modes[-1].regular_time_to_operate
                energy += charging(max(woken - since, 0.0))
            if left >= -PAUSE_ROUNDING and energy < best:
                best = energy
                route = modes
    return route


def _with_break_even(table: list[PowerMode], charging: Charging) -> list[PowerMode]:
    """Pause from which each mode saves against the next shallower one; never shorter than its least
    pause.
    """
    result = table[:1]
    for shallower, mode in pairwise(table):
        pays = _crossing(shallower, mode, charging)
        result.append(replace(mode, break_even=max(pays, mode.time_min_pause)))
    return result


def _crossing(shallower: PowerMode, mode: PowerMode, charging: Charging) -> float:
    """Pause [s] from which a mode takes less than a shallower one."""
    slope = shallower.power - mode.power
    if slope <= 0.0:
        return math.inf
    pays = 0.0
    for _ in range(_ROUNDS):
        more = energy_of(mode, pays, charging) - energy_of(shallower, pays, charging)
        pays += more / slope
    return pays
