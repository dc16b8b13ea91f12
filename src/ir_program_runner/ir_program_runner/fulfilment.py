"""Fulfils a program's requests one by one, through ports: the node plugs ROS in, a test whatever it
likes.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from ir_msgs_py.modes import Mode, PowerMode
from ir_msgs_py.names import TAKE_BACK
from ir_msgs_py.plc import Signal
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.stop_numbers import same_driver, stop_count
from ir_msgs_py.trajectory import JointTrajectory
from ir_program_runner import requests as ask
from ir_program_runner.errors import CanceledError
from ir_program_runner.machines import Machines
from ir_program_runner.program import Program, ProgramResult


class DriverPort(Protocol):
    """The driver as a program sees it; every answer is a Status, nothing waits without end."""

    @property
    def mode(self) -> Mode | None:
        """Power mode by the meter's last reading."""

    @property
    def energy(self) -> float:
        """Energy at the mains by the meter's last reading [J]."""

    @property
    def plant_time(self) -> float:
        """Time of the plant by the meter's last reading [s]: on a busy machine it may lag."""

    @property
    def stops(self) -> int | None:
        """Number of the driver's last stop, None where it is not known."""

    @property
    def stop_latched(self) -> bool | None:
        """Whether that stop is latched, None where it is not known."""

    @property
    def silent(self) -> bool:
        """Whether no reading of the meter has come for too long."""

    def state(self) -> Status:
        """SUCCESS where the driver can be reached."""

    async def set_plc_input(self, name: str, value: bool) -> Status:
        """Set one level."""

    async def set_load(self, load: str) -> Status:
        """Carry exactly this load text."""

    async def query_modes(self) -> tuple[Status, tuple[PowerMode, ...]]:
        """The modes with their times."""

    async def drive(
        self,
        trajectory: JointTrajectory,
        stop: Callable[[], bool],
        cell_hash: str,
        load: str,
        station: str,
        states: Sequence[str],
        after_stop: int | None,
    ) -> Status:
        """Execute a trajectory that was planned in a cell and with a load; stop along the path when
        `stop` is true. station: whose contacts are allowed; states: of machines that it relies on;
        after_stop: the last stop that the program knows.
        """


@dataclass(frozen=True)
class Ports:
    """The world of one program.

    until: waits for a condition. fault: why no wait may go on, "" = it may. canceled: whether
    somebody asked to stop. The others do at once what they are called.
    """

    driver: DriverPort
    machines: Machines
    until: Callable[[Callable[[], bool]], Awaitable[bool]]
    fault: Callable[[], str]
    canceled: Callable[[], bool]
    begin: Callable[[int], None]
    done: Callable[[], None]
    announce: Callable[[ask.Announce], None]
    announce_phase: Callable[[str], None]
    set_signal: Callable[[Signal], None]
    send_wake_packet: Callable[[], Status]


