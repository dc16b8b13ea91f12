"""A tended cell as an instance of the public benchmark: what the planner chooses a cycle from, so
that others can solve it.

The robot stays in front of stations, before and after each transport; transports and empty hops are
its movements. A curve of energy is a movement for each of its straight pieces, and a power mode a
place of its own, to which coming costs what the mode's transitions do: both are exact. What isn't:
a hop to where the robot is already takes a millisecond. Which processes go on over the end of the
cycle is that of the planned cycle.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ir_planner import SteadyPlan
from ir_planner.cycle import Curve, SteadyCycle, SteadyProblem, WaitMode
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
    """The cell of a plan at its period. Raises SettingsError for a cycle of several units, which
    the format can't say without naming every part: where a machine holds several parts, too.
    """
    if plan.cycle is None or plan.problem is None or plan.cell is None:
        raise SettingsError(f"there is no cycle to write: {plan.status.message}")
    if plan.cycle.units > 1:
        raise SettingsError(
            f"the cycle makes {plan.cycle.units} parts: only cycles of one are written"
        )
    made = _Tended(plan.problem, plan.cycle)
    robot = InstanceRobot("robot", made.stops(), made.hops(), made.modes())
    return Instance(plan.cell.name, plan.cycle.period, (robot,), made.lags())


class _Tended:
    """Numbers of the instance: stays before activities, stays after them, transports, hops."""

    def __init__(self, problem: SteadyProblem, cycle: SteadyCycle) -> None:
        self.problem = problem
        self.cycle = cycle
        every = [*problem.before, *problem.after]
        useful = {mode for modes in every for mode in _useful(modes, cycle.period)}
        names = [mode.name for mode in problem.before[0] if mode.name in useful]
        self.before = [self._named(modes, names) for modes in problem.before]
        self.after = [self._named(modes, names) for modes in problem.after]

    @staticmethod
    def _named(modes: tuple[WaitMode, ...], names: list[str]) -> tuple[WaitMode, ...]:
        return tuple(mode for mode in modes if mode.name in names)

    @property
    def _count(self) -> int:
        return len(self.problem.activities)

    def _before(self, activity: int) -> int:
        """Number of the stay before an activity."""
        return activity

    def _after(self, activity: int) -> int:
        """Number of the stay after an activity."""
        return self._count + activity

    def _transport(self, activity: int) -> int:
        return 2 * self._count + activity

    def modes(self) -> dict[int, float]:
        """Shortest waits by power mode."""
        return {k: mode.shortest for k, mode in enumerate(self.before[0])}

    def stops(self) -> tuple[StaticActivity, ...]:
        """Stays before and after every activity."""
        stays = [
            *((self._before(a), self.before[a]) for a in range(self._count)),
            *((self._after(a), self.after[a]) for a in range(self._count)),
        ]
        return tuple(
            StaticActivity(
                number, 0.0, self.cycle.period, self._places(number, modes), closes=number == 0
            )
            for number, modes in stays
        )

    def _places(self, number: int, modes: tuple[WaitMode, ...]) -> tuple[StopLocation, ...]:
        """One for each power mode; in it the others draw what motors do."""
        motors = modes[0].watts
        return tuple(
            StopLocation(
                k,
                self._point(number, k),
                {n: modes[n].watts if n == k else motors for n in range(len(modes))},
            )
            for k in range(len(modes))
        )

    def _point(self, number: int, mode: int) -> int:
        return number * len(self.before[0]) + mode

    def hops(self) -> tuple[DynamicActivity, ...]:
        """Transports, and empty hops to every other activity."""
        found = [
            self._hop(
                self._transport(a),
                self._before(a),
                self._after(a),
                self.problem.activities[a],
                self.after[a],
            )
            for a in range(self._count)
        ]
        number = 3 * self._count
        still = Curve((_NO_HOP,), (0.0,))
        for a in range(self._count):
            for b in range(self._count):
                if a == b:
                    continue
                curve = self.problem.hops.get((a, b), still)
                ends = self._after(a), self._before(b)
                found.append(self._hop(number, *ends, curve, self.before[b]))
                number += 1
        return tuple(found)

    def _hop(
        self, number: int, start: int, end: int, curve: Curve, modes: tuple[WaitMode, ...]
    ) -> DynamicActivity:
        """From all places of a stay to all of another; to come to one costs its transitions."""
        movements: list[HopMovement] = []
        for here in range(len(modes)):
            for there, mode in enumerate(modes):
                for piece in _pieces(curve, mode.joules):
                    points = self._point(start, here), self._point(end, there)
                    movements.append(HopMovement(len(movements), *points, piece))
        return DynamicActivity(number, start, end, tuple(movements))

    def lags(self) -> tuple[TimeLag, ...]:
        """A part is taken when its process is over, and the next one brought after that."""
        starts = {visit.activity: visit.start for visit in self.cycle.visits}
        lags: list[TimeLag] = []
        for machine, seconds in enumerate(self.problem.process):
            over = int(starts[machine + 1] < starts[machine])
            end = self._after(machine)
            lags.append(TimeLag(end, self._transport(machine + 1), seconds, over))
            if machine > 0:  # the first activity begins the cycle
                free = self._after(machine + 1)
                lags.append(TimeLag(free, self._transport(machine), 0.0, 1 - over))
        return tuple(lags)


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
