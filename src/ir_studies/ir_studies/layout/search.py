"""The search for the best placements: a look at many, full plans where they could be the best.

A look costs a sixth of a plan and estimates its cost but for what stands in between. The least
difference of cost and estimate that was seen, less a margin, makes it a bound: what can't be the
best by it is not planned. That bound follows from what was seen; it is no proof. In a cycle time
joules count, which are not what J at a fixed price of time says: there the line through what was
planned takes the place of the difference. Everything goes on in rounds and batches of fixed size,
so that the same settings give the same placements, however many processes make the jobs.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from scipy.stats import qmc

from ir_description import Cell, cell_from_yaml
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import Status, StatusCode
from ir_planner import PlannerError, PlannerSettings, ProgramPlan, RequestError
from ir_planner.program import ProgramRequest, Spreads, outlook, plan_program, with_intervals
from ir_planner.request import Work
from ir_studies.layout.placement import Known, Placement, Placing, deeper, overlaps
from ir_studies.layout.settings import LayoutSettings
from ir_studies.work import Job, Row
from ir_values.errors import IrError

BATCH = 16  # placements that are planned before the bound is looked at again
_LINE = 3  # placements that make a line
_SPREAD = 8  # of the first batch, over all estimates: for the least difference
GIVEN = Placement({})
Made = Callable[[list[Job], str, str], None]
"""Makes jobs whose rows are missing: the jobs, the phase, and the best so far in words."""


class LayoutSearch:
    """rows: by the keys of jobs; made: makes those that are missing."""

    def __init__(self, settings: LayoutSettings, rows: dict[str, Row], made: Made) -> None:
        self._settings = settings
        self._rows = rows
        self._made = made
        self._conditions = settings.conditions
        self._placements: dict[str, Placement] = {}
        self._wanted: set[str] = set()  # keys of placements whose plans were made for this search

    def run(self) -> list[Known]:
        """All placements that were looked at, the given one first, then in the order of the
        search.
        """
        rounds = 1 if self._settings.method == "grid" else self._settings.rounds
        for k in range(rounds):
            new = {each.key: each for each in self._candidates(k, rounds)}
            self._placements |= {
                key: each for key, each in new.items() if key not in self._placements
            }
            looks = [each.look(self._conditions) for each in self._placements.values()]
            self._made(looks, f"round {k + 1} of {rounds}: looks", self._best_words())
            self._plan_what_matters(f"round {k + 1} of {rounds}: plans")
        return self._known()

    def _known(self) -> list[Known]:
        return [self._of(placement) for placement in self._placements.values()]

    def _of(self, placement: Placement) -> Known:
        """What the rows say; plans that a part of the search did not ask for don't count."""
        look = self._rows[placement.look(self._conditions).key]
        plans = {}
        if placement.key in self._wanted:
            plans = {each: self._rows[placement.plan(each).key] for each in self._conditions}
        return Known(placement, look, plans, self._conditions)

    def _candidates(self, k: int, rounds: int) -> Iterator[Placement]:
        if k == 0:
            yield GIVEN
            first = self._first(rounds) - 1
            yield from (
                grid(self._settings) if self._settings.method == "grid" else self._spread(first, 0)
            )
            return
        found = best_of(self._known(), self._settings.keep)
        left = self._settings.placements - self._first(rounds)
        later = rounds - 1
        count = left // later + (k <= left % later)
        if not found:  # near what?
            yield from self._spread(count, k)
        for place, known in enumerate(found):
            share = count // len(found) + (place < count % len(found))
            yield from self._near(known.placement, share, k, place)

    def _first(self, rounds: int) -> int:
        """Placements of the first round."""
        return self._settings.placements if rounds == 1 else (self._settings.placements + 1) // 2

    def _spread(self, count: int, k: int) -> Iterator[Placement]:
        """Placements over all ranges, others in every round."""
        variables = self._settings.variables
        for share in points(len(variables), count, self._settings.seed, k):
            yield Placement({v.name: v.at(float(s)) for v, s in zip(variables, share, strict=True)})

    def _near(self, centre: Placement, count: int, k: int, place: int) -> Iterator[Placement]:
        """Placements in ranges that are halved for the k-th time, around a good one."""
        variables = self._settings.variables
        for share in points(len(variables), count, self._settings.seed, k, place):
            values = {}
            for v, s in zip(variables, share, strict=True):
                width = max(v.high - v.low, 1e-12)
                at = (centre.values.get(v.name, 0.0) - v.low) / width + (float(s) - 0.5) * 0.5**k
                values[v.name] = v.at(min(max(at, 0.0), 1.0))
            yield Placement(values)

    def _plan_what_matters(self, phase: str) -> None:
        """Plan in batches, best estimate first, until nothing that is left can be the best."""
        while batch := self._batch():
            jobs = [known.placement.plan(each) for known in batch for each in self._conditions]
            self._made(jobs, phase, self._best_words())
            self._wanted |= {known.placement.key for known in batch}

    def _batch(self) -> list[Known]:
        """The placements to plan next: those that could be the best by what was seen."""
        settings = self._settings
        known = self._known()
        left = sorted(
            (one for one in known if not one.planned and math.isfinite(one.coarse)),
            key=lambda one: (one.coarse, one.placement.key),
        )
        planned = [one for one in known if one.planned]
        most = min(settings.plans - len(planned), BATCH) if settings.plans else BATCH
        finite = [one for one in planned if math.isfinite(one.cost)]
        if not finite:
            first = [one for one in left if one.placement.key == GIVEN.key]
            over_all = left[:: max(len(left) // _SPREAD, 1)][:_SPREAD]
            chosen = {one.placement.key: one for one in (*first, *over_all, *left)}
            return list(chosen.values())[: max(most, 0)]
        slope = slope_of(finite) if settings.in_cycles else 1.0
        least = min(one.cost - slope * one.coarse for one in finite)
        best = min(one.cost for one in finite)
        could = [one for one in left if slope * one.coarse * (1.0 - settings.margin) + least < best]
        return could[: max(most, 0)]

    def _best_words(self) -> str:
        costs = [one.cost for one in self._looked_at() if math.isfinite(one.cost)]
        return f"best {min(costs) / 1e3:.2f} kJ" if costs else ""

    def _looked_at(self) -> Iterable[Known]:
        looked = (
            p for p in self._placements.values() if p.look(self._conditions).key in self._rows
        )
        return [self._of(placement) for placement in looked]


def grid(settings: LayoutSettings) -> Iterator[Placement]:
    """`steps` values of every variable, all combined."""
    shares = np.linspace(0.0, 1.0, settings.steps)
    values = [[(v.name, v.at(float(share))) for share in shares] for v in settings.variables]
    for combined in product(*values):
        yield Placement(dict(combined))


def points(dimensions: int, count: int, *seeds: int) -> np.ndarray:
    """Points (count, dimensions) in [0, 1) that are spread evenly: Halton's sequence, scrambled."""
    rng = np.random.default_rng(list(seeds))
    return np.asarray(qmc.Halton(dimensions, scramble=True, rng=rng).random(max(count, 0)))


def slope_of(planned: Sequence[Known]) -> float:
    """Least-squares slope of cost over coarse cost, within 0 .. 1; 1 where they say nothing of
    it.
    """
    coarse, cost = (
        np.array([getattr(one, name) for one in planned]) for name in ("coarse", "cost")
    )
    around = coarse - np.mean(coarse)
    if len(planned) < _LINE or not around.any():
        return 1.0
    return float(np.clip(np.sum(around * cost) / np.sum(around * around), 0.0, 1.0))


def best_of(known: Iterable[Known], count: int) -> list[Known]:
    """The best that were planned."""
    finite = [one for one in known if math.isfinite(one.cost)]
    return sorted(finite, key=lambda one: (one.cost, one.placement.key))[:count]


def with_plans(known: Known, rows: dict[str, Row], seed: int) -> Known:
    """The same placement with its plans of another seed."""
    plans = {each: rows[known.placement.plan(each, seed).key] for each in known.conditions}
    return replace(known, plans=plans)


# Jobs: a look at a placement, and its program planned in full. A look says what is impossible and
# why, and what coarse movements would cost that meet nothing. Both are pure functions of the job:
# they give the same bytes in every process.

NEVER = 1e9  # s: work ends a plan, not the clock
_KINDS = {
    StatusCode.NO_IK_SOLUTION: "out of reach",
    StatusCode.GOAL_IN_COLLISION: "collision",
    StatusCode.START_STATE_IN_COLLISION: "collision",
    StatusCode.START_STATE_INVALID: "beyond limits",
    StatusCode.INVALID_GOAL_CONSTRAINTS: "too slow",
}


def row_maker(settings: Mapping[str, Any]) -> Callable[[Mapping[str, Any]], Row]:
    """What makes the row of a job. settings: cell_yaml and what LayoutSettings.budget holds."""
    return Maker(settings).row


class Maker:
    """Knows the given cell, and which of its bodies overlap already."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self._given = cell_from_yaml(settings["cell_yaml"])
        self._budget = settings
        self._placing = Placing(tuple(settings["carried"]))
        self._overlapping = overlaps(self._given)

    def row(self, words: Mapping[str, Any]) -> Row:
        """The row of a job: stage (look or plan), values, payloads or payload, cycle_time, seed."""
        try:
            if words["stage"] == "look":
                return self._look(words["values"], words["payloads"])
            return self._plan(words)
        except RequestError as error:
            return refused(error.status)
        except (PlannerError, IrError) as error:
            return {"solved": False, "kind": "beyond limits", "message": str(error)}

    def _look(self, values: Mapping[str, float], payloads: list[Mapping[str, float]]) -> Row:
        """The cost of coarse movements for every payload, or the first reason against."""
        costs = []
        for payload in payloads:
            cell = self._placing.cell(self._given, values, payload)
            new = sorted(deeper(overlaps(cell), self._overlapping).items())
            if new:
                pairs = [
                    f"{one} and {other} by {1e3 * depth:.1f} mm" for (one, other), depth in new[:3]
                ]
                said = f"machines overlap more than as given: {', '.join(pairs)}"
                return {"solved": False, "kind": "overlap", "message": said}
            request = self._request(cell, PlanOptions())
            found = outlook(request, work_of(request))
            if not found.status.ok:
                return refused(found.status)
            if not math.isfinite(found.cost):
                return {
                    "solved": False,
                    "kind": "no path",
                    "message": "no chain connects the stations",
                }
            costs.append(found.cost)
        return {"solved": True, "coarse": costs}

    def _plan(self, words: Mapping[str, Any]) -> Row:
        """The row of a placement, from its planned program."""
        cell = self._placing.cell(self._given, words["values"], words["payload"])
        cycle = float(words["cycle_time"])
        objective = "energy" if cycle > 0.0 else "time_and_energy"
        request = self._request(cell, PlanOptions(objective=objective, seed=words["seed"]), cycle)
        if words.get("robots") and not words["values"]:
            request = replace(request, savings=True)  # what a year of the given one is made of
        plan = plan_program(request, work_of(request))
        if not plan.status.ok:
            return refused(plan.status)
        spreads = Spreads(request)
        row = figures(with_intervals(plan, spreads), self._budget["time_value"], cycle)
        if plan.savings.available:
            row["common_s"] = plan.savings.total.seconds
        if words.get("robots"):
            row["robots"] = [
                round(float(one), 3) for one in np.sum(spreads.of(plan.movements), axis=0)
            ]
        return row

    def _request(self, cell: Cell, options: PlanOptions, cycle_time: float = 0.0) -> ProgramRequest:
        budget = self._budget
        settings = PlannerSettings()
        options = replace(
            options,
            planning_time=NEVER,
            max_iterations=budget["max_iterations"],
            safety_distance=budget["safety_distance"],
            time_value=budget["time_value"],
        )
        power = settings.drives(cell.robot).power(cell.robot.controller)
        stations = tuple(budget["stations"])
        start = cell.posture(cell.cycle_start(stations))
        return ProgramRequest(cell, power, stations, start, options, cycle_time, settings)


def work_of(request: ProgramRequest) -> Work:
    """As much as the planner gives a program of so many stops, in one thread: processes share the
    cores.
    """
    stops = max(len(request.stations or request.cell.program), 1)
    settings = request.settings
    most = (request.options.max_iterations or settings.max_iterations) * stops
    better = request.options.max_iterations or settings.improvement_iterations
    return Work(most, time.monotonic() + NEVER, time.monotonic, improvement=better, threads=1)


def refused(status: Status) -> Row:
    """The row of a placement that is impossible."""
    kind = _KINDS.get(StatusCode(status.code), "no path")
    return {"solved": False, "kind": kind, "message": status.message}


def figures(plan: ProgramPlan, time_value: float, cycle_time: float) -> Row:
    """What a certified program costs: J of its movements, within a cycle time its joules at the
    mains.
    """
    report = plan.report
    moves = [step.report for step in plan.movements if not step.is_pause]
    seconds = sum(move.duration for move in moves)
    drives = sum(move.energy - move.base_energy for move in moves)
    return {
        "solved": report.certified,
        "cost_j": report.energy if cycle_time > 0.0 else drives + time_value * seconds,
        "energy_j": report.energy,
        "energy_low_j": report.energy_low,
        "energy_high_j": report.energy_high,
        "duration_s": report.duration,
        "moving_j": sum(move.energy for move in moves),
        "moving_s": seconds,
        "drives_j": drives,
        "clearance_m": report.min_clearance,
        "certified": report.certified,
        "program_id": plan.program_id,
    }
