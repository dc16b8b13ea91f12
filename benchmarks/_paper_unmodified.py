"""Is the unmodified genetic algorithm ineffective in closed zones, and what do its parameters cost
in time and energy?
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence

import numpy as np
from _paper_genetic import blocked, space_of
from _paper_result import (
    Experiment,
    Row,
    Statement,
    geometric_mean,
    interval,
    mean_difference,
    percent,
    share,
)
from _paper_stations import MARGIN, Place, places
from _regional_tasks import CELLS, Task, cost_of

from ir_msgs_py.options import PlanOptions
from ir_planner.request import Context, Work
from ir_planner.search.genetic_correction import Genetic, corrected
from ir_planner.service.exit import Exit
from ir_planner.service.stochastic_withdrawal import ModifiedGa, withdraw
from ir_planner.timing.straight_steps import straight_steps
from ir_values.arrays import FloatArray

VARIANTS = {"cnc_door": 8, "deep_box": 300, "demo": 8}  # of each per seed; closed: deep_box's
EDGES = 8_000  # certified edges of a search, as for the modified one
SECONDS = 20.0
HALF = 50.0  # % of the searches
# One population that breeds until it is free or the checks are spent, on the colliding stretch as
# it is first cut out; deviations stay, and nothing pushes children apart from what they touch.
PLAIN = Genetic(
    islands=1, parting=0.0, adaptation=0.0, first=1, attempts=1, generations=10_000, settle=0
)
_DRAWN = 70  # added to the seed: no other experiment draws these cells
KINDS = {"open": "OPEN", "semi-closed": "SEMI_CLOSED", "closed": "CLOSED"}


def measure_closed(seed: int, quick: bool) -> list[Row]:
    """A row per station: whether the modified algorithm leaves its zone, and whether the plain one
    and the genetic correction by default do, told where the modified one ended.
    """
    rows = []
    drawn = {"cnc_door": 2, "deep_box": 2} if quick else VARIANTS
    for place in (one for c, n in drawn.items() for one in places((c,), seed + _DRAWN, n)):
        options = PlanOptions(seed=seed, safety_distance=place.margin, planning_time=SECONDS)
        work = Work(EDGES, time.process_time() + SECONDS, time.process_time)
        problem = Exit.of(place.q[0], Context.of(place.scene, options, work, place.station.name))
        paths = withdraw(problem, ModifiedGa(), np.random.default_rng(seed), 1).paths
        row = place.words | {"modified": bool(paths)}
        if paths:
            row |= _told(problem, paths[0][-1], place, seed)
        rows.append(row)
    return rows


def _told(problem: Exit, end: FloatArray, place: Place, seed: int) -> Row:
    """The straight movement to a configuration that is out, corrected where it is not free."""
    begin = problem.interaction
    row: Row = {"straight": False}
    for name, settings in (("plain", PLAIN), ("default", Genetic())):
        budget = Work(EDGES, time.process_time() + SECONDS, time.process_time)
        free = problem.inside.of(place.scene, place.margin, budget, place.station.name)
        if bool(free.edges_free(begin[None], end[None])[0]):
            return {"straight": True}
        found = corrected(begin, end, free, settings, np.random.default_rng(seed))
        row |= {name: bool(found.paths), f"{name} checks": budget.iterations}
    return row


def judge_closed(rows: Sequence[Row]) -> list[Statement]:
    """Share that leaves by type of zone, and against the modified one and the default."""
    found = []
    for name, kind in KINDS.items():
        asked = name == "closed"
        says = "the plain algorithm is ineffective in closed zones"
        found.append(_leaves(says if asked else f"for comparison: it leaves {name} zones",
                             rows, "plain", kind, HALF if asked else float("nan")))  # fmt: skip
    closed = _corrected(rows, "CLOSED")
    less = [100.0 * (row["modified"] - row["plain"]) for row in closed]
    found.append(Statement("the modified one leaves closed zones more often",
                           "searches that leave, modified less plain",
                           *mean_difference(less, _cells(closed)), len(less), "searches", "points",
                           2.0))  # fmt: skip
    says = "for comparison: the correction by default leaves closed zones"
    found.append(_leaves(says, rows, "default", "CLOSED"))
    tried = [row for row in rows if row["zone"] == "CLOSED"]
    mean = percent(share([row["modified"] for row in tried], _cells(tried)))
    found.append(Statement("for comparison: eq. (7) leaves closed zones", "searches that leave, "
                           "straight or not", *mean, len(tried), "searches", "%"))  # fmt: skip
    return found


def _corrected(rows: Sequence[Row], kind: str) -> list[Row]:
    """Rows of a type of zone with something to correct."""
    return [row for row in rows if row["zone"] == kind and row.get("straight") is False]


def _cells(rows: Sequence[Row]) -> list[tuple[int, str]]:
    return [(row["seed"], row["cell"]) for row in rows]


def _leaves(
    says: str, rows: Sequence[Row], key: str, kind: str, bound: float = float("nan")
) -> Statement:
    """Share of the searches in zones of a type; at most `bound` is ineffective."""
    some = _corrected(rows, kind)
    mean = percent(share([row[key] for row in some], _cells(some)))
    return Statement(says, "searches that leave the zone", *mean, len(some), "searches", "%",
                     bound, at_least=False)  # fmt: skip


def follows_closed(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    by = {one.says: one for one in statements}
    plain = by["the plain algorithm is ineffective in closed zones"]
    more = by["the modified one leaves closed zones more often"]
    default = by["for comparison: the correction by default leaves closed zones"]
    return (
        f"The plain algorithm leaves {plain.value:.0f} % of the closed zones (that it is "
        f"ineffective {plain.verdict}), {more.value:.0f} points less than the modified one (that "
        f"the modified one does better {more.verdict}); what this project adds to it, islands, "
        "pushing apart, self-adapting deviations and wider attempts, makes that "
        f"{default.value:.0f} %. Either is given a configuration outside, which is what the "
        "modified one searches: without that it has no goal at all, so what eq. (7) does not leave "
        "is not counted for either. Movements whose straight one is free are left out."
    )


# What the parameters of the correction cost.

POPULATIONS = (12, 24, 48, 96)
GENERATIONS = (5, 20, 60)
DEFAULT = (48, 20)
TASKS = 2  # of each variant
CHANGED = 33  # variants of each cell and seed
_BRED = 60  # added to the seed: no other experiment draws these variants
REAL_TIME = 100.0  # ms in which a person and a cell's cycle notice nothing


def measure_parameters(seed: int, quick: bool) -> list[Row]:
    """A row per task, size of the population and number of generations, all of which are bred."""
    rows = []
    for task in _tasks(seed, quick):
        for population in POPULATIONS:
            for generations in GENERATIONS:
                settings = Genetic(
                    population=population, generations=generations, settle=generations
                )
                row: Row = {"cell": task.cell, "task": task.name, "population": population}
                rows.append(row | {"generations": generations} | _bred(task, settings, seed))
    return rows


def _tasks(seed: int, quick: bool) -> Iterator[Task]:
    for cell in CELLS[:1] if quick else CELLS[:3]:
        for number in range(1, 2 if quick else 1 + CHANGED):
            yield from blocked(cell, seed + _BRED, number)[: 1 if quick else TASKS]


def _bred(task: Task, settings: Genetic, seed: int) -> Row:
    """Processor time [ms] of a search, and the cost of its best path in straight steps."""
    space = space_of(task)
    begin = time.process_time()
    found = corrected(task.start, task.goal, space, settings, np.random.default_rng(seed))
    row: Row = {"ms": 1e3 * (time.process_time() - begin), "solved": bool(found.paths)}
    if not found.paths:
        return row
    options = PlanOptions(safety_distance=task.margin, objective="time")
    context = Context.of(task.scene, options, Work(100_000, np.inf, time.monotonic))
    cost = cost_of(straight_steps(found.paths[0], context).trajectory, task.scene, 4e-3)
    return row | {"joules": cost.energy, "seconds": cost.duration}


def _sized(
    rows: Sequence[Row], one: tuple[int, int], other: tuple[int, int], key: str
) -> tuple[list[float], list[tuple[int, str]]]:
    """Ratios of two settings, population and generations, where both are solved."""
    by = {(r["seed"], r["cell"], r["task"], r["population"], r["generations"]): r for r in rows}
    ratios = []
    cells = []
    for seed, cell, task in dict.fromkeys(k[:3] for k in by):
        a = by.get((seed, cell, task, *one))
        b = by.get((seed, cell, task, *other))
        if a is not None and b is not None and a["solved"] and b["solved"]:
            ratios.append(a[key] / b[key])
            cells.append((seed, cell))
    return ratios, cells


def judge_parameters(rows: Sequence[Row]) -> list[Statement]:
    """Larger populations and more generations, in time and in energy."""
    found = []
    for what, one, other in (
        ("four times the individuals", (96, 20), (24, 20)),
        ("twelve times the generations", (48, 60), (48, 5)),
    ):
        for key, says, bound, at_least in (
            ("ms", f"{what} take more time", 1.0, True),
            ("joules", f"{what} give a movement of less energy", 1.0, False),
        ):
            ratios, cells = _sized(rows, one, other, key)
            ratio = interval(geometric_mean, ratios, groups=cells)
            figure = {"ms": "processor time", "joules": "E_drive"}[key]
            found.append(Statement(says, f"{figure} over that of the smaller, geometric mean",
                                   *ratio, len(ratios), "tasks", bound=bound,
                                   at_least=at_least))  # fmt: skip
    own = [r for r in rows if (r["population"], r["generations"]) == DEFAULT]
    within = percent(share([r["ms"] <= REAL_TIME for r in own], [(r["seed"], r["cell"])
                                                                 for r in own]))  # fmt: skip
    says = f"with {DEFAULT[0]} individuals and {DEFAULT[1]} generations it answers in real time"
    found.append(Statement(says, f"searches within {REAL_TIME:g} ms", *within, len(own), "tasks",
                           "%", 95.0))  # fmt: skip
    return found


def follows_parameters(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    time_p, joules_p, time_g, joules_g, real = statements
    return (
        f"Four times the individuals take {time_p.value:.2f} times the time ({time_p.verdict}) and "
        f"give {joules_p.value:.3f} times the energy ({joules_p.verdict}); twelve times the "
        f"generations {time_g.value:.2f} ({time_g.verdict}) and {joules_g.value:.3f} "
        f"({joules_g.verdict}). {real.value:.0f} % of the searches of the "
        f"default's size end within {REAL_TIME:g} ms on this machine when all generations are "
        "bred. The planner stops a few generations after the first free path and lets the "
        "optimisation of path and time do the rest, which gains more than breeding on."
    )


def tables_parameters(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Median time, and energy over that of the default, by size."""
    found = []
    for population in dict.fromkeys(row["population"] for row in rows):
        for generations in dict.fromkeys(row["generations"] for row in rows):
            size = (population, generations)
            mine = [r for r in rows if (r["population"], r["generations"]) == size]
            line: Row = {"individuals": population, "generations": generations}
            line["solved"] = f"{100 * np.mean([r['solved'] for r in mine]):.0f} % of {len(mine)}"
            line["median ms"] = f"{np.median([r['ms'] for r in mine]):.0f}"
            for title, key in (("energy", "joules"), ("duration", "seconds")):
                ratios, _ = _sized(rows, size, DEFAULT, key)
                line[f"{title}, times default"] = (
                    f"{geometric_mean(np.array(ratios)):.3f}" if ratios else ""
                )
            found.append(line)
    return {"All generations bred; energy and duration in straight steps": found}


