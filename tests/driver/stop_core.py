"""The controller core that stops and starts, without physics: PLC inputs, power modes, goals.

Everything that decides is the driver's own; the robot is a flag that says which goal would move it.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from ir_msgs_py.modes import OFF_THE_NETWORK, Mode, TransitionTimes
from ir_sim_driver.controller.goals import TrajectoryQueue
from ir_sim_driver.controller.mode_control import ModeControl
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.errors import RequestRefusedError, TrajectoryRefusedError
from ir_sim_driver.motion import ExecutionSettings
from ir_sim_driver.plc import OFF_BIT, SERVICE, TOPIC, Plc, PlcSettings, giver_of

EXECUTION = ExecutionSettings()
SETTINGS = SimulationSettings(transitions=TransitionTimes(), plc=PlcSettings(startup_window=0.0))


RUNNER = "runner"  # client of the service: the program's
QUARTER = 0.25  # s: no time of a mode ends within a quarter, nor do eight waits of 21 ms reach one


def same(thing: Any) -> Any:
    """A copy of an object whose fields are shared; `copy.copy` takes three times as long."""
    new = object.__new__(type(thing))
    new.__dict__.update(thing.__dict__)
    return new


class Silent:
    """Notices that nobody reads."""

    def add(self, *words: object) -> None:
        """Nothing."""


class Core:
    """The core with a robot; moving: stop number of the goal that moves it, None: it stands.

    before: number before the first stop.
    """

    def __init__(self, before: int = 0) -> None:
        silent: Any = Silent()
        self.plc = Plc(SETTINGS.plc, silent, before_first_stop=before)
        self.control = ModeControl(SETTINGS, self.plc, lambda mode: 100.0, {})
        self.queue = TrajectoryQueue()
        self.moving: int | None = None
        self.recovered = 0  # times

    def clone(self) -> Core:
        """The same state again."""
        new = same(self)
        plc = same(self.plc)
        new.plc = plc
        plc.stop = same(plc.stop)
        plc._ages = dict(plc._ages)
        plc._rose = dict(plc._rose)
        plc._gave = {bit: set(givers) for bit, givers in plc._gave.items()}
        plc.off_by = set(plc.off_by)
        control = same(self.control)
        new.control = control
        control._plc = plc
        control.modes = same(control.modes)
        control.latches = same(control.latches)
        control.pauses = same(control.pauses)
        control.pauses._modes = control.modes
        control.pauses._plc = plc
        new.queue = same(self.queue)
        new.queue._waiting = {k: same(each) for k, each in self.queue._waiting.items()}
        return new

    @property
    def mode(self) -> Mode:
        return self.control.modes.mode

    @property
    def on_the_network(self) -> bool:
        return self.mode not in OFF_THE_NETWORK

    def write(self, levels: dict[str, bool]) -> None:
        """One message of the PLC."""
        self.plc.write(TOPIC, levels)
        self.heed()

    def heed(self) -> None:
        """What the driver does before it answers a writer."""
        if self.plc.stop.stopped:
            self._change_mode(0.0)

    def fault(self) -> None:
        """The supervision stops the robot."""
        self.plc.stop.fault(self.plc.order)
        self.heed()

    def recover(self) -> None:
        """The service."""
        if self.on_the_network and self.plc.stop.recover():
            self.control.latches.recover = self.mode is Mode.EMERGENCY_STOP

    def step(self, dt: float) -> bool:
        """Time passes; whether the controller has been woken."""
        before = self.mode
        if self.plc.step(dt, self.control.pauses.active) and self.control.react_to_plc():
            self.moving = None
        self._change_mode(dt)
        return before is Mode.FROM_HIBERNATION and self.mode is not before

    def _change_mode(self, dt: float) -> None:
        if self.moving is not None and self.control.interruption():
            self.moving = None
        moves = self.moving is not None
        stopped = self.plc.stop.stopped
        self.control.step(dt, motion=moves, standing=not moves or stopped, emergency=stopped)
        if stopped:
            self.moving = None
            self.queue.end_before(self.plc.stop.number)

    def send(self, client: str) -> int:
        """A goal of a client arrives; its ticket, 0 where it is refused."""
        if self.plc.stop.stopped:
            return 0
        try:
            ticket = self.queue.admit(1, 0, self.plc.stop.number, EXECUTION)
        except TrajectoryRefusedError:
            return 0
        self.queue.submit(ticket, lambda outcome: None)
        return ticket

    def checked(self, ticket: int) -> bool:
        """The check of a goal ends well; whether it starts."""
        if ticket not in self.queue:
            return False
        try:
            self.queue.take(ticket, self.plc.stop.number)
        except TrajectoryRefusedError:
            return False
        return self.start(self.plc.stop.number)

    def start(self, after_stop: int) -> bool:
        """A goal of a sender that knows stop `after_stop` starts if it may."""
        if self.control.refusal() or after_stop != self.plc.stop.number:
            return False
        self.moving = self.plc.stop.number
        return True

    def rest(self) -> None:
        """The program runner closes the brakes."""
        self.plc.write(SERVICE, {OFF_BIT: True}, RUNNER)
        self.heed()

    def take_back(self) -> None:
        """The program runner takes its drives_off back, also after a stop; on the network."""
        with suppress(RequestRefusedError):
            self.control.take_back(OFF_BIT, giver_of(SERVICE, RUNNER))

    def end_rest(self) -> None:
        """The program runner leaves a rest on brakes, on the network."""
        with suppress(RequestRefusedError):
            self.control.end_rest(giver_of(SERVICE, RUNNER))

    def key(self) -> tuple[Any, ...]:
        """All that decides what may happen next, without what only counts."""
        plc = self.plc
        control = self.control
        stop = self.plc.stop
        number = stop.number
        latches = control.latches
        pauses = control.pauses
        modes = control.modes
        conf = plc.rose("conf_mess")
        drives = plc.rose("drives_on")
        ages = tuple(sorted((bit, round(age, 3)) for bit, age in plc._ages.items()))
        return (
            stop.state, plc.raw, plc.levels, plc.rest, plc._stuck, ages, round(plc._up, 3) < 0.02,
            conf > stop._since, drives > stop._acknowledged, plc._fell >= conf,
            conf < drives, plc.operating_mode, modes.mode, modes.source,
            min(int(modes.elapsed / QUARTER), 800), modes._wake,
            latches.drives_off, latches.recover, latches.restart, latches.wake,
            frozenset(plc.off_by), frozenset(plc._gave[OFF_BIT]), plc.off_taken_back,
            latches.end_rest == number if latches.end_rest is not None else None,
            pauses.wants_motors, pauses._route, control._stop_seen == number,
            self.moving == number if self.moving is not None else None,
        )  # fmt: skip
