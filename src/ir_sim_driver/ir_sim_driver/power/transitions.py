"""How long the power modes last: times of every rest by its mode, and the controller's own
timers.
"""

from __future__ import annotations

from dataclasses import dataclass

from ir_msgs_py.modes import RESTS, Mode
from ir_msgs_py.settings import check_settings, setting
from ir_msgs_py.transitions import TransitionTimes

_WEEK = 604_800.0


@dataclass(frozen=True)
class IdleTimes:
    """When the controller closes the brakes by itself."""

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
    """Seconds into a rest (enter), out of it to motors on (leave), and at least in it
    (minimum_stay).
    """

    enter: float
    leave: float
    minimum_stay: float


def times_of(transitions: TransitionTimes) -> dict[Mode, Times]:
    """Times of every rest of the table."""
    names = {row.mode: row.mode.name for row in RESTS}
    return {
        mode: Times(
            transitions.enter(name), transitions.leave(name), transitions.minimum_stay(name)
        )
        for mode, name in names.items()
    }
