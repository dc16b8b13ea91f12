"""Power modes of the controller as a table-driven state machine: rests, the ways in and out, emergency stop.

Times come from the controller's data and are parameters; names and numbers are those of ir_msgs/PowerMode.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ir_msgs_py.modes import Mode
from ir_msgs_py.settings import check_settings, setting
from ir_sim_driver.errors import SettingsError

_WEEK = 604_800.0


@dataclass(frozen=True)
class TransitionSettings:
    """Times of the ways into and out of each rest and the shortest stay in it, under the names of
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
class Rest:
    """A mode to rest in: how it is entered and left, in seconds."""

    mode: Mode
    entering: Mode
    leaving: Mode
    enter: float
    leave: float
    minimum_stay: float


class Wish(NamedTuple):
    """What the rest of the controller wants of the power modes, level by level.

    rest: the mode to rest in (STAND_ON_MOTORS: be ready, None: no opinion). motion: a movement waits or runs.
    standing: the robot does not move. wake: a Wake-on-LAN packet came. emergency: emergency stop is pressed.
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


NO_WISH = Wish()
_INSTANT = 1e-6  # s; sums of steps are not exact
_DEPTH = {
    Mode.STAND_ON_MOTORS: 0,
    Mode.MOVING: 0,
    Mode.STAND_ON_BRAKES: 1,
    Mode.BUS_POWER_OFF: 2,
    Mode.HIBERNATION: 3,
}
_DRIVES_ARE_ON = frozenset(
    {
        Mode.STAND_ON_MOTORS,
        Mode.MOVING,
        Mode.TO_BRAKES,
        Mode.FROM_BRAKES,
        Mode.STAND_ON_BRAKES,
        Mode.EMERGENCY_STOP,
    }
)
OFF_THE_NETWORK = frozenset({Mode.HIBERNATION, Mode.FROM_HIBERNATION})
"""Modes in which the controller does not answer."""


def rests_of(settings: TransitionSettings) -> tuple[Rest, ...]:
    """The table: brakes, Bus Power Off, hibernation."""
    s = settings
    return (
        Rest(
            Mode.STAND_ON_BRAKES,
            Mode.TO_BRAKES,
            Mode.FROM_BRAKES,
            s.stand_on_brakes_enter,
            s.stand_on_brakes_leave,
            s.stand_on_brakes_minimum_stay,
        ),
        Rest(
            Mode.BUS_POWER_OFF,
            Mode.TO_BUS_POWER_OFF,
            Mode.FROM_BUS_POWER_OFF,
            s.bus_power_off_enter,
            s.bus_power_off_leave,
            s.bus_power_off_minimum_stay,
        ),
        Rest(
            Mode.HIBERNATION,
            Mode.TO_HIBERNATION,
            Mode.FROM_HIBERNATION,
            s.hibernation_enter,
            s.hibernation_leave,
            s.hibernation_minimum_stay,
        ),
    )


class PowerModes:
    """The state machine; `step` advances it by dt [s].

    mode: present mode. source: the rest (or STAND_ON_MOTORS) that a transition left. level: the rest, or
    STAND_ON_MOTORS, whose power the controller draws now; on the way into a rest that of the source.
    motors_on: whether the motors follow commands.
    """

    def __init__(self, settings: TransitionSettings, start: Mode = Mode.STAND_ON_MOTORS) -> None:
        if start not in _DEPTH or start is Mode.MOVING:
            raise SettingsError(
                f"the controller cannot start in {start.name}: known are motors, brakes and deeper rests"
            )
        self.settings = settings
        self.rests = {rest.mode: rest for rest in rests_of(settings)}
        self._by_transition = {rest.entering: rest for rest in self.rests.values()} | {
            rest.leaving: rest for rest in self.rests.values()
        }
        self.mode: Mode = start
        self.source: Mode = start
        self.elapsed = 0.0
        self.motors_on = start is Mode.STAND_ON_MOTORS
        self.level: Mode = start
        self._wake = False

    @property
    def target(self) -> Mode:
        """Where a transition leads; the mode itself when there is none."""
        rest = self._by_transition.get(self.mode)
        if rest is None:
            return self.mode
        return rest.mode if self.mode is rest.entering else Mode.STAND_ON_MOTORS

    @property
    def time_to_target(self) -> float:
        """Seconds until the transition ends; 0 without one."""
        rest = self._by_transition.get(self.mode)
        if rest is None:
            return 0.0
        return max(0.0, (rest.enter if self.mode is rest.entering else rest.leave) - self.elapsed)

    def time_to_ready(self) -> float:
        """Seconds until motors are on when everything else agrees and the rest is left at once."""
        rest = self._by_transition.get(self.mode)
        if rest is not None:
            left = self.time_to_target
            return left + rest.minimum_stay + rest.leave if self.mode is rest.entering else left
        if self.mode in self.rests:
            rest = self.rests[self.mode]
            return max(0.0, rest.minimum_stay - self.elapsed) + rest.leave
        return self.rests[Mode.STAND_ON_BRAKES].leave if self.mode is Mode.EMERGENCY_STOP else 0.0

    def step(self, dt: float, wish: Wish) -> None:
        """Let dt [s] pass, then act on the wish."""
        self.elapsed += dt
        if wish.emergency and self.mode in _DRIVES_ARE_ON:
            if self.mode is not Mode.EMERGENCY_STOP:
                self._enter(Mode.EMERGENCY_STOP)
            return
        rest = self._by_transition.get(self.mode)
        if rest is not None:
            self._pass_through(rest, wish)
        elif self.mode in self.rests:
            self._stay(self.rests[self.mode], wish)
        elif self.mode is Mode.EMERGENCY_STOP:
            if wish.recover and wish.standing:
                self._leave(self.rests[Mode.STAND_ON_BRAKES])
        else:
            self._ready(wish)

    def _pass_through(self, rest: Rest, wish: Wish) -> None:
        if self.time_to_target > _INSTANT:
            return
        if self.mode is rest.entering:
            self._enter(rest.mode)
        else:
            self._enter(Mode.EMERGENCY_STOP if wish.emergency else Mode.STAND_ON_MOTORS)

    def _stay(self, rest: Rest, wish: Wish) -> None:
        if rest.mode is Mode.HIBERNATION:
            self._wake = self._wake or wish.wake
            if self._wake and self.elapsed >= rest.minimum_stay - _INSTANT:
                self._leave(rest)
            return
        if self.elapsed < rest.minimum_stay - _INSTANT:
            return
        if wish.restart:
            self._leave(self.rests[Mode.HIBERNATION])
        elif wish.rest is not None and _DEPTH[wish.rest] > _DEPTH[rest.mode]:
            self._go(wish.rest)
        elif rest.mode is Mode.STAND_ON_BRAKES:
            if wish.rest is Mode.STAND_ON_MOTORS or (wish.motion and wish.rest is None):
                self._leave(rest)
        elif wish.rest is not rest.mode:
            self._leave(rest)

    def _ready(self, wish: Wish) -> None:
        if not wish.standing or (wish.motion and wish.rest in (None, Mode.STAND_ON_MOTORS)):
            if self.mode is not Mode.MOVING:
                self._enter(Mode.MOVING)
            return
        if self.mode is Mode.MOVING:
            self._enter(Mode.STAND_ON_MOTORS)
        s = self.settings
        idle = s.motors_to_brakes_in_command if wish.manual else s.motors_to_brakes_in_program
        if wish.restart:
            self._leave(self.rests[Mode.HIBERNATION])
        elif wish.rest is not None and wish.rest is not Mode.STAND_ON_MOTORS:
            self._go(wish.rest)
        elif wish.rest is None and self.elapsed >= idle - _INSTANT:
            self._go(Mode.STAND_ON_BRAKES)

    def _go(self, rest: Mode) -> None:
        self.source = self.level
        self._enter(self.rests[rest].entering)

    def _leave(self, rest: Rest) -> None:
        self.source = self.level
        self._enter(rest.leaving)

    def _enter(self, mode: Mode) -> None:
        if mode is Mode.HIBERNATION:
            self._wake = False
        self.mode = mode
        self.elapsed = 0.0
        self.motors_on = mode in (Mode.STAND_ON_MOTORS, Mode.MOVING)
        self.level = self._level_of(mode)

    def _level_of(self, mode: Mode) -> Mode:
        rest = self._by_transition.get(mode)
        if rest is not None:
            return self.source if mode is rest.entering else Mode.STAND_ON_MOTORS
        if mode is Mode.EMERGENCY_STOP:
            return Mode.STAND_ON_BRAKES
        return Mode.STAND_ON_MOTORS if mode is Mode.MOVING else mode
