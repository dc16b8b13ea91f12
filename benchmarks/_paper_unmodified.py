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

STATIONS = ("cnc_door", "deep_box", "demo")
VARIANTS = 200  # of each and seed
EDGES = 8_000  # certified edges of a search, as for the modified one
SECONDS = 20.0
HALF = 50.0  # % of the searches
KINDS = {"open": "OPEN", "semi-closed": "SEMI_CLOSED", "closed": "CLOSED"}


def measure_closed(seed: int, quick: bool) -> list[Row]:
    """A row per station: whether the modified algorithm leaves its zone, and whether the unmodified
    one does, told where the modified one ended.
    """
    rows = []
    cells = STATIONS[:2] if quick else STATIONS
    for place in places(cells, seed + 40, 2 if quick else VARIANTS):
        options = PlanOptions(seed=seed, safety_distance=place.margin, planning_time=SECONDS)
        work = Work(EDGES, time.process_time() + SECONDS, time.process_time)
        problem = Exit.of(place.q[0], Context.of(place.scene, options, work, place.station.name))
        paths = withdraw(problem, ModifiedGa(), np.random.default_rng(seed), 1).paths
        row = place.words | {"modified": bool(paths)}
        if paths:
            row |= _unmodified(problem, paths[0][-1], place, seed)
        rows.append(row)
    return rows


def _unmodified(problem: Exit, end: FloatArray, place: Place, seed: int) -> Row:
    """The genetic correction of the straight movement to a configuration that is out."""
    begin = problem.interaction
    budget = Work(EDGES, time.process_time() + SECONDS, time.process_time)
    free = problem.inside.of(place.scene, place.margin, budget, place.station.name)
    if bool(free.edges_free(begin[None], end[None])[0]):
        return {"straight": True}
    found = corrected(begin, end, free, Genetic(), np.random.default_rng(seed))
    return {"straight": False, "unmodified": bool(found.paths)}


def judge_closed(rows: Sequence[Row]) -> list[Statement]:
    """Share that leaves by type of zone, and against the modified one."""
    found = []
    for name, kind in KINDS.items():
        some = [row for row in rows if row["zone"] == kind and row.get("straight") is False]
        cells = [(row["seed"], row["cell"]) for row in some]
        mean = percent(share([row["unmodified"] for row in some], cells))
        asked = name == "closed"
        says = f"the unmodified algorithm is ineffective in {name} zones"
        found.append(Statement(says if asked else f"for comparison: it leaves {name} zones",
                               "searches that leave the zone", *mean, len(some), "searches", "%",
                               HALF if asked else float("nan"), at_least=False))  # fmt: skip
    closed = [row for row in rows if row["zone"] == "CLOSED" and row.get("straight") is False]
    less = [100.0 * (row["modified"] - row["unmodified"]) for row in closed]
    cells = [(row["seed"], row["cell"]) for row in closed]
    found.append(Statement("the modified one leaves closed zones more often",
                           "searches that leave, modified less unmodified",
                           *mean_difference(less, cells), len(less), "searches", "points",
                           2.0))  # fmt: skip
    return found


def follows_closed(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    by = {one.says: one for one in statements}
    closed = by["the unmodified algorithm is ineffective in closed zones"]
    more = by["the modified one leaves closed zones more often"]
    return (
        f"The unmodified algorithm leaves {closed.value:.0f} % of the closed zones "
        f"(that it is ineffective {closed.verdict}), {more.value:.0f} points less than the "
        "modified one. It is given a configuration outside, which is what the modified one "
        "searches: without that it has no goal at all. Movements whose straight one is free are "
        "left out."
    )


# What the parameters of the correction cost.

POPULATIONS = (12, 24, 48, 96)
GENERATIONS = (5, 20, 60)
DEFAULT = (48, 20)
TASKS = 2  # of each cell and seed
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
        yield from blocked(cell, seed + 40, 1)[: 1 if quick else TASKS]


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
        f"Stations of {', '.join(STATIONS)} and of {VARIANTS} variants of each per seed. Where eq. "
        "(7) leaves the zone, the genetic correction of section IV, with this project's defaults "
        "(islands, and children pushed apart from what they touch: more than a plain genetic "
        "algorithm), is asked for the same movement, "
        f"from the station to the configuration outside that eq. (7) found, with {EDGES} checks "
        f"for either. Ineffective: it leaves in at most {HALF:g} % of the searches. {MARGIN}",
        measure_closed,
        judge_closed,
        follows_closed,
    ),
    Experiment(
        "ga_parameters",
        "The genetic correction's parameters against real time and energy",
        "Size of the population and number of generations decide whether the genetic algorithm "
        "works in real time, and how much energy its movement takes.",
        f"{TASKS} blocked tasks of a variant of each of {', '.join(CELLS[:3])} per seed; all "
        "generations are bred. The energy is that of the best path, driven in straight steps as "
        "fast as the limits allow.",
        measure_parameters,
        judge_parameters,
        follows_parameters,
        tables_parameters,
    ),
)
