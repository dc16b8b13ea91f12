"""State machine of the power modes: rests, transitions with their times, emergency stop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ir_msgs_py.modes import DRIVES_ON, READY, RESTS, ROW, Mode, ModeRow, RestTimes, TransitionTimes
from ir_sim_driver.errors import SettingsError
from ir_values.settings import check_settings, setting

# The controller's own timers.

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


# State machine.

_INSTANT = 1e-6  # s; sums of steps are not exact
_TRANSITIONS = {mode: row for row in RESTS for mode in (row.entering, row.leaving)}
_STOPPABLE = DRIVES_ON | {Mode.EMERGENCY_STOP}
"""Modes in which a pressed emergency stop counts at once; in the others when the transition has
ended.
"""


class Demand(NamedTuple):
    """What the rest of the controller asks of the power modes, level by level.

    rest: the mode to rest in (STAND_ON_MOTORS: be ready, None: no opinion). motion: a movement
    waits or runs.
    standing: the robot does not move. wake: a Wake-on-LAN packet came. emergency: emergency stop is
    pressed.
    recover: leave the emergency stop. restart: cold start. manual: operating mode T1 or T2.
    """

    rest: Mode | None = None
    motion: bool = False
    standing: bool = True
    wake: bool = False
    emergency: bool = False
    recover: bool = False
    restart: bool = False
    manual: bool = False


NO_DEMAND = Demand()


class PowerModes:
    """The state machine; `step` advances it by dt [s].

    mode: present mode. source: the rest (or STAND_ON_MOTORS) that a transition left. level: the
    rest, or STAND_ON_MOTORS, whose power the controller draws now; while entering a rest that of
    the source.
    motors_on: whether the motors follow commands. times: of every rest.
    """

    def __init__(
        self, transitions: TransitionTimes, idle: IdleTimes, start: Mode = Mode.STAND_ON_MOTORS
    ) -> None:
        if start not in ROW:
            raise SettingsError(
                f"the controller cannot start in {start.name}: known are "
                f"{', '.join(m.name for m in ROW)}"
            )
        self._idle = {
            False: idle.motors_to_brakes_in_program,
            True: idle.motors_to_brakes_in_command,
        }
        self.times: dict[Mode, RestTimes] = {
            row.mode: transitions.rest(row.mode.name) for row in RESTS
        }
        self.mode: Mode = start
        self.source: Mode = start
        self.elapsed = 0.0
        self.motors_on = start in READY
        self.level: Mode = start
        self._wake = False

    @property
    def target(self) -> Mode:
        """Where a transition leads; the mode itself when there is none."""
        row = _TRANSITIONS.get(self.mode)
        if row is None:
            return self.mode
        return row.mode if self.mode is row.entering else Mode.STAND_ON_MOTORS

    @property
    def time_to_target(self) -> float:
        """Seconds until the transition ends; 0 without one."""
        row = _TRANSITIONS.get(self.mode)
        if row is None:
            return 0.0
        times = self.times[row.mode]
        return max(0.0, (times.enter if self.mode is row.entering else times.leave) - self.elapsed)

    def time_to_ready(self) -> float:
        """Seconds until motors are on when everything else agrees and the rest is left at once."""
        row = _TRANSITIONS.get(self.mode)
        if row is not None:
            left = self.time_to_target
            times = self.times[row.mode]
            return left + times.stay + times.leave if self.mode is row.entering else left
        if self.mode in self.times:
            times = self.times[self.mode]
            return max(0.0, times.stay - self.elapsed) + times.leave
        return self.times[Mode.STAND_ON_BRAKES].leave if self.mode is Mode.EMERGENCY_STOP else 0.0

    def step(self, dt: float, demand: Demand) -> None:
        """Let dt [s] pass, then act on the demand."""
        self.elapsed += dt
        if demand.emergency and self.mode in _STOPPABLE:
            if self.mode is not Mode.EMERGENCY_STOP:
                self._enter(Mode.EMERGENCY_STOP)
            return
        row = _TRANSITIONS.get(self.mode)
        if row is not None:
            self._pass_through(row, demand)
        elif self.mode in self.times:
            self._stay(ROW[self.mode], demand)
        elif self.mode is Mode.EMERGENCY_STOP:
            if demand.recover and demand.standing:
                self._leave(Mode.STAND_ON_BRAKES)
        else:
            self._ready(demand)

    def _pass_through(self, row: ModeRow, demand: Demand) -> None:
        if self.time_to_target > _INSTANT:
            return
        if self.mode is row.entering:
            self._enter(row.mode)
        else:
            self._enter(Mode.EMERGENCY_STOP if demand.emergency else Mode.STAND_ON_MOTORS)

    def _stay(self, row: ModeRow, demand: Demand) -> None:
        over = self.elapsed >= self.times[row.mode].stay - _INSTANT
        if not row.on_the_network:
            self._wake = self._wake or demand.wake
            if self._wake and over:
                self._leave(row.mode)
            return
        if not over:
            return
        if demand.restart:
            self._leave(Mode.HIBERNATION)
        elif demand.rest is not None and ROW[demand.rest].depth > row.depth:
            self._go(demand.rest)
        elif row.mode is Mode.STAND_ON_BRAKES:
            if demand.rest is Mode.STAND_ON_MOTORS or (demand.motion and demand.rest is None):
                self._leave(row.mode)
        elif demand.rest is not row.mode:
            self._leave(row.mode)

    def _ready(self, demand: Demand) -> None:
        if not demand.standing or (demand.motion and demand.rest in (None, Mode.STAND_ON_MOTORS)):
            if self.mode is not Mode.MOVING:
                self._enter(Mode.MOVING)
            return
        if self.mode is Mode.MOVING:
            self._enter(Mode.STAND_ON_MOTORS)
        if demand.restart:
            self._leave(Mode.HIBERNATION)
        elif demand.rest is not None and demand.rest is not Mode.STAND_ON_MOTORS:
            self._go(demand.rest)
        elif demand.rest is None and self.elapsed >= self._idle[demand.manual] - _INSTANT:
            self._go(Mode.STAND_ON_BRAKES)

    def _go(self, rest: Mode) -> None:
        self.source = self.level
        self._enter(ROW[rest].entering)

    def _leave(self, rest: Mode) -> None:
        self.source = self.level
        self._enter(ROW[rest].leaving)

    def _enter(self, mode: Mode) -> None:
        if mode in ROW and not ROW[mode].on_the_network:
            self._wake = False
        self.mode = mode
        self.elapsed = 0.0
        self.motors_on = mode in READY
        self.level = self._level_of(mode)

    def _level_of(self, mode: Mode) -> Mode:
        row = _TRANSITIONS.get(mode)
        if row is not None:
            return self.source if mode is row.entering else Mode.STAND_ON_MOTORS
        if mode is Mode.EMERGENCY_STOP:
            return Mode.STAND_ON_BRAKES
        return Mode.STAND_ON_MOTORS if mode is Mode.MOVING else mode
