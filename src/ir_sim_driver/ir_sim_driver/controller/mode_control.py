"""Choice of the power mode from PLC bits, PROFIenergy pauses and latched requests."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ir_msgs_py.modes import DRIVES_ON, OFF_THE_NETWORK, READY, RESTS, ROW, Mode, PowerMode
from ir_msgs_py.plc import OperatingMode, PlcOutputs
from ir_msgs_py.status import StatusCode
from ir_msgs_py.stop_numbers import stop_count
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plc import OFF_BIT, POWER_BITS, Plc
from ir_sim_driver.power import (
    PAUSE_MAX,
    Charging,
    Demand,
    PowerModes,
    best_route,
    mode_table,
    uncharged,
)

# Latched requests: drives off, recovery, cold start, waking.


class Latches:
    """drives_off: it came and no drives_on since. recover, restart, wake: waiting to be acted upon.

    end_rest: number of the stop after which a program asked to open the brakes again, None: no
    program has.
    """

    def __init__(self) -> None:
        self.drives_off = False
        self.recover = False
        self.restart = False
        self.wake = False
        self.end_rest: int | None = None

    def react(self, plc: Plc, mode: Mode) -> bool:
        """Take the edges of this step in `mode`; whether motors are asked for."""
        if plc.levels.drives_off:
            self.drives_off = True
        awake = mode not in OFF_THE_NETWORK
        if plc.confirm and awake:
            plc.stop.acknowledge(plc.rose("conf_mess"))
        if not plc.drives_on or plc.levels.drives_off:
            return False
        self.forget_drives_off(plc)
        if awake and plc.stop.switch_on(plc.rose("drives_on")):
            self.recover = mode is Mode.EMERGENCY_STOP
        return True

    def rest_ended(self, plc: Plc) -> bool:
        """Whether the program's wish to leave its rest counts now; a stop makes it void, and so
        does a drives_off of anybody else.
        """
        self.let_go(plc)
        if self.end_rest is None or plc.levels.drives_off or plc.raw.drives_off:
            return False
        counts = self.end_rest == plc.stop.number and not (plc.stop.stopped or self.drives_off)
        self.end_rest = None
        return counts

    def let_go(self, plc: Plc) -> None:
        """Forget the drives_off that its only giver has taken back, once its level has fallen."""
        if plc.off_taken_back and not plc.levels.drives_off:
            self.forget_drives_off(plc)

    def forget_drives_off(self, plc: Plc) -> None:
        """Goals are no longer refused because of it."""
        self.drives_off = False
        plc.off_by.clear()
        plc.off_taken_back = False

    def mode_changed(self, plc: Plc, before: Mode, now: Mode) -> None:
        """Forget what the change of the power mode has done or made void."""
        if Mode.EMERGENCY_STOP in (before, now):
            self.recover = False
        if before is Mode.FROM_HIBERNATION or now in OFF_THE_NETWORK:
            self.restart = False
            self.forget_drives_off(plc)
        if now in OFF_THE_NETWORK:
            plc.stop.leave_network()


# PROFIenergy's commands on the running controller: start a pause, end it, ask for the modes.

_MAY_PAUSE = READY | {Mode.STAND_ON_BRAKES, Mode.TO_BRAKES}
_DEPTH = {mode: row.depth for row in RESTS for mode in (row.entering, row.mode)}


class Pauses:
    """PROFIenergy's commands on the power modes.

    wants_motors: a pause was ended, motors are asked for. power: watts at the mains in a mode with
    the present load and posture; pe_ids: PROFIenergy's numbers; charging: J for the DC link after a
    time without the drive bus.
    """

    def __init__(
        self,
        modes: PowerModes,
        plc: Plc,
        power: Callable[[Mode], float],
        pe_ids: Mapping[Mode, int],
        charging: Charging = uncharged,
    ) -> None:
        self._modes = modes
        self._plc = plc
        self._charging = charging
        self._power = power
        self._pe_ids = pe_ids
        self._route: tuple[Mode, ...] = ()
        self.wants_motors = False

    @property
    def active(self) -> bool:
        """Whether a pause is on."""
        return bool(self._route)

    @property
    def rest(self) -> Mode | None:
        """The mode that the pause asks for now, maybe not the deepest yet; None while no pause is
        on.
        """
        if not self._route:
            return None
        depth = _DEPTH.get(self._modes.mode, 0)
        # a mode that is being entered is asked for until it is reached
        settled = self._modes.mode in ROW
        return next(
            (
                mode
                for mode in self._route
                if ROW[mode].depth > depth or (ROW[mode].depth == depth and not settled)
            ),
            self._route[-1],
        )

    def forget(self) -> None:
        """No pause is on any more."""
        self._route = ()

    def query_modes(self) -> tuple[PowerMode, ...]:
        """All modes that can be left again, with the present load, entered from where the robot
        is.
        """
        source = self._modes.level
        if source not in (Mode.STAND_ON_MOTORS, Mode.STAND_ON_BRAKES):
            source = Mode.STAND_ON_MOTORS
        return self._entered_from(source)

    def _entered_from(self, source: Mode) -> tuple[PowerMode, ...]:
        times = {mode: rest for mode, rest in self._modes.times.items() if mode in self._pe_ids}
        if self._plc.no_hibernation:
            times = {mode: rest for mode, rest in times.items() if mode is not Mode.HIBERNATION}
        return mode_table(times, self._power, self._pe_ids, source, self._charging)

    def start(self, pause: float, executing: bool) -> PowerMode:
        """Start_Pause of `pause` [s] from now: go through the modes that take least energy; the
        deepest.

        Called again while the pause is on, it may go deeper, never back. Raises
        RequestRefusedError.
        """
        if not 0.0 < pause <= PAUSE_MAX:
            raise RequestRefusedError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"pause is {pause:g} s: it must be in (0, {PAUSE_MAX:g}] s",
            )
        reason = self._refusal(executing)
        if reason:
            raise RequestRefusedError(StatusCode.INVALID_ROBOT_STATE, f"no pause: {reason}")
        source = self._modes.target if self._route else self._modes.level
        table = self._entered_from(source)
        route = best_route(table, pause, source, self._power(source), self._charging)
        stays = () if source is Mode.STAND_ON_MOTORS else (source,)
        self._route = tuple(mode.mode for mode in route) or self._route or stays
        deepest = self._route[-1] if self._route else Mode.STAND_ON_MOTORS
        return next(mode for mode in table if mode.mode is deepest)

    def end(self) -> float:
        """Back to motors; returns the seconds it takes, the rest of the minimum stay included."""
        self.forget()
        self.wants_motors = True
        return self._modes.time_to_ready()

    def _refusal(self, executing: bool) -> str:
        plc = self._plc
        mode = self._modes.mode
        if plc.operating_mode is not OperatingMode.EXT:
            return f"operating mode is {plc.operating_mode.name}, must be EXT"
        if any(getattr(plc.levels, bit) for bit in POWER_BITS):
            return "a power bit of the PLC is 1: PROFIenergy and AB, HIB, KS exclude each other"
        if executing:
            return "the robot is executing a trajectory"
        if mode not in _MAY_PAUSE and not (self._route and mode in _DEPTH):
            return f"the mode is {mode.name}, must be STAND_ON_MOTORS or STAND_ON_BRAKES"
        return ""


# Decision: PLC bits, pauses and latches put together, and why no movement may start.

MANUAL = (OperatingMode.T1, OperatingMode.T2)
_STOPS = "was requested during the movement"


class ModeControl:
    """Decides about the power modes of one controller.

    power: watts at the mains in a mode with the present load and posture; pe_ids: PROFIenergy's
    numbers; charging: J for the DC link after a time without the drive bus.
    """

    def __init__(
        self,
        settings: SimulationSettings,
        plc: Plc,
        power: Callable[[Mode], float],
        pe_ids: Mapping[Mode, int],
        charging: Charging = uncharged,
    ) -> None:
        self._enabling_switch = settings.controller.enabling_switch
        self._plc = plc
        self.modes = PowerModes(
            settings.transitions, settings.idle, settings.controller.rest_at_start
        )
        self.pauses = Pauses(self.modes, plc, power, pe_ids, charging)
        self.latches = Latches()
        self._operating_mode = plc.operating_mode
        self._demand = Demand()
        self._stop_seen = plc.stop.number

    def react_to_plc(self) -> str:
        """Take what is new from the PLC; why a movement stops therefore, "" when it goes on."""
        if self.latches.react(self._plc, self.modes.mode):
            self.pauses.wants_motors = True
        if self._plc.operating_mode is self._operating_mode:
            return ""
        self._operating_mode = self._plc.operating_mode
        return f"the operating mode changed to {self._operating_mode.name}"

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
        if self._stop_seen != self._plc.stop.number:
            self._stop_seen = self._plc.stop.number
            self._forget_requests()
        if self.modes.motors_on:
            self.pauses.wants_motors = False
        latches = self.latches
        if latches.rest_ended(self._plc):
            self.pauses.wants_motors = True
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

    def take_back(self, bit: str, giver: str = "") -> None:
        """A giver takes its own 1 of one of OWN_BITS back; a drives_off is not latched any more
        then. Raises RequestRefusedError where anybody else has given it too.
        """
        self._plc.take_back(bit, giver)
        self.latches.let_go(self._plc)

    def end_rest(self, giver: str = "") -> None:
        """A program leaves the rest that its drives_off began: takes it back, and the brakes open.

        Void while a stop is latched, and never a part of a recovery. Raises RequestRefusedError,
        also where anybody but the giver has given drives_off.
        """
        if self._plc.stop.stopped:
            number = stop_count(self._plc.stop.number)
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE,
                f"stop {number} is latched: a person has to recover first",
            )
        self.take_back(OFF_BIT, giver)
        self.latches.end_rest = self._plc.stop.number

    def end_pause(self) -> float:
        """PROFIenergy End_Pause: back to motors; the seconds until they are on.

        Raises RequestRefusedError where something else keeps them off, so that the time would never
        come.
        """
        reason = self._kept_off()
        if reason:
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE, f"the pause can't be ended: {reason}"
            )
        return self.pauses.end()

    def _kept_off(self) -> str:
        """Why the motors can't come on when a pause ends, "" when they can."""
        plc = self._plc
        if plc.stop.stopped or self.modes.mode is Mode.EMERGENCY_STOP:
            return "emergency stop: release it and recover first"
        if self.latches.restart:
            return "a cold start is on: wait until the controller has started"
        if self.modes.target in OFF_THE_NETWORK and self.modes.target in ROW:
            seconds = self.modes.time_to_target
            return f"the controller falls asleep in {seconds:.3g} s: wake it by Wake-on-LAN then"
        if plc.rest is not None or any(getattr(plc.raw, bit) for bit in POWER_BITS):
            return "a power bit of the PLC is 1: clear AB, HIB and KS"
        if self.latches.drives_off or plc.raw.drives_off:
            return "drives_off was given, drives_on is needed"
        return ""

    def _forget_requests(self) -> None:
        """A stop has a new number: nothing of before it is asked for any more."""
        self.pauses.wants_motors = False
        self.pauses.forget()
        self.latches.end_rest = None
        self.latches.recover = False

    def refusal(self) -> str:
        """Why no movement may start now, "" when it may."""
        mode = self.modes.mode
        plc = self._plc
        if mode is Mode.EMERGENCY_STOP or plc.stop.stopped:
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
            alarm_stop=not plc.stop.stopped and mode is not Mode.EMERGENCY_STOP,
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
        self.latches.mode_changed(self._plc, before, now)
        if now is Mode.EMERGENCY_STOP:
            self.pauses.wants_motors = False
        if before is Mode.FROM_HIBERNATION:
            self._plc.wake()
        if now in OFF_THE_NETWORK:
            self.pauses.forget()
