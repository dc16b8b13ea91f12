"""Goals from their sender to their outcome: checked in a thread of their own, started, stopped,
reported.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor

from ir_sim_driver.controller.goal_checks import VettedGoal
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import ErrorCode, Outcome, TrajectoryGoal

QUEUE_MAX = 32  # a flood is refused before it fills the memory; a sender waits for its goal anyway
NO_GOAL = 0
_AGAIN = 3  # times that a goal is checked again because the cell has changed

Read = Callable[[], TrajectoryGoal]
Ended = Callable[[Outcome], None]


class Goals:
    """Goals of `simulation`, which is only touched under `lock`; now: present time of the clock
    [ns].
    """

    def __init__(
        self, simulation: Simulation, lock: threading.Lock, now: Callable[[], int]
    ) -> None:
        self._simulation = simulation
        self._lock = lock
        self._now = now
        self._checker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="trajectory_checks")
        self._tickets = 0
        self._dead = ""
        self._pending: set[int] = set()  # tickets of goals that are not started yet
        self._canceled: set[int] = set()  # those of them that are to be stopped at once
        self._running: dict[int, int] = {}  # ids of started goals by ticket
        self._waiting: dict[int, tuple[int, Ended]] = {}  # tickets and senders by id

    def close(self) -> None:
        """Stop checking."""
        self._checker.shutdown(wait=True, cancel_futures=True)

    def submit(self, points: int, read: Read, ended: Ended) -> int:
        """Check a goal of so many points beside everything else and start it; returns its ticket.

        read: makes the goal, may raise TrajectoryRefusedError. ended: gets the outcome, whether the
        goal was refused (id NO_GOAL) or executed; it is called from other threads.
        """
        with self._lock:
            self._tickets += 1
            ticket = self._tickets
            refusal = self._dead
            limit = self._simulation.settings.execution.max_points
            if not refusal and points > limit:  # refused before it waits: what waits takes memory
                refusal = f"the trajectory has {points} points: at most {limit}"
            if not refusal and len(self._pending) >= QUEUE_MAX:
                refusal = f"{QUEUE_MAX} trajectories are waiting to be checked: send fewer"
            if not refusal:
                self._pending.add(ticket)
        if refusal:
            ended(_refused(refusal))
        else:
            self._checker.submit(self._check_and_start, ticket, read, ended)
        return ticket

    def cancel(self, ticket: int) -> None:
        """Stop a goal along its path, as soon as it has started. The lock is held."""
        if ticket in self._pending:
            self._canceled.add(ticket)
        elif ticket in self._running:
            self._simulation.cancel(self._running[ticket])

    def runs(self, ticket: int) -> bool:
        """Whether this goal is executed now. The lock is held."""
        return (
            ticket in self._running and self._running[ticket] == self._simulation.executor.goal_id
        )

    def take_calls(self, outcomes: Sequence[Outcome]) -> list[tuple[Ended, Outcome]]:
        """Senders of these outcomes, to be called when the lock is free again. The lock is held."""
        calls = []
        for outcome in outcomes:
            ticket, ended = self._waiting.pop(outcome.goal_id, (NO_GOAL, None))
            self._running.pop(ticket, None)
            if ended is not None:
                calls.append((ended, outcome))
        return calls

    def drop(self, sentence: str) -> list[tuple[Ended, Outcome]]:
        """End all goals that were started, and refuse those that were not. The lock is held."""
        self._dead = sentence
        calls = [(ended, _refused(sentence)) for _, ended in self._waiting.values()]
        self._waiting.clear()
        self._running.clear()
        return calls

    def _check_and_start(self, ticket: int, read: Read, ended: Ended) -> None:
        refusal = None
        try:
            vetted = self._vetted(read())
        except TrajectoryRefusedError as error:
            refusal = _refused(str(error), error.code)
        except Exception as error:  # a bug must not leave the sender waiting, nor end the checking
            refusal = _refused(f"the check of the trajectory failed: {error!r}")
        with self._lock:
            self._pending.discard(ticket)
            canceled = ticket in self._canceled
            self._canceled.discard(ticket)
            if self._dead:
                refusal = _refused(self._dead)
            elif refusal is None:
                try:
                    goal_id = self._simulation.execute(vetted, self._now())
                except TrajectoryRefusedError as error:
                    refusal = _refused(str(error), error.code)
                else:
                    self._running[ticket] = goal_id
                    self._waiting[goal_id] = ticket, ended
                    if canceled:
                        self._simulation.cancel(goal_id)
        if refusal is not None:
            ended(refusal)

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


def _refused(sentence: str, code: int = ErrorCode.INVALID_GOAL) -> Outcome:
    return Outcome(NO_GOAL, ErrorCode(code), sentence)
