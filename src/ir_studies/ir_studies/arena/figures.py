"""Figures of an arena: runs as a table; success, times and costs, and their growth with time."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from ir_recorder.analysis.intervals import Mean, median_of
from ir_studies.arena.settings import ArenaEntry
from ir_studies.work import Row
from ir_values.arrays import FloatArray

NUMBERS = (
    "first_path_s", "first_s", "final_s", "duration_s", "energy_j", "drives_j", "cost_j", "movement_cost",  # noqa: E501
    "clearance_m", "safety_distance_m", "total_s",
)  # fmt: skip
TIMES = ("first_path_s", "first_s", "final_s", "total_s")
"""Columns that a clock wrote: where work ends a run, all others come again with the same seed."""
TEXTS = ("outcome", "message", "trajectory_id")
Cell = str | float | int


@dataclass(frozen=True)
class ArenaRun:
    """An entry with its row."""

    entry: ArenaEntry
    row: Row

    @property
    def solved(self) -> bool:
        """Whether a certified trajectory was found."""
        return bool(self.row.get("solved", False))

    @property
    def free_ptp(self) -> bool:
        """Whether the straight movement was free."""
        return bool(self.row.get("free_ptp", False))

    def number(self, name: str) -> float:
        """A figure, NaN where there is none."""
        value = self.row.get(name, math.nan)
        return float(value) if isinstance(value, int | float) else math.nan

    @property
    def progress(self) -> list[tuple[float, float]]:
        """Seconds and J of each answer that was better than those before."""
        found = self.row.get("progress", [])
        return [(pair[0], pair[1]) for pair in found] if isinstance(found, list) else []


def asked_alike(runs: Sequence[ArenaRun]) -> tuple[ArenaRun, ...]:
    """The runs, where one that was cut or died knows from others of its question whether the
    straight movement is free.
    """
    free = {run.entry.question for run in runs if run.free_ptp}
    return tuple(
        replace(run, row={**run.row, "free_ptp": True}) if run.entry.question in free else run
        for run in runs
    )


def columns(runs: Sequence[ArenaRun]) -> dict[str, list[Cell]]:
    """The table by its columns."""
    rows = [_cells(run) for run in runs]
    return {name: [row[name] for row in rows] for name in _cells(runs[0])} if rows else {}


def _cells(run: ArenaRun) -> dict[str, Cell]:
    return {
        **asdict(run.entry),
        "free_ptp": int(run.free_ptp),
        "solved": int(run.solved),
        **{name: run.number(name) for name in NUMBERS},
        "requests": int(run.number("requests")) if "requests" in run.row else 0,
        "truncated": int(bool(run.row.get("truncated", False))),
        **{name: str(run.row.get(name, "")) for name in TEXTS},
    }


GRID = 400  # instants of the curves over time
Question = tuple[str, str, str, str]


@dataclass(frozen=True)
class Figures:
    """Runs of one planner: how many were solved of how many, medians of seconds, and of J over the
    best that anybody found for the same question; cut and dead ones.
    """

    planner: str
    solved: int
    count: int
    first: float
    final: float
    cost_ratio: float
    duration: float
    energy: float
    movement_ratio: float
    clearance: float
    lost: int

    @property
    def success(self) -> float:
        """Share of the runs that were solved."""
        return self.solved / self.count if self.count else math.nan


def best_costs(runs: Iterable[ArenaRun], name: str = "cost_j") -> dict[Question, float]:
    """The least figure of each question, whoever found it."""
    best: dict[Question, float] = {}
    for run in runs:
        value = run.number(name)
        if run.solved and value < best.get(run.entry.question, math.inf):
            best[run.entry.question] = value
    return best


def figures(planner: str, runs: Sequence[ArenaRun]) -> Figures:
    """The figures of a planner among runs of all of them: medians over what it solved; costs as
    ratios to the best of all planners.
    """
    best_joules = best_costs(runs)
    best_movement = best_costs(runs, "movement_cost")
    own = [run for run in runs if run.entry.planner == planner]
    solved = [run for run in own if run.solved]
    cost_ratios = []
    movement_ratios = []
    for run in solved:
        question = run.entry.question
        cost_ratios.append(_over(run.number("cost_j"), best_joules[question]))
        movement_ratios.append(_over(run.number("movement_cost"), best_movement[question]))
    return Figures(
        planner=planner,
        solved=len(solved),
        count=len(own),
        first=_median(run.number("first_s") for run in solved),
        final=_median(run.number("final_s") for run in solved),
        cost_ratio=_median(cost_ratios),
        duration=_median(run.number("duration_s") for run in solved),
        energy=_median(run.number("energy_j") for run in solved),
        movement_ratio=_median(movement_ratios),
        clearance=min((run.number("clearance_m") for run in solved), default=math.nan),
        lost=sum(run.row.get("outcome", "answered") != "answered" for run in own),
    )


@dataclass(frozen=True)
class Against:
    """Another planner held against one over the questions of both. fewer, more: questions of which
    it solved fewer, or more, of its seeds; chance: of such an imbalance, or a larger one, between
    planners that solve alike; both: questions that both solved; cost: there the median of its J
    above the one's, in percent, with its interval.
    """

    planner: str
    fewer: int
    more: int
    chance: float
    both: int
    cost: Mean


def against(planner: str, other: str, runs: Sequence[ArenaRun]) -> Against:
    """Another planner against one. Seeds of a question are no independent runs: a question counts
    once, by the share of its seeds that was solved and by its median J.
    """
    mine = _by_question(planner, runs)
    its = _by_question(other, runs)
    asked = sorted(mine.keys() & its.keys())
    shares = np.array([_share(its[one]) - _share(mine[one]) for one in asked])
    fewer = int((shares < 0.0).sum())
    more = int((shares > 0.0).sum())
    both = [one for one in asked if _share(mine[one]) > 0.0 and _share(its[one]) > 0.0]
    costs = np.array([100.0 * (_over(_cost(its[one]), _cost(mine[one])) - 1.0) for one in both])
    cost = median_of(costs[np.isfinite(costs)])
    return Against(other, fewer, more, _sign_chance(fewer, more), len(both), cost)


def _by_question(planner: str, runs: Iterable[ArenaRun]) -> dict[Question, list[ArenaRun]]:
    found: dict[Question, list[ArenaRun]] = {}
    for run in runs:
        if run.entry.planner == planner:
            found.setdefault(run.entry.question, []).append(run)
    return found


def _share(own: Sequence[ArenaRun]) -> float:
    return sum(run.solved for run in own) / len(own)


def _cost(own: Sequence[ArenaRun]) -> float:
    return _median(run.number("cost_j") for run in own if run.solved)


def _sign_chance(fewer: int, more: int) -> float:
    """Two-sided chance of the sign test; 1 where nothing differs."""
    from scipy.special import bdtr

    count = fewer + more
    return min(1.0, 2.0 * float(bdtr(min(fewer, more), count, 0.5))) if count else 1.0


def success_over_time(
    planners: Sequence[str], runs: Sequence[ArenaRun], time: FloatArray
) -> FloatArray:
    """Percent of the runs (N, planners) that were solved until each time (N,)."""
    return np.stack(
        [_solved_until([r for r in runs if r.entry.planner == p], time) for p in planners], 1
    )


def cost_over_time(
    planners: Sequence[str], runs: Sequence[ArenaRun], time: FloatArray, winner: str
) -> FloatArray:
    """J until each time (N,) against the winner's last answer, in percent (N, planners): as
    `against` has it, the median over the questions that both solved, of each the median of its
    seeds; NaN while fewer than half of them have an answer. It ends at the cost of `against`.
    """
    mine = _by_question(winner, runs)
    found = []
    for planner in planners:
        its = _by_question(planner, runs)
        both = [one for one in its if one in mine and _share(its[one]) > 0.0]
        both = [one for one in both if _share(mine[one]) > 0.0]
        own = [_ratio_until(its[one], _cost(mine[one]), time) for one in both]
        found.append(np.median(np.stack(own), 0) if own else np.full(len(time), np.inf))
    value = 100.0 * (np.stack(found, 1) - 1.0)
    return np.where(np.isfinite(value), value, np.nan)


def _solved_until(own: Sequence[ArenaRun], time: FloatArray) -> FloatArray:
    first = np.sort([run.number("first_s") for run in own if run.solved])
    return np.asarray(100.0 * np.searchsorted(first, time, side="right") / max(len(own), 1))


def _ratio_until(own: Sequence[ArenaRun], cost: float, time: FloatArray) -> FloatArray:
    """J so far (N,) of the solved seeds of a question over a cost, their median; inf before half of
    them have an answer.
    """
    found = []
    for run in own:
        if run.solved and run.progress:
            at, joules = np.array(run.progress).T
            known = np.array([np.inf, *(_over(value, cost) for value in joules)])
            found.append(known[np.searchsorted(at, time, side="right")])
    if not found:
        return np.full(len(time), np.inf)
    return np.asarray(np.median(np.stack(found), 0))


def _over(value: float, least: float) -> float:
    """A figure as a multiple of the least one; where that is 0, as of a task that stays, 1 or
    inf.
    """
    if least == 0.0:
        return 1.0 if value == 0.0 else math.inf
    return value / least


def _median(values: Iterable[float]) -> float:
    found = [value for value in values if math.isfinite(value)]
    return float(np.median(found)) if found else math.nan


def blocked_and_free(runs: Sequence[ArenaRun]) -> tuple[list[ArenaRun], list[ArenaRun]]:
    """Runs whose straight movement is blocked, and those whose is free."""
    return [run for run in runs if not run.free_ptp], [run for run in runs if run.free_ptp]


def of_all(runs: Sequence[ArenaRun]) -> list[ArenaRun]:
    """The runs whose question and seed every planner was asked: of an arena that is not finished,
    those that compare alike.
    """
    planners = {run.entry.planner for run in runs}
    asked: dict[tuple[Question, int], set[str]] = {}
    for run in runs:
        asked.setdefault((run.entry.question, run.entry.seed), set()).add(run.entry.planner)
    common = [run for run in runs if asked[run.entry.question, run.entry.seed] == planners]
    return common or list(runs)


def of_cell(runs: Iterable[ArenaRun], cell: str) -> list[ArenaRun]:
    """Runs in a cell."""
    return [run for run in runs if run.entry.cell == cell]


def longest(runs: Iterable[ArenaRun]) -> float:
    """Seconds until the last run improved its answer, or ended."""
    return max((run.number("total_s") for run in runs if run.number("total_s") > 0.0), default=1.0)
