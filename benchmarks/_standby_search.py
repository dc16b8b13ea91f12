"""Exhaustive search over sequences of power modes with timers, each simulated event by event;
shares no code with the planner.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

Plan = tuple[tuple[int, float], ...]  # mode and when it is asked for [s]


@dataclass(frozen=True)
class Controller:
    """watts: on motors and in each mode. enter, stay, leave [s] of each mode. timer [s]: brakes by
    itself.
    """

    watts: tuple[float, ...]
    enter: tuple[float, ...]
    stay: tuple[float, ...]
    leave: tuple[float, ...]
    timer: float

    def run(self, plan: Plan, wake: float, end: float) -> tuple[float, float]:
        """Energy [J] until the robot is ready and needed, at `end` at the earliest, and when that
        is [s]; motors are asked for at `wake`.
        """
        orders = [(at, k) for k, at in plan if at < wake]
        if not orders and wake <= self.timer:
            wake = end  # asked for on motors, motors change nothing, and the timer goes on
        if (not orders or orders[0][0] > self.timer) and wake > self.timer:
            orders = [(self.timer, 0), *((at, k) for at, k in orders if k != 0)]
        now = energy = 0.0
        mode = -1
        for at, k in orders:
            start = max(at, now)
            if mode >= 0 and start >= wake:
                break
            power = self.watts[mode + 1]
            energy += (
                power * (start - now) + power * self.enter[k] + self.watts[k + 1] * self.stay[k]
            )
            now = start + self.enter[k] + self.stay[k]
            mode = k
        if mode >= 0:
            energy += self.watts[mode + 1] * max(wake - now, 0.0) + self.watts[0] * self.leave[mode]
            now = max(wake, now) + self.leave[mode]
        return energy + self.watts[0] * max(end - now, 0.0), max(now, end)

    def plans(self, grid: Sequence[float]) -> Iterator[Plan]:
        """All sequences that go deeper, at the times of a grid or as soon as the mode before can be
        left.
        """
        modes = range(len(self.enter))
        for count in range(len(self.enter) + 1):
            for chosen in itertools.combinations(modes, count):
                yield from self._timed(chosen, grid, ())

    def _timed(
        self, chosen: tuple[int, ...], grid: Sequence[float], before: Plan
    ) -> Iterator[Plan]:
        if len(before) == len(chosen):
            yield before
            return
        first = (
            sum((before[-1][1], self.enter[before[-1][0]], self.stay[before[-1][0]]))
            if before
            else 0.0
        )
        for at in [first, *(time for time in grid if time > first)]:
            yield from self._timed(chosen, grid, (*before, (chosen[len(before)], at)))

    def least_known(self, pause: float, grid: Sequence[float]) -> float:
        """Least energy [J] of a pause of known length [s], ready at its end; inf: nothing is ready
        then.
        """
        found = []
        for plan in self.plans(grid):
            for wake in (pause, *(pause - leave for leave in self.leave)):
                if wake > 0.0:
                    energy, ready = self.run(plan, wake, pause)
                    if ready <= pause + 1e-9:
                        found.append(energy)
        return min(found, default=float("inf"))

    def least_expected(self, lengths: Sequence[float], grid: Sequence[float]) -> float:
        """Least mean energy [J] of pauses whose end wakes the robot."""
        return min(
            sum(self.run(plan, pause, pause)[0] for pause in lengths) / len(lengths)
            for plan in self.plans(grid)
        )
