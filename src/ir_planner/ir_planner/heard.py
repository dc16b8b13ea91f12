"""What a driver publishes about its controller and its load, and what counts while no driver does."""

from collections.abc import Callable
from dataclasses import replace

from ir_description import PowerData
from ir_msgs_py.announced import DATA, DRIVER, CarriedLoad, ControllerTimers
from ir_msgs_py.transitions import TransitionTimes


class Heard:
    """timers, load: what the driver says, None while no driver does. settings: asked for the transition times
    where no driver says them.
    """

    def __init__(self, settings: Callable[[], TransitionTimes]) -> None:
        self._settings = settings
        self.timers: ControllerTimers | None = None
        self.load: CarriedLoad | None = None

    def of(self, data: PowerData) -> PowerData:
        """A controller's figures as its file has them, with the timer that counts."""
        if self.timers is None or not data.has_table:
            return data
        return replace(data, motors_to_brakes_in_program=self.timers.brakes_after)

    @property
    def transitions(self) -> TransitionTimes:
        """Transition times that count."""
        return self._settings() if self.timers is None else self.timers.transitions

    @property
    def source(self) -> str:
        """Where timer and transition times are from."""
        return DATA if self.timers is None else DRIVER
