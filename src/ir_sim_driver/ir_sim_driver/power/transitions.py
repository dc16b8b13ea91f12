"""How long the transitions of the power modes take: settings, fixed at the start."""

from __future__ import annotations
from ir_msgs_py.modes import Mode, RESTS

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting


_WEEK = 604_800.0
_WHAT = ("enter", "leave", "minimum_stay")


@dataclass(frozen=True)
class TransitionSettings:
    """Times into and out of each rest and the shortest stay in it, under the names of
    ir_msgs_py.transitions, but fixed at the start; and the controller's own timers.
    """

    stand_on_brakes_enter: float = setting(
        0.3, "Motors to brakes.", unit="s", minimum=0.0, maximum=_WEEK, read_only=True
    )
    stand_on_brakes_leave: float = setting(
        0.7, "Brakes to motors.", unit="s", minimum=0.0, maximum=_WEEK, read_only=True
    )
    stand_on_brakes_minimum_stay: float = setting(
        1.0, "Shortest stay on brakes.", unit="s", minimum=0.0, maximum=_WEEK, read_only=True
    )
    bus_power_off_enter: float = setting(
        3.0, "Into Bus Power Off.", unit="s", minimum=0.0, maximum=_WEEK, read_only=True
    )
    bus_power_off_leave: float = setting(
        20.0, "Bus Power Off to motors.", unit="s", minimum=0.0, maximum=_WEEK, read_only=True
    )
    bus_power_off_minimum_stay: float = setting(
        2.0, "Shortest Bus Power Off.", unit="s", minimum=0.0, maximum=_WEEK, read_only=True
    )
    hibernation_enter: float = setting(
        60.0, "Into hibernation.", unit="s", minimum=0.0, maximum=_WEEK, read_only=True
    )
    hibernation_leave: float = setting(
        120.0, "Hibernation to motors.", unit="s", minimum=0.0, maximum=_WEEK, read_only=True
    )
    hibernation_minimum_stay: float = setting(
        120.0, "Shortest hibernation.", unit="s", minimum=0.0, maximum=_WEEK, read_only=True
    )
    motors_to_brakes_in_program: float = setting(
        20.0,
        "Standing on motors before the brakes close, in AUT and EXT.",
        unit="s",
        minimum=0.0,
        maximum=_WEEK,
        read_only=True,
    )
    motors_to_brakes_in_command: float = setting(
        10.0,
        "Standing on motors before the brakes close, in T1 and T2.",
        unit="s",
        minimum=0.0,
        maximum=_WEEK,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class Times:
    """Seconds into a rest (enter), out of it to motors on (leave), and at least in it (minimum_stay)."""

    enter: float
    leave: float
    minimum_stay: float


def times_of(settings: TransitionSettings) -> dict[Mode, Times]:
    """Times of every rest of the table: the settings are named after the mode."""
    return {
        row.mode: Times(*(float(getattr(settings, f"{row.mode.name.lower()}_{what}")) for what in _WHAT))
        for row in RESTS
    }
