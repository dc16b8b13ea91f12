"""PROFIenergy's commands on the running controller: start a pause, end it, ask for the modes."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ir_msgs_py.modes import READY, RESTS, ROW, Mode
from ir_msgs_py.plc import OperatingMode
from ir_msgs_py.power import PowerMode
from ir_msgs_py.status import StatusCode
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plc import Plc
from ir_sim_driver.power import PAUSE_MAX, PowerModes, best_route, mode_table

_MAY_PAUSE = READY | {Mode.STAND_ON_BRAKES, Mode.TO_BRAKES}
_DEPTH = {mode: row.depth for row in RESTS for mode in (row.entering, row.mode)}


class Pauses:
    """PROFIenergy's commands on the power modes.

    wants_motors: a pause was ended, motors are asked for. power: watts at the mains in a mode with
    the present load and posture; pe_ids: PROFIenergy's numbers.
    """

    def __init__(
        self,
        modes: PowerModes,
        plc: Plc,
        power: Callable[[Mode], float],
        pe_ids: Mapping[Mode, int],
    ) -> None:
        self._modes = modes
        self._plc = plc
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
        settled = (
            self._modes.mode in ROW
        )  # a mode that is being entered is asked for until it is reached
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
        return mode_table(times, self._power, self._pe_ids, source)

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
        route = best_route(table, pause, source, self._power(source))
        stays = () if source is Mode.STAND_ON_MOTORS else (source,)
        self._route = tuple(mode.mode for mode in route) or self._route or stays
        deepest = self._route[-1] if self._route else Mode.STAND_ON_MOTORS
        return next(mode for mode in table if mode.mode is deepest)

    def end(self) -> float:
        """End_Pause: back to motors; returns the seconds it takes, the rest of the minimum stay
        included.
        """
        self.forget()
        self.wants_motors = True
        return self._modes.time_to_ready()

    def _refusal(self, executing: bool) -> str:
        plc = self._plc
        mode = self._modes.mode
        if plc.operating_mode is not OperatingMode.EXT:
            return f"operating mode is {plc.operating_mode.name}, must be EXT"
        if plc.levels.ab or plc.levels.hib or plc.levels.ks:
            return "a power bit of the PLC is 1: PROFIenergy and AB, HIB, KS exclude each other"
        if executing:
            return "the robot is executing a trajectory"
        if mode not in _MAY_PAUSE and not (self._route and mode in _DEPTH):
            return f"the mode is {mode.name}, must be STAND_ON_MOTORS or STAND_ON_BRAKES"
        return ""