class Fulfilment:
    """One run of a program; `run` returns how it ended.

    after_stop: number of the driver's last stop when the program was asked for. A later one ends
    the program, also one that was recovered from meanwhile, and so does one that is latched: a
    person who has recovered starts it again. What takes bits back is still sent.
    """

    def __init__(self, ports: Ports, after_stop: int | None) -> None:
        self._ports = ports
        self._thrown = False
        self._after_stop = after_stop

    async def run(self, program: Program) -> ProgramResult:
        """Drive the generator; a cancel is thrown into it once, at a request that takes time."""
        steps = program.run()
        try:
            request = next(steps)
            while True:
                outcome = await self._outcome(request)
                if (
                    isinstance(request, ask.INTERRUPTIBLE)
                    and self._stop()
                    and not outcome.status.ok
                ):
                    self._thrown = True
                    request = steps.throw(CanceledError(outcome.status.message))
                else:
                    request = steps.send(outcome)
        except StopIteration as ended:
            result: ProgramResult = ended.value
            return result

    def _stop(self) -> bool:
        return self._ports.canceled() and not self._thrown

    def _is_stopped(self) -> bool:
        """Whether the driver is stopped, or has been since the program was asked for."""
        driver = self._ports.driver
        return bool(driver.stop_latched) or driver.stops != self._after_stop

    def _stop_status(self) -> Status:
        number = self._ports.driver.stops or 0
        known = number if self._after_stop is None else self._after_stop
        sentence = (
            f"stop {stop_count(number)} of the driver ended the program: recover, then start it "
            "again"
        )
        if not same_driver(number, known):
            sentence = (
                "the driver was started anew, which ended the program: see to the robot, then "
                "start it again"
            )
        return Status(StatusCode.INVALID_ROBOT_STATE, sentence)

    async def _outcome(self, request: ask.Request) -> ask.RequestOutcome:
        ports = self._ports
        modes: tuple[PowerMode, ...] = ()
        if isinstance(request, ask.INTERRUPTIBLE) and self._stop():
            status = Status(StatusCode.PREEMPTED)
        elif self._is_stopped() and _acts(request):
            status = self._stop_status()
        elif isinstance(request, ask.AskModes):
            status, modes = await ports.driver.query_modes()
        else:
            status = await self._fulfil(request)
        return ask.RequestOutcome(
            ports.driver.plant_time, ports.driver.mode, status, modes, ports.driver.energy
        )

    async def _fulfil(self, request: ask.Request) -> Status:  # noqa: C901, PLR0911, PLR0912
        """Do what a request asks for, and wait until it is done; how it ended."""
        ports = self._ports
        match request:
            case ask.Begin(index):
                ports.begin(index)
            case ask.Done():
                ports.done()
            case ask.Announce():
                ports.announce(request)
            case ask.Phase(text):
                ports.announce_phase(text)
            case ask.SetSignal(signal):
                ports.set_signal(signal)
            case ask.SendWakePacket():
                return ports.send_wake_packet()
            case ask.SetLoad(load):
                return await ports.driver.set_load(load)
            case ask.SetPlcInput(name, value):
                status = await ports.driver.set_plc_input(name, value)
                # what counts is the mode that follows, which is waited for
                ignored = status.code == StatusCode.INPUT_IGNORED
                return Status.success(status.message) if ignored else status
            case ask.TakeBack(name):
                status = await ports.driver.set_plc_input(TAKE_BACK + name, True)
                if status.code == StatusCode.INPUT_IGNORED:  # so the rest does not end
                    return Status(StatusCode.INVALID_ROBOT_STATE, status.message)
                return status
            case ask.Drive(trajectory, cell_hash, load, station, states):
                return await ports.driver.drive(
                    trajectory, self._stop, cell_hash, load, station, states, self._after_stop
                )
            case ask.WaitForSignals(signals, timeout):
                return await self._wait(lambda: ports.machines.holds(signals), timeout)
            case ask.WaitForMode(wanted, timeout):
                return await self._wait(lambda: ports.driver.mode in wanted, timeout)
            case ask.WaitUntil(moment):
                return await self._wait(lambda: ports.driver.plant_time >= moment, float("inf"))
        return Status.success()

    async def _wait(self, condition: Callable[[], bool], timeout: float) -> Status:
        """Wait for the condition; ends early on a cancel, a silent driver or a clock that jumps."""
        ports = self._ports
        deadline = ports.driver.plant_time + timeout

        def over() -> bool:
            return (
                self._stop()
                or self._is_stopped()
                or ports.driver.silent
                or bool(ports.fault())
                or ports.driver.plant_time >= deadline
            )

        await ports.until(lambda: condition() or over())
        if self._is_stopped():
            return self._stop_status()
        if condition():
            return Status.success()
        if self._stop():
            return Status(StatusCode.PREEMPTED)
        if ports.fault():
            return Status(StatusCode.FAILURE, ports.fault())
        return (
            ports.driver.state()
            if ports.driver.silent
            else Status(StatusCode.TIMED_OUT, f"not within {timeout:g} s")
        )


def _acts(request: ask.Request) -> bool:
    """Whether a request would move something on, or wait for it; a bit that is cleared does not."""
    if isinstance(request, ask.SetPlcInput):
        return request.value
    return isinstance(request, (*ask.INTERRUPTIBLE, ask.SetLoad, ask.SetSignal))
