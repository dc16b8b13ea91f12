"""The schedule of least energy of a cell, with a proven gap.

Rounds of the whole model: solve, hold what was decided, take the durations of least energy, add
tangents there, and again until the bound meets the energy. Cells of many robots that this doesn't
solve at once first get a schedule robot by robot, two at a time decided while the others are
relaxed, or the first that the whole model gives. Some robots decided and all others relaxed bound
the energy from below, sooner than the whole does. Then part of the schedule is decided anew while
the rest is held: one robot, the orders of all, or their places, as long as that gains.
"""

from __future__ import annotations

import functools
import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ir_planner.cycle import LinearAnswer
from ir_studies.cells.cell_model import CellModel
from ir_studies.cells.instance import Instance, InstanceRobot, Schedule
from ir_values.arrays import FloatArray

PROVED = 1e-6
"""Relative difference of energy and bound from which on a schedule counts as proved."""

_MANY = 4  # robots, from which on parts are decided one after the other first
_ROOT_ROUNDS = 8
_MOST_ROUNDS = 30
_CLOSE = 2e-9  # of the energy: what a tangent may miss a curve by
_COARSE = 2e-6  # the same before anything is decided
_PART_GAP = 2e-3  # of a part of the cell
_PART_SHARE = 0.04  # of the seconds, for one part
_EASY_SHARE = 0.02  # for a cell that needs no parts
_FIRST_SHARE = 0.25  # for a first schedule of the whole
_BOUND_SHARE = 0.2  # for the bound of some robots
_ANEW_SHARE = 0.1  # for a part that is decided anew
_WHOLE_SHARE = 0.03  # is left for the whole


@dataclass(frozen=True)
class CellAnswer:
    """schedule: None where none was found; bound [J]: no schedule needs less, inf: there is none;
    seconds: of processor time; first_seconds: until there was a schedule (inf: there is none).
    """

    instance: Instance
    schedule: Schedule | None
    bound: float
    seconds: float
    first_seconds: float = np.inf

    @property
    def energy(self) -> float:
        """Energy of a cycle [J]; inf without a schedule."""
        return self.schedule.energy if self.schedule else np.inf

    @property
    def is_impossible(self) -> bool:
        """Whether it is proved that there is no schedule."""
        return self.bound == np.inf

    @property
    def gap(self) -> float:
        """How far the energy may be above the least, as a share of it; 0: proved."""
        if self.schedule is None:
            return np.inf
        gap = (self.energy - self.bound) / self.energy
        return 0.0 if gap <= PROVED else gap


def solve_cell(instance: Instance, seconds: float = 120.0, gap: float = PROVED) -> CellAnswer:
    """The cheapest schedule found in `seconds` of processor time, or as soon as it is within `gap`
    (a share of its energy).
    """
    return _Search(instance, seconds, gap).run()


def after(seconds: float) -> Callable[[], bool]:
    """Whether so much processor time has passed from now on, however busy the machine is."""
    end = time.process_time() + seconds
    return lambda: time.process_time() > end


def hurried(instance: Instance) -> Instance:
    """Every robot by itself, with all movements as fast as they can be and waits in the mode that
    is always open: what a saving is compared with.
    """
    robots = tuple(_hurried(robot) for robot in instance.robots)
    return replace(instance, robots=robots, lags=(), handovers=(), conflicts=())


def _hurried(robot: InstanceRobot) -> InstanceRobot:
    hops = tuple(
        replace(
            hop,
            movements=tuple(
                replace(m, curve=replace(m.curve, most=m.curve.least)) for m in hop.movements
            ),
        )
        for hop in robot.hops
    )
    awake = min(robot.modes, key=lambda mode: (robot.modes[mode], mode))
    return replace(robot, hops=hops, modes={awake: robot.modes[awake]})


