"""Goals from their sender to their outcome: admitted, checked beside the plant, started, stopped.

A goal belongs to the stop number of the moment at which it was admitted. A stop ends all that were
admitted before it, also those that are being checked; they can't start later.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

from ir_msgs_py.stop_numbers import stop_count
from ir_sim_driver.controller.goal_checks import VettedGoal
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import ErrorCode, ExecutionSettings, GoalOutcome, TrajectoryGoal

QUEUE_MAX = 32  # a flood is refused before it fills the memory; a sender waits for its goal anyway
POINT_BYTES = 1000  # of a point as Python objects and arrays, while its goal waits: measured 900
NO_GOAL = 0
_MB = 1_000_000
_AGAIN = 3  # times that a goal is checked again because the cell has changed

Read = Callable[[], TrajectoryGoal]
Ended = Callable[[GoalOutcome], None]


@dataclass
class _Waiting:
    """A goal that has not started: its memory [bytes], stop number, and sender once it is known."""

    size: int
    number: int
    ended: Ended | None = None
    canceled: bool = False


class _StopState(NamedTuple):
    """Number of the last stop, and whether it is latched."""

    number: int
    latched: bool


class Recovery(NamedTuple):
    """Number of the last stop that was recovered, and when [ns of the system's clock]; at 0 none
    came yet.
    """

    number: int
    at: int


class TrajectoryQueue:
    """Goals that wait, bounded in number, points and bytes together. No thread, no lock."""

    def __init__(self) -> None:
        self._tickets = 0
        self._waiting: dict[int, _Waiting] = {}

    def __len__(self) -> int:
        return len(self._waiting)

    def __contains__(self, ticket: int) -> bool:
        return ticket in self._waiting

    @property
    def size(self) -> int:
        """Memory [bytes] of all that wait."""
        return sum(each.size for each in self._waiting.values())

    def admit(self, points: int, size: int, number: int, settings: ExecutionSettings) -> int:
        """Ticket of a goal of so many points and bytes, sent after stop `number`.

        It is called before the goal is converted. Raises TrajectoryRefusedError: too many points,
        goals or bytes.
        """
        limit = settings.max_points
        budget = settings.goal_memory
        need = max(size, points * POINT_BYTES)
        refusal = ""
        if points > limit:
            refusal = f"the trajectory has {points} points: at most {limit}"
        elif len(self._waiting) >= QUEUE_MAX:
            refusal = f"{QUEUE_MAX} trajectories are waiting to be checked: send fewer"
        elif self._waiting and self.size + need > budget * _MB:
            refusal = (
                f"the trajectories that wait take {self.size / _MB:.1f} MB, this one would take "
                f"{need / _MB:.1f} MB more: at most {budget:g} MB together"
            )
        if refusal:
            raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, refusal)
        self._tickets += 1
        self._waiting[self._tickets] = _Waiting(need, number)
        return self._tickets

    def submit(self, ticket: int, ended: Ended) -> bool:
        """The sender waits for the outcome; False where a stop has ended the goal meanwhile."""
        waiting = self._waiting.get(ticket)
        if waiting is not None:
            waiting.ended = ended
        return waiting is not None

    def sender(self, ticket: int) -> Ended | None:
        """Who waits for the outcome of a goal."""
        waiting = self._waiting.get(ticket)
        return None if waiting is None else waiting.ended

    def cancel(self, ticket: int) -> None:
        """Stop the goal as soon as it has started."""
        if ticket in self._waiting:
            self._waiting[ticket].canceled = True

    def take(self, ticket: int, number: int) -> bool:
        """The goal leaves the queue to start after stop `number`; whether it was canceled.

        Raises TrajectoryRefusedError where a stop came since it was admitted.
        """
        waiting = self._waiting.pop(ticket, None)
        if waiting is None or waiting.number != number:
            raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, ended_by_stop(number))
        return waiting.canceled

    def forget(self, ticket: int) -> Ended | None:
        """The goal leaves the queue and will not start; its sender."""
        waiting = self._waiting.pop(ticket, None)
        return None if waiting is None else waiting.ended

    def end_before(self, number: int) -> list[Ended]:
        """Stop `number` has come: senders of all goals that were admitted before it."""
        old = [ticket for ticket, each in self._waiting.items() if each.number != number]
        senders = [self.forget(ticket) for ticket in old]
        return [ended for ended in senders if ended is not None]

    def clear(self) -> list[Ended]:
        """Senders of all that wait; none of it will start."""
        senders = [each.ended for each in self._waiting.values()]
        self._waiting.clear()
        return [ended for ended in senders if ended is not None]


def ended_by_stop(number: int) -> str:
    """Sentence of a goal that was sent before a stop."""
    return (
        f"stop {stop_count(number)} came after the trajectory was sent: recover, then send it again"
    )


def sent_before_recovery(number: int, earlier: int) -> str:
    """Sentence of a goal that was sent so much [ns] before a stop was recovered and came later."""
    return (
        f"the trajectory was sent {1e-9 * earlier:.3f} s before stop {stop_count(number)} was "
        "recovered, by its sender's clock: send it again"
    )


class Goals:
    """Goals of `simulation`, which is only touched under `lock`; now: present time of the clock
    [ns]; wall: of the system's clock [ns], by which senders say when they sent a goal.
    """

    def __init__(
        self,
        simulation: Simulation,
        lock: threading.Lock,
        now: Callable[[], int],
        wall: Callable[[], int] = time.time_ns,
    ) -> None:
        self._simulation = simulation
        self._lock = lock
        self._now = now
        self._checker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="trajectory_checks")
        self._dead = ""
        self._queue = TrajectoryQueue()
        self._wall = wall
        self._stop_seen = simulation.stop_number
        self._heeded = _StopState(simulation.stop_number, simulation.stopped)
        self._recovery = Recovery(simulation.stop_number, 0)
        self._started_ids: dict[int, int] = {}  # ids of started goals by ticket
        self._senders: dict[int, tuple[int, Ended]] = {}  # tickets and senders of these by id

    def close(self) -> None:
        """Stop checking."""
        self._checker.shutdown(wait=True, cancel_futures=True)

    @property
    def recovery(self) -> Recovery:
        """The last recovery."""
        return self._recovery

    def heed_stop(self) -> None:
        """Note when a stop was recovered; what was sent before that starts nothing. The lock is
        held.
        """
        present = _StopState(self._simulation.stop_number, self._simulation.stopped)
        last = self._recovery
        if present != self._heeded:
            self._heeded = present
            if not present.latched:
                self._recovery = Recovery(present.number, self._wall())
        elif last.at:  # a clock that was set back must not refuse until it is there again
            self._recovery = Recovery(last.number, min(last.at, self._wall()))

    def admit(self, points: int, size: int = 0, sent: int = 0) -> int:
        """Ticket for a goal of so many points and bytes, taken before it is converted; sent: when
        [ns of the sender's clock], 0 where that is not known.

        Raises TrajectoryRefusedError: too many, a stop is latched, or it was sent before the last
        one was recovered.
        """
        with self._lock:
            simulation = self._simulation
            if self._dead:
                raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, self._dead)
            if simulation.stopped:
                raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, simulation.refusal())
            self.heed_stop()
            last = self._recovery
            if 0 < sent < last.at:
                late = sent_before_recovery(last.number, last.at - sent)
                raise TrajectoryRefusedError(ErrorCode.INVALID_GOAL, late)
            return self._queue.admit(
                points, size, simulation.stop_number, simulation.settings.execution
            )

    def submit(self, ticket: int, read: Read, ended: Ended) -> None:
        """Check an admitted goal beside everything else and start it.

        read: makes the goal, may raise TrajectoryRefusedError. ended: gets the outcome, whether the
        goal was refused (id NO_GOAL) or executed; it is called from other threads.
        """
        with self._lock:
            refusal = self._dead
            if not refusal and not self._queue.submit(ticket, ended):
                refusal = ended_by_stop(self._simulation.stop_number)
        if refusal:
            ended(refused(refusal))
        else:
            self._checker.submit(self._check_and_start, ticket, read)

    def cancel(self, ticket: int) -> None:
        """Stop a goal along its path, as soon as it has started. The lock is held."""
        if ticket in self._started_ids:
            self._simulation.cancel(self._started_ids[ticket])
        else:
            self._queue.cancel(ticket)

    def forget(self, ticket: int) -> Ended | None:
        """Let go of a goal that has not started; its sender, None where there is none. The lock is
        held.
        """
        return self._queue.forget(ticket)

    def runs(self, ticket: int) -> bool:
        """Whether this goal is executed now. The lock is held."""
        return (
            ticket in self._started_ids
            and self._started_ids[ticket] == self._simulation.executor.goal_id
        )

    def take_calls(self, outcomes: Sequence[GoalOutcome]) -> list[tuple[Ended, GoalOutcome]]:
        """Senders of these outcomes and of goals that a stop has ended, to be called when the lock
        is free again. The lock is held.
        """
        calls = []
        self.heed_stop()
        if self._stop_seen != self._simulation.stop_number:
            number = self._simulation.stop_number
            self._stop_seen = number
            stopped = refused(ended_by_stop(number))
            calls = [(sender, stopped) for sender in self._queue.end_before(number)]
        for outcome in outcomes:
            ticket, sender = self._senders.pop(outcome.goal_id, (NO_GOAL, None))
            self._started_ids.pop(ticket, None)
            if sender is not None:
                calls.append((sender, outcome))
        return calls

    def drop(self, sentence: str) -> list[tuple[Ended, GoalOutcome]]:
        """End all goals, those that were started and those that were not. The lock is held."""
        self._dead = sentence
        senders = [*(ended for _, ended in self._senders.values()), *self._queue.clear()]
        self._senders.clear()
        self._started_ids.clear()
        return [(ended, refused(sentence)) for ended in senders]

    def _check_and_start(self, ticket: int, read: Read) -> None:
        """Check a goal in the checker's thread, and start it; its sender hears of a refusal."""
        if ticket not in self._queue:  # ended by a stop while it waited
            return
        refusal = None
        try:
            vetted = self._vetted(read())
        except TrajectoryRefusedError as error:
            refusal = refused(str(error), error.code)
        except Exception as error:  # a bug must not leave the sender waiting, nor end the checking
            refusal = refused(f"the check of the trajectory failed: {error!r}")
        with self._lock:
            if ticket not in self._queue:  # ended by a stop while it was checked, and answered
                return
            ended = None
            if refusal is None:
                ended, refusal = self._start(ticket, vetted)
            else:
                ended = self._queue.forget(ticket)
        if refusal is not None and ended is not None:
            ended(refusal)

    def _start(self, ticket: int, vetted: VettedGoal) -> tuple[Ended | None, GoalOutcome | None]:
        """Start a checked goal; its sender, and why it can't start. The lock is held."""
        simulation = self._simulation
        ended = self._queue.sender(ticket)
        try:
            canceled = self._queue.take(ticket, simulation.stop_number)
            goal_id = simulation.execute(vetted, self._now())
        except TrajectoryRefusedError as error:
            return ended, refused(str(error), error.code)
        self._started_ids[ticket] = goal_id
        if ended is not None:
            self._senders[goal_id] = ticket, ended
        if canceled:
            simulation.cancel(goal_id)
        return ended, None

    def _vetted(self, goal: TrajectoryGoal) -> VettedGoal:
        """The goal, checked in the cell as it is at the end of the check; a door may move
        meanwhile.
        """
        vetted = self._simulation.vet(goal, self._now())
        for _ in range(_AGAIN):
            if vetted.keep.scene is self._simulation.cell_watch.scene:
                break
            vetted = self._simulation.vet(goal, self._now())
        return vetted


def refused(sentence: str, code: int = ErrorCode.INVALID_GOAL) -> GoalOutcome:
    """Outcome of a goal that was not started."""
    return GoalOutcome(NO_GOAL, ErrorCode(code), sentence)
