"""The best placements and the given one, with error bars: seeds, and what is not known of the
robot.

The interval of a saving is that of the difference over the same drawn robots, as for all savings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ir_planner.checks import Interval, interval
from ir_studies.layout.placement import FIRST_SEED, Known, Placement
from ir_studies.layout.search import GIVEN, best_of
from ir_studies.layout.settings import Condition, LayoutSettings
from ir_studies.work import Job, Row


@dataclass(frozen=True)
class Final:
    """A placement under a condition. rows: by seed; robots (ROBOTS,): what the drawn robots add,
    J.
    """

    placement: Placement
    condition: Condition
    rows: tuple[Row, ...]

    @property
    def solved(self) -> bool:
        """Whether every seed gave a certified program."""
        return all(row.get("solved") for row in self.rows)

    def mean(self, name: str = "energy_j") -> float:
        """Mean of a figure over the seeds."""
        return float(np.mean([row[name] for row in self.rows])) if self.solved else math.nan

    def spread(self, name: str = "energy_j") -> float:
        """Largest less smallest over the seeds."""
        return float(np.ptp([row[name] for row in self.rows])) if self.solved else math.nan

    @property
    def is_given(self) -> bool:
        """Whether everything stands where the cell file has it."""
        return self.placement.key == GIVEN.key

    @property
    def robots(self) -> np.ndarray:
        """What the drawn robots add (ROBOTS,) to its joules."""
        return np.array(self.rows[0]["robots"])

    @property
    def interval(self) -> Interval:
        """The 90 % interval of its joules."""
        return interval(self.mean(), self.robots)

    def saving(self, given: Final) -> tuple[float, Interval]:
        """Joules that it takes less than the given one, with their 90 % interval."""
        less = given.mean() - self.mean()
        return less, interval(less, given.robots - self.robots)


def final_jobs(known: Sequence[Known], settings: LayoutSettings) -> list[Job]:
    """Plans of the best and of the given placement with all seeds; the first seed with the drawn
    robots.
    """
    return [
        job for placement in finalists(known, settings) for _, job in _jobs(placement, settings)
    ]


def finalists(known: Sequence[Known], settings: LayoutSettings) -> list[Placement]:
    """The given placement, then the best of the others."""
    others = [one for one in known if one.placement.key != GIVEN.key]
    best = [one.placement for one in best_of(others, settings.keep)]
    feasible = [
        one.placement
        for one in known
        if one.placement.key == GIVEN.key and math.isfinite(one.coarse)
    ]
    return [*feasible, *best]


def finals(
    known: Sequence[Known], settings: LayoutSettings, rows: Mapping[str, Row]
) -> list[tuple[Final, ...]]:
    """Of each finalist one per condition: the given placement first, then by their mean cost."""
    found = []
    for placement in finalists(known, settings):
        by: dict[Condition, list[Row]] = {}
        for condition, job in _jobs(placement, settings):
            by.setdefault(condition, []).append(rows[job.key])
        found.append(
            tuple(Final(placement, condition, tuple(own)) for condition, own in by.items())
        )
    return sorted(
        found, key=lambda own: (not own[0].is_given, mean_cost(own), own[0].placement.key)
    )


def mean_cost(own: Sequence[Final]) -> float:
    """Mean cost over conditions and seeds; inf where one is impossible."""
    if not all(one.solved for one in own):
        return math.inf
    return float(np.mean([one.mean("cost_j") for one in own]))


def _jobs(placement: Placement, settings: LayoutSettings) -> Iterator[tuple[Condition, Job]]:
    for condition in settings.conditions:
        for seed in range(FIRST_SEED, FIRST_SEED + settings.seeds):
            yield condition, placement.plan(condition, seed, robots=seed == FIRST_SEED)
