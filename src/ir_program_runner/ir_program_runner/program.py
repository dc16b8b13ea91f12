"""A program as a generator over its steps: it yields requests and is sent outcomes.

Nothing here knows ROS or a clock, so a test runs a day's program in milliseconds.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from ir_msgs_py.announcements import Event
from ir_msgs_py.modes import REST_OF_BIT, Mode, TransitionTimes
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_program_runner.errors import CanceledError, ProgramError, StepFailedError
from ir_program_runner.pauses import PauseRun
from ir_program_runner.requests import (
    Announce,
    Begin,
    Done,
    Drive,
    Phase,
    Request,
    RequestOutcome,
    SetLoad,
    SetSignal,
    TakeBack,
    WaitForMode,
    WaitForSignals,
    WaitUntil,
    need,
)
from ir_program_runner.settings import ProgramSettings
from ir_values.errors import InvalidValueError, one_line

# Checks of a whole program before its first movement: what can't end well must not start.

MOST_STEPS = 1000  # of a request; a program of a cell has tens
LONGEST_ID = 256  # characters
LONGEST_PAUSE = 604_800.0  # s: a week, as for the driver's pauses
_STATION_MAX = 60  # characters of a station's name in a sentence
JOINT_TOLERANCE = 0.01  # rad, as the driver's for the first point of a trajectory


def check_request(program_id: str, steps: int) -> None:
    """Raise ProgramError: not exactly one of both is given, or more than a program can have."""
    sentence = ""
    if bool(program_id) == bool(steps):
        sentence = "give either program_id or movements"
    elif len(program_id) > LONGEST_ID:
        sentence = f"program_id has {len(program_id)} characters: at most {LONGEST_ID} are taken"
    elif steps > MOST_STEPS:
        sentence = f"the program has {steps} movements: at most {MOST_STEPS} are taken"
    if sentence:
        raise ProgramError(sentence, StatusCode.INVALID_GOAL_CONSTRAINTS)


def check_program(movements: Sequence[PlannedMovement]) -> None:
    """Raise ProgramError: no steps, no points, a gap between two movements, a bad signal or
    load.
    """
    if not movements:
        raise ProgramError("the program has no movements")
    before: PlannedMovement | None = None
    for index, movement in enumerate(movements):
        where = step_name(index, len(movements), movement)
        try:
            texts = (*movement.wait_for, *movement.set_signals, *filter(None, (movement.since,)))
            signals = [Signal.parse(text) for text in texts]
            load_after(movement)
        except InvalidValueError as error:
            raise ProgramError(f"{where}: {error}") from error
        del signals
        if movement.duration > LONGEST_PAUSE:
            raise ProgramError(
                f"{where} takes {movement.duration:g} s: at most {LONGEST_PAUSE:g} s are allowed"
            )
        if movement.is_pause:
            continue
        if movement.trajectory is None:
            raise ProgramError(f"{where} has no points")
        if before is not None:
            _check_gap(where, before, movement)
        before = movement


def station_of(movement: PlannedMovement) -> str:
    """The station or path whose allowed contacts count in a movement: into it, out of it, along it;
    "" elsewhere.
    """
    if movement.kind == MovementKind.SERVICE_EXIT:
        return movement.from_station
    service = movement.kind in (MovementKind.SERVICE_ENTRY, MovementKind.CARTESIAN)
    return movement.to_station if service else ""


def load_after(movement: PlannedMovement) -> str:
    """Return the load text when the step has ended; "" where the step leaves it open. Raises
    InvalidValueError where it attaches what is there or detaches what is not.
    """
    if not (movement.attach or movement.detach):
        return movement.load
    if not movement.load:
        raise InvalidValueError(
            f"{movement.attach or movement.detach} is attached or detached, but load is not given"
        )
    loads = [] if movement.load == NO_LOAD else movement.load.split(LOAD_SEPARATOR)
    if movement.detach:
        if movement.detach not in loads:
            raise InvalidValueError(
                f"{movement.detach} is detached, but attached is {movement.load}"
            )
        loads.remove(movement.detach)
    if movement.attach:
        if movement.attach in loads:
            raise InvalidValueError(f"{movement.attach} is attached, but it is already")
        loads.append(movement.attach)
    return LOAD_SEPARATOR.join(loads) or NO_LOAD


def step_name(index: int, total: int, movement: PlannedMovement) -> str:
    """Name of a step in sentences: "step 2 of 5 (regional lathe -> park)"."""
    stations = (movement.from_station, movement.to_station)
    places = " -> ".join(one_line(station, _STATION_MAX) for station in stations if station)
    mode = movement.power_mode if movement.is_pause else ""
    text = " ".join(part for part in (str(movement.kind), mode, places) if part)
    return f"step {index + 1} of {total} ({text})"


def _first_of(notes: Sequence[str]) -> str:
    """What the end of a program says of steps that did not go as planned, "" where all did."""
    if len(notes) < 2:
        return "".join(notes)
    return f"{notes[0]}; {len(notes)} steps have notes, see ~/program_state"


def _check_gap(where: str, before: PlannedMovement, movement: PlannedMovement) -> None:
    assert before.trajectory is not None
    assert movement.trajectory is not None
    end = before.trajectory.reordered(movement.trajectory.joint_names).positions[-1]
    gap = movement.trajectory.positions[0] - end
    joint = int(np.argmax(np.abs(gap)))
    if abs(gap[joint]) > JOINT_TOLERANCE:
        name = movement.trajectory.joint_names[joint]
        raise ProgramError(
            f"{where} starts {gap[joint]:+.4f} rad at {name} from where the movement before ends: "
            f"at most {JOINT_TOLERANCE} rad are allowed"
        )


# One step: wait for its signals, carry its load, move or pause, attach or detach, set its
# signals.

Steps = Generator[Request, RequestOutcome, None]
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
        # when each step begins by the plan, and when each signal was set by plan and clock [s]
        self._begins = [0.0, *accumulate(movement.duration for movement in movements)]
        self._set: dict[str, tuple[float, float]] = {}

    def run(self) -> Generator[Request, RequestOutcome, ProgramResult]:
        """Run all steps; ends early with the status of the step that failed, or PREEMPTED."""
        total = len(self._movements)
        try:
            yield from self._start()
        except StepFailedError as failure:
            return ProgramResult(failure.status, 0)
        except CanceledError:
            return ProgramResult(Status(StatusCode.PREEMPTED, "canceled before the first step"), 0)
        notes: list[str] = []
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
            if note:
                notes.append(f"{where}: {note}")
        return ProgramResult(Status.success(_first_of(notes)), total)

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
        for bit in REST_OF_BIT:
            need((yield TakeBack(bit)))

    def _step(
        self, index: int, movement: PlannedMovement
    ) -> Generator[Request, RequestOutcome, str]:
        """Do one step; it counts as started when its signals are there and as ended before its load
        and signals follow: waiting for answers is no part of its energy.
        """
        note = ""
        yield Begin(index)
        if movement.wait_for:
            yield from self._wait_for_signals(movement.wait_for)
        yield from self._carry(movement.load)
        yield Announce(index, Event.STARTED)
        if movement.is_pause:
            pause = PauseRun(movement, self._settings, self._times, self._end_of_pause(index))
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
        yield Done()
        yield from self._carry(load_after(movement))
        for text in movement.set_signals:
            signal = Signal.parse(text)
            outcome = need((yield SetSignal(signal)))
            if signal.value:
                self._set[signal.name] = self._begins[index + 1], outcome.now
        return note

    def _end_of_pause(self, index: int) -> float | None:
        """As long after the signal that the pause is for was set as planned; None where it is for
        none, or the program hasn't set it yet.
        """
        since = self._set.get(self._movements[index].since)
        if since is None:
            return None
        planned, now = since
        return now + self._begins[index + 1] - planned

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


# Progress of a running program by plan.


@dataclass
class RunProgress:
    """State of one run; times of the plant [s]; step_done_ns: stamp of the end of the step, 0 while
    it goes on. abandoned: why nobody waits for its end any more, "" while somebody does.
    """

    program_id: str
    movements: Sequence[PlannedMovement]
    started: float
    index: int = 0
    phase: str = ""
    step_started: float | None = None
    step_done_ns: int = 0
    abandoned: str = ""

    @property
    def total(self) -> int:
        """Number of steps."""
        return len(self.movements)

    def begin(self, index: int) -> None:
        """Step `index` is the next one; it may still wait for its signals."""
        self.index = index
        self.step_started = None
        self.step_done_ns = 0

    def remaining(self, now: float) -> float:
        """Planned seconds until the program ends; a step that takes longer counts as nothing
        more.
        """
        elapsed = 0.0 if self.step_started is None else now - self.step_started
        step = max(0.0, self.movements[self.index].duration - elapsed)
        return step + sum(movement.duration for movement in self.movements[self.index + 1 :])
