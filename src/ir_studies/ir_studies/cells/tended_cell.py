"""A tended cell as an instance of the public benchmark: what the planner chooses a cycle from, so
that others can solve it.

The robot stays in front of stations, before and after each transport; transports and empty hops are
its movements. In a cycle of several parts each of them has stays and movements of its own. A curve
of energy is a movement for each of its straight pieces, and a power mode a place of its own, to
which coming costs what the mode's transitions do: both are exact. What isn't: a hop to where the
robot is already takes a millisecond. How many parts machines hold when the cycle begins is that of
the planned cycle.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise, permutations
from math import lcm

import numpy as np

from ir_planner import SteadyPlan
from ir_planner.cycle import Curve, Node, SteadyCycle, SteadyProblem, WaitMode
from ir_studies.cells.instance import (
    DynamicActivity,
    EnergyCurve,
    HopMovement,
    Instance,
    InstanceRobot,
    StaticActivity,
    StopLocation,
    TimeLag,
)
from ir_studies.errors import SettingsError

_NO_HOP = 1e-3  # s
_LENGTHS = 2000  # of waits at which power modes are compared


def tended_instance(plan: SteadyPlan) -> Instance:
    """The cell of a plan at its period. Raises SettingsError where there is no cycle."""
    if plan.once is None or plan.problem is None or plan.cell is None:
        raise SettingsError(f"there is no cycle to write: {plan.status.message}")
    return cycle_instance(plan.cell.name, plan.problem, plan.once)


def cycle_instance(name: str, problem: SteadyProblem, cycle: SteadyCycle) -> Instance:
    """What a cycle was chosen from, at its period, for as many parts, and with as many in each
    machine when it begins.
    """
    made = _Tended(problem, cycle)
    robot = InstanceRobot("robot", made.stops(), made.hops(), made.modes())
    return Instance(name, cycle.period, (robot,), tuple(made.lags()))


class _Tended:
    """Numbers of the instance: stays before activities, stays after them, transports, hops."""

    def __init__(self, problem: SteadyProblem, cycle: SteadyCycle) -> None:
        self.problem = problem
        self.cycle = cycle
        every = [modes for modes in (*problem.before, *problem.after) if modes]
        useful = {mode for modes in every for mode in _useful(modes, cycle.period)}
        self.names = [mode.name for mode in problem.before[0] if mode.name in useful]
        count = len(problem.activities)
        self.nodes: list[Node] = [(a, unit) for unit in range(cycle.units) for a in range(count)]

    def _modes_at(self, waits: tuple[WaitMode, ...]) -> tuple[WaitMode, ...]:
        return tuple(mode for mode in waits if mode.name in self.names)

    def _before(self, node: Node) -> int:
        """Number of the stay before an activity."""
        return self.nodes.index(node)

    def _after(self, node: Node) -> int:
        """Number of the stay after an activity."""
        return len(self.nodes) + self.nodes.index(node)

    def _transport(self, node: Node) -> int:
        return 2 * len(self.nodes) + self.nodes.index(node)

    def modes(self) -> dict[int, float]:
        """Shortest waits by power mode."""
        return {k: mode.shortest for k, mode in enumerate(self._modes_at(self.problem.before[0]))}

    def stops(self) -> tuple[StaticActivity, ...]:
        """Stays before and after every activity."""
        before = [(self._before(node), self.problem.before[node[0]]) for node in self.nodes]
        after = [(self._after(node), self.problem.after[node[0]]) for node in self.nodes]
        return tuple(
            StaticActivity(
                number,
                0.0,
                self.cycle.period if waits else 0.0,
                self._places(number, waits),
                closes=number == 0,
            )
            for number, waits in (*before, *after)
        )

    def _places(self, number: int, waits: tuple[WaitMode, ...]) -> tuple[StopLocation, ...]:
        """One for each power mode; in it the others draw what motors do. One where the robot does
        not wait.
        """
        count = len(self.names)
        modes = self._modes_at(waits)
        if not modes:
            return (StopLocation(0, self._point(number, 0), dict.fromkeys(range(count), 0.0)),)
        motors = modes[0].watts
        return tuple(
            StopLocation(
                k,
                self._point(number, k),
                {n: modes[n].watts if n == k else motors for n in range(count)},
            )
            for k in range(count)
        )

    def _point(self, number: int, mode: int) -> int:
        return number * len(self.names) + mode

    def hops(self) -> tuple[DynamicActivity, ...]:
        """Transports, and empty hops to every activity that may be next."""
        found = [
            self._hop(
                self._transport(node),
                (self._before(node), self.problem.before[node[0]]),
                (self._after(node), self.problem.after[node[0]]),
                self.problem.activity(node),
            )
            for node in self.nodes
        ]
        number = 3 * len(self.nodes)
        still = Curve((_NO_HOP,), (0.0,))
        for one, other in permutations(self.nodes, 2):
            curve = self.problem.hop(one, other[0])
            if curve is None and one[0] == other[0]:
                continue
            start = self._after(one), self.problem.after[one[0]]
            end = self._before(other), self.problem.before[other[0]]
            found.append(self._hop(number, start, end, curve or still))
            number += 1
        return tuple(found)

    def _hop(
        self,
        number: int,
        start: tuple[int, tuple[WaitMode, ...]],
        end: tuple[int, tuple[WaitMode, ...]],
        curve: Curve,
    ) -> DynamicActivity:
        """From all places of a stay to all of another; to come to one costs its transitions."""
        movements: list[HopMovement] = []
        joules = [mode.joules for mode in self._modes_at(end[1])] or [0.0]
        for here in range(len(self._modes_at(start[1])) or 1):
            for there, transitions in enumerate(joules):
                for piece in _pieces(curve, transitions):
                    points = self._point(start[0], here), self._point(end[0], there)
                    movements.append(HopMovement(len(movements), *points, piece))
        return DynamicActivity(number, start[0], end[0], tuple(movements))

    def lags(self) -> Iterator[TimeLag]:
        """The units of an activity come in turn. A part is taken when its process is over, and one
        is brought where there is a place.
        """
        units = self.cycle.units
        for a, unit in self.nodes:
            if units > 1:
                yield self._lag((a, unit), (a, unit + 1), 0.0)
        for machine, process in enumerate(self.problem.process):
            full = self.cycle.full[machine]
            for unit in range(units):
                gone = unit + full - self.problem.places[machine]
                yield self._lag((machine + 1, gone), (machine, unit), 0.0)
                capacity = self.problem.capacity[machine]
                for before in range(self._queue(machine)):
                    load = machine, unit - before * capacity
                    unload = machine + 1, unit + full
                    yield self._lag(load, unload, (before + 1) * process)

    def _queue(self, machine: int) -> int:
        """Parts, one after the other in the same place of work, of which the last one may have to
        wait for the first: as many as come to it until the cycle repeats.
        """
        capacity = self.problem.capacity[machine]
        if self.problem.places[machine] == capacity:
            return 1
        return lcm(self.cycle.units, capacity) // capacity

    def _lag(self, one: Node, other: Node, seconds: float) -> TimeLag:
        """From the end of an activity to the begin of another; units are counted through cycles."""
        units = self.cycle.units
        periods = other[1] // units - one[1] // units
        end = self._after((one[0], one[1] % units))
        return TimeLag(end, self._transport((other[0], other[1] % units)), seconds, periods)


def _useful(modes: tuple[WaitMode, ...], longest: float) -> set[str]:
    """Modes that are the cheapest for some length of a wait."""
    lengths = np.linspace(0.0, longest, _LENGTHS)
    joules = [
        np.where(
            (lengths >= mode.shortest) & (lengths <= mode.longest),
            mode.joules + mode.watts * lengths,
            np.inf,
        )
        for mode in modes
    ]
    return {modes[0].name, *(modes[k].name for k in np.argmin(joules, axis=0))}


def _pieces(curve: Curve, joules: float) -> Iterator[EnergyCurve]:
    """The straight pieces of a curve, and so many joules more."""
    corners = list(zip(curve.seconds, curve.joules, strict=True))
    if len(corners) == 1:
        ((seconds, energy),) = corners
        yield EnergyCurve(((0, energy + joules),), seconds, seconds)
    for (begin, high), (end, low) in pairwise(corners):
        slope = (low - high) / (end - begin)
        yield EnergyCurve(((1, slope), (0, high - slope * begin + joules)), begin, end)
