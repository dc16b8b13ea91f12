"""Times into and out of the power modes, and the shortest stay in each.

Planner, driver and program runner have one parameter for each, under the same name: PREFIX and the
field's.
"""

from __future__ import annotations

from dataclasses import dataclass

from ir_msgs_py.modes import Mode
from ir_msgs_py.power import PowerMode
from ir_msgs_py.settings import check_settings, setting

PREFIX = "transitions."  # of the parameters
_WEEK = 604_800.0


@dataclass(frozen=True)
class TransitionTimes:
    """Seconds into a rest (enter), out of it to motors on (leave), and at least in it
    (minimum_stay).
    """

    stand_on_brakes_enter: float = setting(
        0.3, "Motors to brakes.", unit="s", minimum=0.0, maximum=_WEEK
    )
    stand_on_brakes_leave: float = setting(
        0.7, "Brakes to motors.", unit="s", minimum=0.0, maximum=_WEEK
    )
    stand_on_brakes_minimum_stay: float = setting(
        1.0, "Shortest stay on brakes.", unit="s", minimum=0.0, maximum=_WEEK
    )
    bus_power_off_enter: float = setting(
        3.0, "Into Bus Power Off.", unit="s", minimum=0.0, maximum=_WEEK
    )
    bus_power_off_leave: float = setting(
        20.0, "Bus Power Off to motors.", unit="s", minimum=0.0, maximum=_WEEK
    )
    bus_power_off_minimum_stay: float = setting(
        2.0, "Shortest Bus Power Off.", unit="s", minimum=0.0, maximum=_WEEK
    )
    hibernation_enter: float = setting(
        60.0, "Into hibernation.", unit="s", minimum=0.0, maximum=_WEEK
    )
    hibernation_leave: float = setting(
        120.0, "Hibernation to motors.", unit="s", minimum=0.0, maximum=_WEEK
    )
    hibernation_minimum_stay: float = setting(
        120.0, "Shortest hibernation.", unit="s", minimum=0.0, maximum=_WEEK
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def enter(self, mode: str) -> float:
        """Time [s] into a mode from standing on motors."""
        return self._of(mode, "enter")

    def leave(self, mode: str) -> float:
        """Time [s] from a mode to motors on."""
        return self._of(mode, "leave")

    def minimum_stay(self, mode: str) -> float:
        """Shortest stay [s] in a mode."""
        return self._of(mode, "minimum_stay")

    def _of(self, mode: str, what: str) -> float:
        return 0.0 if mode == "STAND_ON_MOTORS" else float(getattr(self, f"{mode.lower()}_{what}"))

    def of(self, mode: Mode) -> PowerMode:
        """A mode to rest in with its times alone."""
        return PowerMode(
            mode=mode,
            time_min_pause=self.enter(mode.name)
            + self.minimum_stay(mode.name)
            + self.leave(mode.name),
            time_to_pause=self.enter(mode.name),
            regular_time_to_operate=self.leave(mode.name),
            time_min_length_of_stay=self.minimum_stay(mode.name),
        )