EXPERIMENTS = (
    Experiment(
        "unmodified_ga",
        "The unmodified genetic algorithm in closed zones",
        "The genetic algorithm as it is, without the modification of eq. (7), is ineffective in "
        "closed zones.",
        f"Stations of {', '.join(f'{n} variants of {name}' for name, n in VARIANTS.items())} per "
        "seed; closed are those of deep_box alone. Where eq. (7) leaves the zone, a plain genetic "
        "algorithm is asked for the same movement, from the station to the configuration outside "
        "that eq. (7) found: the genetic correction of section IV as one population of fixed "
        "deviation, with nothing that pushes children apart from what they touch, in one attempt "
        "that is bred until it is free or its checks are spent. Beside it the correction by "
        f"default; {EDGES} checks for each. Ineffective: it leaves in at most {HALF:g} % of the "
        f"searches. {MARGIN}",
        measure_closed,
        judge_closed,
        follows_closed,
    ),
    Experiment(
        "ga_parameters",
        "The genetic correction's parameters against real time and energy",
        "Size of the population and number of generations decide whether the genetic algorithm "
        "works in real time, and how much energy its movement takes.",
        f"{TASKS} blocked tasks of {CHANGED} variants of each of {', '.join(CELLS[:3])} per seed; "
        "all generations are bred. The energy is that of the best path, driven in straight steps "
        "as fast as the limits allow.",
        measure_parameters,
        judge_parameters,
        follows_parameters,
        tables_parameters,
    ),
)
