"""Which power mode is asked for: PLC bits, pauses and latches put together, and why no movement may
start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ir_msgs_py.modes import DRIVES_ON, OFF_THE_NETWORK, READY, ROW, Mode
from ir_msgs_py.plc import OperatingMode, PlcOutputs
from ir_sim_driver.controller.latches import Latches
from ir_sim_driver.controller.pauses import Pauses
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.plc import Plc
from ir_sim_driver.power import Demand, PowerModes

MANUAL = (OperatingMode.T1, OperatingMode.T2)
_STOPS = "was requested during the movement; stopped on the path"


class ModeControl:
    """Decides about the power modes of one controller.

    power: watts at the mains in a mode with the present load and posture; pe_ids: PROFIenergy's
    numbers.
    """

    def __init__(
        self,
        settings: SimulationSettings,
        plc: Plc,
        power: Callable[[Mode], float],
        pe_ids: Mapping[Mode, int],
    ) -> None:
        self._enabling_switch = settings.controller.enabling_switch
        self._plc = plc
        self.modes = PowerModes(
            settings.transitions, settings.idle, settings.controller.rest_at_start
        )
        self.pauses = Pauses(self.modes, plc, power, pe_ids)
        self.latches = Latches()
        self._operating_mode = plc.operating_mode
        self._demand = Demand()

    def react_to_plc(self) -> str:
        """Take what is new from the PLC; why a movement stops therefore, "" when it goes on."""
        if self.latches.react(self._plc):
            self.pauses.wants_motors = True
        if self._plc.operating_mode is self._operating_mode:
            return ""
        self._operating_mode = self._plc.operating_mode
        return f"the operating mode changed to {self._operating_mode.name}; stopped on the path"

    def interruption(self) -> str:
        """Why the power mode that is asked for stops a movement, "" when it goes on."""
        latches = self.latches
        if latches.restart:
            return f"Cold start {_STOPS}"
        if self._plc.rest is None and not (latches.drives_off or self.pauses.active):
            return ""
        rest = self._rest()
        return "" if rest in (None, Mode.STAND_ON_MOTORS) else f"{ROW[rest].name} {_STOPS}"

    def step(
        self, dt: float, *, motion: bool, standing: bool, emergency: bool
    ) -> tuple[Mode, Mode] | None:
        """Let dt [s] pass; the modes before and after when the mode has changed.

        motion: a movement waits or runs. standing: the robot does not move. emergency: stop at
        once.
        """
        if self.modes.motors_on:
            self.pauses.wants_motors = False
        latches = self.latches
        before = self.modes.mode
        if emergency:
            latches.recover = False
        demand = (
            self._rest(),
            motion,
            standing,
            latches.wake,
            emergency,
            latches.recover,
            latches.restart,
            self._plc.operating_mode in MANUAL,
        )
        if (
            demand != self._demand
        ):  # the same one as long as nothing changes: this runs every millisecond
            self._demand = Demand(*demand)
        self.modes.step(dt, self._demand)
        latches.wake = False
        now = self.modes.mode
        if now is before:
            return None
        self._mode_changed(before, now)
        return before, now

    def refusal(self) -> str:
        """Why no movement may start now, "" when it may."""
        mode = self.modes.mode
        plc = self._plc
        if mode is Mode.EMERGENCY_STOP or plc.stopped:
            return "emergency stop: release it and recover first"
        if mode not in DRIVES_ON:
            return f"drives not powered ({mode.name})"
        rest = plc.rest or self.pauses.rest
        if rest is not None:
            return f"drives not powered: {ROW[rest].name} is requested"
        if self.latches.drives_off:
            return "drives not powered: drives_off was given, drives_on is needed"
        if plc.operating_mode in MANUAL and not self._enabling_switch:
            needed = "programs need EXT or AUT, or the enabling switch"
            return f"operating mode is {plc.operating_mode.name}: {needed}"
        return ""

    def outputs(self, *, in_home: bool) -> PlcOutputs:
        """Levels to the PLC; all off while the controller is off the network."""
        mode = self.modes.mode
        plc = self._plc
        if mode in OFF_THE_NETWORK:
            return PlcOutputs(operating_mode=plc.operating_mode)
        return PlcOutputs(
            ab=mode in (Mode.BUS_POWER_OFF, Mode.TO_HIBERNATION),
            bbs=mode in (*READY, Mode.STAND_ON_BRAKES) and not self.latches.drives_off,
            drives_ready=self.modes.motors_on,
            alarm_stop=not plc.stopped and mode is not Mode.EMERGENCY_STOP,
            in_home=in_home,
            moving=mode is Mode.MOVING,
            operating_mode=plc.operating_mode,
        )

    def _rest(self) -> Mode | None:
        """The mode to rest in that is asked for now; None: no opinion."""
        asked = self._plc.rest or self.pauses.rest
        if asked is None and self.latches.drives_off:
            return Mode.STAND_ON_BRAKES
        if asked is None and self.pauses.wants_motors:
            return Mode.STAND_ON_MOTORS
        return asked

    def _mode_changed(self, before: Mode, now: Mode) -> None:
        self.latches.mode_changed(before, now)
        if now is Mode.EMERGENCY_STOP:
            self.pauses.wants_motors = False
        elif before is Mode.FROM_HIBERNATION:
            self._plc.wake()
        if now in OFF_THE_NETWORK:
            self.pauses.forget()
