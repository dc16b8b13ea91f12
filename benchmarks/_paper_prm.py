"""PRM's time against that of the other planners."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from _paper_peers import Question, searched
from _paper_result import (
    FAILS,
    HOLDS,
    Experiment,
    Row,
    Statement,
    geometric_mean,
    interval,
    median,
    variation,
)
from _paper_zones import KINDS, MOST, questions
from _regional_tasks import tasks_of

# of each planner per task; checks
DRAWS = 8
EDGES = 15_000
# tasks of cells; cells of each type of zones per seed, and movements in each
TASKS = 5
PLACES = 8
AMONG = 2
# between the cells of two seeds; the first, beyond those of the claims on zones
_SEEDS = 1000
_FIRST = 500
MOSTLY = 0.8  # share of the draws that must be solved: where checks end the others, time can't vary
CELLS = ("open", "table_columns", "cnc_door")
OTHERS = ("kpiece", "bkpiece", "lbkpiece", "sbl", "rrt", "rrt_connect", "tree", "genetic")


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per search: tasks whose straight movement is not free, planner and draw."""
    draws = 5 if quick else DRAWS
    rows = []
    for place, label, question in blocked(seed, quick):
        for planner in ("prm", *OTHERS):
            for draw in range(draws):
                found = searched(planner, question, draw + draws * seed, EDGES)
                row = {"place": f"{place} {seed}", "task": f"{label} {seed}", "draw": draw}
                row |= {"planner": planner, "solved": found.solved}
                rows.append(row | {"edges": found.edges, "seconds": found.seconds})
    return rows


def blocked(seed: int, quick: bool, places: int = PLACES) -> list[tuple[str, str, Question]]:
    """Questions whose straight movement is not free: tasks of cells, and among MOST zones of each
    type, in so many places; each with where it is asked (there and back, and movements among the
    same zones, are one place) and its name.
    """
    tasks = [task for cell in CELLS for task in tasks_of(cell)]
    asked = [
        (" ".join((task.cell, *sorted(task.name.split("->")))), task.label,
         Question(task.scene, task.start, task.goal, task.margin))
        for task in tasks
    ]  # fmt: skip
    blocked = [one for one in asked if not one[2].straight_is_free()]
    chosen = np.random.default_rng(5).permutation(len(blocked))[seed % 2 :: 2]
    found = [blocked[k] for k in chosen[: 1 if quick else TASKS]]
    for kind in KINDS:
        for place in range(1 if quick else places):
            among = questions(kind, (MOST,), 1 if quick else AMONG, _SEEDS * seed + _FIRST + place)
            name = f"{kind.lower()} zones {place}"
            found += [(name, f"{name} {k}", one[MOST]) for k, one in enumerate(among)]
    return found


def _variations(rows: Sequence[Row], planner: str, key: str = "seconds") -> dict[str, float]:
    """Coefficient of variation over the draws of every task that is mostly solved."""
    mine: dict[str, list[Row]] = {}
    for row in rows:
        if row["planner"] == planner:
            mine.setdefault(row["task"], []).append(row)
    return {
        task: variation(np.array([row[key] for row in some]))
        for task, some in mine.items()
        if np.mean([row["solved"] for row in some]) >= MOSTLY
    }


def judge(rows: Sequence[Row]) -> list[Statement]:
    """Variation of PRM's time, and against every other planner's."""
    prm = _variations(rows, "prm")
    places = {row["task"]: row["place"] for row in rows}
    found = [
        Statement("PRM's time is unpredictable: it varies as much as it lasts",
                  "coefficient of variation of the processor time, median of the tasks",
                  *interval(median, list(prm.values()), groups=[places[task] for task in prm]),
                  len(prm), "tasks", bound=1.0)
    ]  # fmt: skip
    for name in OTHERS:
        other = _variations(rows, name)
        tasks = [task for task in prm if prm[task] > 0.0 and other.get(task, 0.0) > 0.0]
        ratios = [prm[task] / other[task] for task in tasks]
        ratio = interval(geometric_mean, ratios, groups=[places[task] for task in tasks])
        says = f"PRM's time varies more than that of {name}"
        figure = "ratio of the coefficients of variation, geometric mean"
        found.append(Statement(says, figure, *ratio, len(tasks), "tasks", bound=1.0))
    return found


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    prm, *others = statements
    more = [one.says.rpartition(" ")[2] for one in others if one.verdict == HOLDS]
    less = [one.says.rpartition(" ")[2] for one in others if one.verdict == FAILS]
    rest = [one.says.rpartition(" ")[2] for one in others if one.verdict not in (HOLDS, FAILS)]
    parts = [
        f"{what} {', '.join(names)}"
        for what, names in (
            ("more than that of", more),
            ("less than that of", less),
            ("open against", rest),
        )
        if names
    ]
    lasts = {HOLDS: "as much as it lasts", FAILS: "less than it lasts"}.get(
        prm.verdict, "about as much as it lasts"
    )
    return (
        f"PRM's coefficient of variation is {prm.value:.2f} [{prm.low:.2f}, {prm.high:.2f}]: its "
        f"time varies {lasts}; {'; '.join(parts)}. Every planner that draws at random has a time "
        "that varies; what helps users is a budget in counted work, and the same answer for the "
        "same seed, which PRM can't promise, for it divides its work by time."
    )


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Time and variation of every planner."""
    found = []
    for name in ("prm", *OTHERS):
        mine = [row for row in rows if row["planner"] == name]
        ms = [1e3 * row["seconds"] for row in mine]
        line: Row = {
            "planner": name,
            "solved": f"{100 * np.mean([row['solved'] for row in mine]):.0f} %",
        }
        line |= {
            "median ms": f"{np.median(ms):.1f}",
            "95th percentile ms": f"{np.percentile(ms, 95):.1f}",
        }
        varies = {key: list(_variations(rows, name, key).values()) for key in ("seconds", "edges")}
        time, checks = (f"{np.median(x):.2f}" if x else "" for x in varies.values())
        found.append(line | {"variation of time": time, "of checks": checks})
    return {"Searches alone, until the first certified path": found}


EXPERIMENT = Experiment(
    "prm_time",
    "PRM: is its time unpredictable?",
    "The time that PRM takes is unpredictable.",
    f"Movements whose straight one is blocked, tasks of {', '.join(CELLS)} and among {MOST} "
    f"zones of each type; {DRAWS} draws of each planner per task, at most {EDGES} checks; "
    "processor time until the first certified path. A task counts for planners that solve at "
    f"least {MOSTLY:.0%} of its draws. OMPL's planners run in a process per search, all on the "
    "same kernel; their clock runs from the first check to the last, without what the process "
    "and its problem take to be set up.",
    measure,
    judge,
    follows,
    tables,
)
