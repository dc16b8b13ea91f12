"""A program as a generator over its steps: it yields requests and is sent outcomes.

One step: wait for its signals, carry its load, move or pause, attach or detach, set its signals.
Nothing here knows ROS or a clock, so a test runs a day's program in milliseconds.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

from ir_msgs_py.modes import Mode
from ir_msgs_py.plc import Signal
from ir_msgs_py.program import Event
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.transitions import TransitionTimes
from ir_program_runner.checks import load_after, station_of, step_name
from ir_program_runner.errors import CanceledError, StepFailedError
from ir_program_runner.pause import Pause
from ir_program_runner.requests import (
    Announce,
    Begin,
    Drive,
    Outcome,
    Phase,
    Request,
    SetLoad,
    SetPlcInput,
    SetSignal,
    WaitForMode,
    WaitForSignals,
    WaitUntil,
    need,
)
from ir_program_runner.settings import ProgramSettings

Steps = Generator[Request, Outcome, None]
STARTING_MODES = (Mode.STAND_ON_MOTORS, Mode.STAND_ON_BRAKES)
_LOAD_RETRY = 0.1  # s: a robot settles within some tenths


@dataclass(frozen=True)
class ProgramResult:
    """How a program ended; executed: steps that ended well."""

    status: Status
    executed: int


class Program:
    """One run of a checked program. `run()` is the generator. times: of the power modes, where the
    driver doesn't report them.

    CanceledError may be thrown into it once, at a request that is INTERRUPTIBLE.
    """

    def __init__(
        self,
        movements: Sequence[PlannedMovement],
        settings: ProgramSettings,
        times: TransitionTimes | None = None,
    ) -> None:
        self._movements = tuple(movements)
        self._settings = settings
        self._times = times or TransitionTimes()
        self._carried = ""  # load text last sent to the driver; "" = not known

    def run(self) -> Generator[Request, Outcome, ProgramResult]:
        """Run all steps; ends early with the status of the step that failed, or PREEMPTED."""
        total = len(self._movements)
        try:
            yield from self._start()
        except StepFailedError as failure:
            return ProgramResult(failure.status, 0)
        except CanceledError:
            return ProgramResult(Status(StatusCode.PREEMPTED, "canceled before the first step"), 0)
        for index, movement in enumerate(self._movements):
            where = step_name(index, total, movement)
            try:
                note = yield from self._step(index, movement)
            except StepFailedError as failure:
                yield Announce(index, Event.FAILED, failure.status.message)
                return ProgramResult(
                    Status(failure.status.code, f"{where}: {failure.status.message}"), index
                )
            except CanceledError as canceled:
                yield Announce(index, Event.CANCELED, str(canceled))
                return ProgramResult(Status(StatusCode.PREEMPTED, f"canceled in {where}"), index)
            yield Announce(index, Event.ENDED, note)
        return ProgramResult(Status.success(), total)

    def _start(self) -> Steps:
        """Begin only with a robot that is awake; clear the pause bits, so that a later 1 counts."""
        yield Phase("starting")
        outcome = yield WaitForMode(STARTING_MODES, self._settings.ready_timeout)
        if outcome.status.code == StatusCode.TIMED_OUT:
            mode = "not known" if outcome.mode is None else outcome.mode.name
            known = ", ".join(each.name for each in STARTING_MODES)
            sentence = f"the power mode is {mode}: a program starts in {known}"
            raise StepFailedError(Status(StatusCode.INVALID_ROBOT_STATE, sentence))
        need(outcome)
        for bit in ("ab", "hib"):
            need((yield SetPlcInput(bit, False)))

    def _step(self, index: int, movement: PlannedMovement) -> Generator[Request, Outcome, str]:
        """Do one step; it counts as started when its signals are there: waiting is no part of its
        energy.
        """
        note = ""
        yield Begin(index)
        if movement.wait_for:
            yield from self._wait_for_signals(movement.wait_for)
        yield from self._carry(movement.load)
        yield Announce(index, Event.STARTED)
        if movement.is_pause:
            pause = Pause(movement, self._settings, self._times)
            note = yield from pause.run()
            if pause.restarted:
                self._carried = ""  # the controller has started anew
        else:
            assert movement.trajectory is not None  # checked with the program
            yield Phase("moving")
            planned = movement.report.cell_hash, movement.report.load
            need(
                (yield Drive(movement.trajectory, *planned, station_of(movement), movement.states))
            )
        yield from self._carry(load_after(movement))
        for text in movement.set_signals:
            need((yield SetSignal(Signal.parse(text))))
        return note

    def _wait_for_signals(self, texts: Sequence[str]) -> Steps:
        names = ", ".join(texts)
        yield Phase(f"waiting for {names}")
        timeout = self._settings.signal_timeout
        outcome = yield WaitForSignals(tuple(Signal.parse(text) for text in texts), timeout)
        if outcome.status.code == StatusCode.TIMED_OUT:
            sentence = f"signal {names} did not come within {timeout:g} s"
            raise StepFailedError(Status(StatusCode.TIMED_OUT, sentence))
        need(outcome)

    def _carry(self, load: str) -> Steps:
        """Make sure that the driver carries exactly this; a robot that still settles is asked
        again.
        """
        if not load or load == self._carried:
            return
        outcome = yield SetLoad(load)
        deadline = outcome.now + self._settings.load_timeout
        while outcome.status.code == StatusCode.INVALID_ROBOT_STATE and outcome.now < deadline:
            need((yield WaitUntil(outcome.now + _LOAD_RETRY)))
            outcome = yield SetLoad(load)
        need(outcome)
        self._carried = load
