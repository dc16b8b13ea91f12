"""What was asked for once and stays so until it is done: drives off, recovery, cold start,
waking.
"""

from __future__ import annotations

from ir_msgs_py.modes import OFF_THE_NETWORK, Mode
from ir_sim_driver.plc import Plc


class Latches:
    """drives_off: it came and no drives_on since. recover, restart, wake: waiting to be acted
    upon.
    """

    def __init__(self) -> None:
        self.drives_off = self.recover = self.restart = self.wake = False
        self._confirmed = False

    def react(self, plc: Plc) -> bool:
        """Take the edges of this step; returns whether motors are asked for."""
        if plc.levels.drives_off:
            self.drives_off = True
        asked = plc.drives_on and not plc.levels.drives_off
        if asked:
            self.drives_off = False
            if self._confirmed and not plc.pressed:
                plc.reset_stop()
                self.recover = True
        if plc.confirm and not plc.pressed:
            self._confirmed = True
        self.restart = self.restart or plc.restart
        return asked

    def mode_changed(self, before: Mode, now: Mode) -> None:
        """Forget what the change of the power mode has done or made void."""
        if Mode.EMERGENCY_STOP in (before, now):
            self.recover = self._confirmed = False
        if before is Mode.FROM_HIBERNATION:
            self.restart = False
        if now in OFF_THE_NETWORK:
            self.restart = self.drives_off = False
