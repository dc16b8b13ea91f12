"""Stop, acknowledgement and recovery: one state machine for all stops of the controller.

It is the table "Stop, acknowledgement, recovery" of docs/driver.md, row by row. A reference machine
in tests/driver/stop_reference.py is written from the same table and shares no code with this one.

Every stop has a number. Levels have the order in which they rose, so that an acknowledgement counts
only for a stop that came before it: levels of one message rise together, none follows the other.
"""

from __future__ import annotations

import time
from enum import Enum

from ir_msgs_py.status import StatusCode
from ir_msgs_py.stop_numbers import stop_count
from ir_sim_driver.errors import RequestRefusedError


class StopState(Enum):
    """Rows of the table."""

    RUN = "run"
    PRESSED = "pressed"
    RELEASED = "released"
    ACKNOWLEDGED = "acknowledged"
    FAULT = "fault"
    PRESSED_FAULT = "pressed, with a fault"


_PRESS = {
    StopState.FAULT: StopState.PRESSED_FAULT,
    StopState.PRESSED_FAULT: StopState.PRESSED_FAULT,
}
_FAULT = {
    StopState.PRESSED: StopState.PRESSED_FAULT,
    StopState.PRESSED_FAULT: StopState.PRESSED_FAULT,
}
_RELEASE = {
    StopState.PRESSED: StopState.RELEASED,
    StopState.PRESSED_FAULT: StopState.FAULT,
}
_PUSHED = (StopState.PRESSED, StopState.PRESSED_FAULT)


class StopMachine:
    """state: where it is. number: of the last stop, at first `before`: the number before the first.

    at_ns: time of that stop on the host's monotonic clock. Orders grow with every message that is
    written.
    """

    def __init__(self, before: int = 0) -> None:
        self.state = StopState.RUN
        self.number = before
        self.at_ns = 0
        self._since = 0
        self._acknowledged = 0

    @property
    def stopped(self) -> bool:
        """Whether a stop is latched: nothing moves until a person recovers."""
        return self.state is not StopState.RUN

    @property
    def pressed(self) -> bool:
        """Whether the button is pressed, or its release has not counted yet."""
        return self.state in _PUSHED

    @property
    def faulty(self) -> bool:
        """Whether a fault is latched, which only `recover` takes away."""
        return self.state in (StopState.FAULT, StopState.PRESSED_FAULT)

    def came_later(self, came_ns: int) -> bool:
        """Whether the last stop came after this time of the monotonic clock; 0: it did not."""
        return 0 < came_ns < self.at_ns

    def refuse_earlier(self, came_ns: int, what: str) -> None:
        """Raise RequestRefusedError where a request came before the last stop, and waited."""
        if self.came_later(came_ns):
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE,
                f"{what} came before stop {stop_count(self.number)}: ask again",
            )

    def press(self, order: int) -> None:
        """The button goes down, in whatever mode or transition."""
        self._count(order)
        self.state = _PRESS.get(self.state, StopState.PRESSED)

    def press_again(self, order: int) -> None:
        """The button went down again, and that it was let go between is known only now."""
        at_ns = self.at_ns
        self.press(order)
        self.at_ns = at_ns

    def fault(self, order: int) -> None:
        """The supervision, the physics or a contact stops the robot."""
        if not self.faulty:
            self._count(order)
            self.state = _FAULT.get(self.state, StopState.FAULT)

    def _count(self, order: int) -> None:
        self.number += 1
        self.at_ns = time.monotonic_ns()
        self._since = order  # of the last stop or release

    def release(self, order: int) -> None:
        """The button is up, and has been for the debounce; order: of the level that let go."""
        if self.state in _PUSHED:
            self._since = order
            self.state = _RELEASE[self.state]

    def acknowledge(self, order: int) -> None:
        """conf_mess rose in this order: it counts where the stop and its release came before."""
        if self.state is StopState.RELEASED and order > self._since:
            self._acknowledged = order
            self.state = StopState.ACKNOWLEDGED

    def switch_on(self, order: int) -> bool:
        """drives_on rose in this order; whether it recovers: the acknowledgement came before."""
        if self.state is not StopState.ACKNOWLEDGED or order <= self._acknowledged:
            return False
        self.state = StopState.RUN
        return True

    def leave_network(self) -> None:
        """The controller goes off the network: what was acknowledged there is forgotten."""
        if self.state is StopState.ACKNOWLEDGED:
            self.state = StopState.RELEASED

    def recover(self) -> bool:
        """A person recovers by the service; False while the button is pressed."""
        if self.state in _PUSHED:
            return False
        self.state = StopState.RUN
        return True