class _Search:
    def __init__(self, instance: Instance, seconds: float, gap: float) -> None:
        self._begun = time.process_time()
        self._end = self._begun + seconds
        self._seconds = seconds
        self._gap = gap
        self._model = CellModel(instance)
        self._instance = instance
        self._bound = 0.0
        self._best: Schedule | None = None
        self._point: FloatArray | None = None
        self._first = np.inf

    @property
    def _left(self) -> float:
        return self._end - time.process_time()

    def run(self) -> CellAnswer:
        """Everything, in turn."""
        self._root()
        if self._bound < np.inf and len(self._instance.robots) >= _MANY:
            is_easy = self._whole(self._seconds * _EASY_SHARE)
            if not (is_easy or self._is_done):
                self._part_by_part()
        rounds = 0
        while self._left > 0.0 and not self._is_done and rounds < _MOST_ROUNDS:
            self._whole(self._left)
            rounds += 1
        spent = time.process_time() - self._begun
        return CellAnswer(self._instance, self._best, self._bound, spent, self._first)

    @property
    def _is_done(self) -> bool:
        if self._best is None:
            return self._bound == np.inf
        energy = self._best.energy
        return energy - self._bound <= self._gap * energy

    def _root(self) -> None:
        for _ in range(_ROOT_ROUNDS):
            answer = self._model.program.relaxed()
            self._bound = max(self._bound, answer.bound)
            if answer.values is None or not self._model.refine(
                answer.values, _COARSE * answer.cost
            ):
                return

    def _whole(self, seconds: float) -> bool:
        """One round of the whole model; whether it came to its end."""
        answer = self._model.program.solve(
            start=self._point, stopped=after(seconds), gap=min(self._gap, PROVED) / 10.0
        )
        self._bound = max(self._bound, answer.bound)
        if answer.values is not None:
            self._hold(answer.values)
        return answer.finished

    def _hold(self, values: FloatArray) -> bool:
        """Durations of least energy for what a point decides; whether there are any."""
        fixed = self._model.choices(values)
        for left in reversed(range(_MOST_ROUNDS)):
            answer = self._model.program.relaxed(fixed)
            if answer.values is None:
                return False
            values = answer.values
            # of corners that are cut after the last round the point has no weights
            if left == 0 or not self._model.refine(values, _CLOSE * abs(answer.cost)):
                break
        self._keep(values)
        return True

    def _keep(self, values: FloatArray) -> None:
        """Take a point's schedule if it is the best."""
        schedule = self._model.schedule(values)
        if self._best is None:
            self._first = time.process_time() - self._begun
        if self._best is None or schedule.energy < self._best.energy:
            self._best = schedule
            self._point = values

    # Many robots.

    def _part_by_part(self) -> None:
        """A schedule, and parts of it decided anew as long as that gains."""
        found = self._best is not None
        if not (found or self._relax_and_fix(2) or self._first_of_all() or self._relax_and_fix(3)):
            return
        if not self._is_done:
            self._bound_by_robots()
            self._improve()

    def _improve(self) -> None:
        """Decide parts anew in turn, until none gains."""
        assert self._point is not None
        self._hold(self._point)
        model = self._model
        robots = range(len(self._instance.robots))
        parts: list[Callable[[FloatArray], dict[int, float]]] = [
            *(functools.partial(model.of_others, {robot}) for robot in robots),
            model.of_orders,
            model.of_places,
        ]
        idle = 0
        for held in itertools.cycle(parts):
            if self._is_done or self._left < self._seconds * _WHOLE_SHARE or idle == len(parts):
                return
            idle = 0 if self._anew(held) else idle + 1

    def _first_of_all(self) -> bool:
        """The first schedule that the whole model gives."""
        answer = self._model.program.solve(
            stopped=after(min(self._left, self._seconds * _FIRST_SHARE)), gap=_PART_GAP, first=True
        )
        self._bound = max(self._bound, answer.bound)
        if answer.values is None:
            return False
        self._keep(answer.values)
        return True

    def _bound_by_robots(self) -> None:
        """Raise the bound by each robot alone, then by those together that raise it most."""
        root = self._bound
        end = self._left - _BOUND_SHARE * self._seconds
        robots = range(len(self._instance.robots))
        alone = {robot: self._bound_of({robot}).bound for robot in robots if self._left > end}
        order = sorted(alone, key=lambda robot: (-alone[robot], robot))
        together = set(order[:1])
        for robot in order[1:]:
            if self._is_done or self._left <= end or alone[robot] <= root * (1.0 + PROVED):
                return
            if self._bound_of(together | {robot}).finished:
                together.add(robot)

    def _bound_of(self, robots: set[int]) -> LinearAnswer:
        """Decide some robots while the others are relaxed."""
        answer = self._model.program.solve(
            loose=self._model.wholes_outside(robots),
            stopped=after(min(self._left, self._seconds * _ANEW_SHARE)),
            gap=_PART_GAP / 100.0,
        )
        self._bound = max(self._bound, answer.bound)
        return answer

    def _relax_and_fix(self, together: int) -> bool:
        """Decide robots in turn, the next ones with them, the rest relaxed; two at a time only
        where that is quick.
        """
        model = self._model
        robots = len(self._instance.robots)
        fixed: dict[int, float] = {}
        values: FloatArray | None = None
        for first in range(robots - together + 1):
            last = first + together == robots
            decided = set(range(first + together))
            answer = model.program.solve(
                fixed=fixed,
                loose=[] if last else model.wholes_outside(decided),
                stopped=after(min(self._left, self._seconds * _PART_SHARE * together / 2.0)),
                gap=_PART_GAP,
            )
            if answer.values is None or (together == 2 and not answer.finished):
                return False
            values = answer.values
            for index in model.wholes_within(set(range(first + 1))):
                fixed[index] = float(round(values[index]))
        assert values is not None
        self._keep(values)
        return True

    def _anew(self, held: Callable[[FloatArray], dict[int, float]]) -> bool:
        """Decide again what isn't held of the best schedule; whether that gains."""
        assert self._point is not None
        assert self._best is not None
        before = self._best.energy
        answer = self._model.program.solve(
            fixed=held(self._point),
            start=self._point,
            stopped=after(self._seconds * _ANEW_SHARE),
            gap=_PART_GAP / 10.0,
        )
        if answer.values is not None:
            self._hold(answer.values)
        return self._best.energy < before * (1.0 - PROVED)
