"""What the paper says against other planners: KPIECE's cells, PRM's time, RRT among many zones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from _paper_peers import Question, searched
from _paper_plots import finished, panels
from _paper_result import FAILS, HOLDS, Experiment, Row, Statement
from _paper_statistics import geometric_mean, interval, median, variation
from _paper_zones import KINDS, MOST, questions
from _regional_tasks import tasks_of

from ir_msgs_py.arrays import FloatArray

EDGES = 6000  # checks of a search, in certified edges: one that spends them counts with them
SIZES = (0, 1, 3, 10, 30, MOST)
FEW = 10  # zones up to which there are few
TASKS, QUICK_TASKS = 12, 1  # movements per type and seed
ONE_CELL = 100.0  # rad: larger than every joint's range
SUPERFLUOUS = 0.9  # of the checks without cells: less would be worth having them
SLOWER = 1.2  # times the checks among one zone from which on a planner has slowed down
PRM_DRAWS, PRM_TASKS, PRM_EDGES = 10, 3, 15_000  # of each planner per task; tasks of cells; checks
MOSTLY = 0.8  # share of the draws that must be solved: where checks end the others, time can't vary
PRM_CELLS = ("open", "table_columns", "cnc_door")
OTHERS = ("kpiece", "bkpiece", "lbkpiece", "sbl", "rrt", "rrt_connect", "tree", "genetic")


def _among_zones(seed: int, sizes: tuple[int, ...], tasks: int) -> Iterator[tuple[str, int, int, Question]]:
    for kind in KINDS:
        for number, asked in enumerate(questions(kind, sizes, tasks, seed)):
            for size, question in asked.items():
                yield kind, size, number, question


def _row(
    planner: str, question: Question, seed: int, cell: float | None = None, edges: int = EDGES
) -> Row:
    found = searched(planner, question, seed, edges, cell)
    return {"planner": planner, "solved": found.solved, "edges": found.edges, "seconds": found.seconds}


def _ratios(rows: Sequence[Row], one: Row, other: Row, key: str = "edges") -> tuple[FloatArray, list[str]]:
    """Ratios of a figure between rows that agree in what both conditions say, question by question; and the
    question of each.
    """

    def taken(condition: Row) -> dict[tuple[object, ...], float]:
        same = [row for row in rows if all(row[k] == v for k, v in condition.items())]
        free = [k for k in ("seed", "kind", "zones", "task", "draw") if k not in condition]
        return {tuple(row.get(k) for k in free): max(float(row[key]), 1e-4) for row in same}

    a, b = taken(one), taken(other)
    both = [k for k in a if k in b]
    return np.array([a[k] / b[k] for k in both]), [f"{k[0]} {k[1:]}" for k in both]


# -- KPIECE


def measure_kpiece(seed: int, quick: bool) -> list[Row]:
    """A row per search with cells of 0.3 rad, and with a grid of one cell per quadrant of the joints."""
    rows = []
    for kind, size, number, question in _among_zones(seed, SIZES[1:], QUICK_TASKS if quick else TASKS):
        for draw in range(1 if quick else 2):
            for name, cell in (("cells", None), ("no cells", ONE_CELL)):
                row = _row("kpiece", question, draw, cell)
                rows.append({"grid": name, "kind": kind, "zones": size, "task": number, "draw": draw} | row)
    return rows


def judge_kpiece(rows: Sequence[Row]) -> list[Statement]:
    """Checks with cells over checks without."""
    found = []
    for name, some in (
        (f"up to {FEW} zones", [row for row in rows if row["zones"] <= FEW]),
        (f"more than {FEW} zones", [row for row in rows if row["zones"] > FEW]),
    ):
        ratio, groups = _ratios(some, {"grid": "cells"}, {"grid": "no cells"})
        tasks = [group.rsplit(",", 2)[0] for group in groups]
        found.append(
            Statement(
                f"among {name} the cells save no checks worth the name",
                "checks with cells over without, geometric mean",
                *interval(geometric_mean, ratio, groups=tasks),
                len(ratio),
                "pairs of searches",
                bound=SUPERFLUOUS,
            )
        )
    return found


def follows_kpiece(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    few, many = statements
    start = {
        HOLDS: f"The paper is right: with few zones the cells save nothing ({few.value:.2f} of the checks)",
        FAILS: f"Even with few zones the cells save checks ({few.value:.2f} of those without)",
    }.get(few.verdict, f"With few zones the ratio is {few.value:.2f}, which doesn't decide it")
    return (
        f"{start}; among more it is {many.value:.2f} [{many.low:.2f}, {many.high:.2f}]. The grid costs no checks, "
        "only memory: it stays as OMPL has it."
    )


# -- RRT


def measure_rrt(seed: int, quick: bool) -> list[Row]:
    """A row per search of each planner in every size of the cell."""
    rows = []
    for kind, size, number, question in _among_zones(seed, SIZES, QUICK_TASKS if quick else TASKS):
        for planner in ("rrt", "rrt_connect", "tree", "genetic"):
            rows.append({"kind": kind, "zones": size, "task": number} | _row(planner, question, number))
    return rows


def judge_rrt(rows: Sequence[Row]) -> list[Statement]:
    """Checks among many zones over checks among one, by type and planner."""
    found = []
    for planner, kinds in [("rrt", (kind,)) for kind in KINDS] + [
        (name, KINDS) for name in ("rrt", "rrt_connect", "tree", "genetic")
    ]:
        some = [row for row in rows if row["planner"] == planner and row["kind"] in kinds]
        ratio, groups = _ratios(some, {"zones": MOST}, {"zones": 1})
        where = "all types" if len(kinds) > 1 else kinds[0].lower().replace("_", "-") + " zones"
        own = planner == "rrt"
        says = f"RRT slows down with the number of zones: {where}" if own else f"for comparison: {planner}"
        figure = f"checks among {MOST} zones over checks among one, geometric mean"
        mean = interval(geometric_mean, ratio, groups=groups)
        bound = SLOWER if own else float("nan")
        found.append(Statement(says, figure, *mean, len(ratio), "movements", "", bound))
    return found


def follows_rrt(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    opened, semi, closed, rrt, connect, tree, genetic = (one.value for one in statements)
    return (
        f"RRT needs {opened:.1f}, {semi:.1f} and {closed:.1f} times the checks among {MOST} open, semi-closed and "
        f"closed zones ({rrt:.1f} over all). But this is no property of RRT alone: the genetic correction needs "
        f"{genetic:.0f} times, the planner's own tree {tree:.0f} times, for among one zone most straight movements are "
        f"free and these two ask for that first; RRTConnect, two trees, needs {connect:.1f} times. How slow a "
        "search is follows from whether the straight movement is blocked and how narrow is what remains; the "
        "table has the processor times, in which the tree is the fastest."
    )


def tables_rrt(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Median processor time and the share solved, by size."""
    found = []
    for kind in KINDS:
        for size in SIZES:
            line: Row = {"type": kind.lower().replace("_", "-"), "zones": size}
            for planner in ("rrt", "rrt_connect", "tree", "genetic"):
                some = [r for r in rows if (r["kind"], r["zones"], r["planner"]) == (kind, size, planner)]
                ms = 1e3 * float(np.median([row["seconds"] for row in some]))
                line[planner] = f"{ms:.1f} ms, {100 * np.mean([row['solved'] for row in some]):.0f} %"
            found.append(line)
    return {"Median processor time of a search and share solved within its checks": found}


def draw_rrt(rows: Sequence[Row], file: Path) -> None:
    """Time over the number of zones."""
    figure, axes = panels(3, width=3.6, height=3.4)
    for panel, kind in zip(axes, KINDS, strict=True):
        for planner in ("rrt", "rrt_connect", "tree", "genetic"):
            mine = [row for row in rows if row["kind"] == kind and row["planner"] == planner]
            times = [[1e3 * row["seconds"] for row in mine if row["zones"] == size] for size in SIZES]
            panel.plot([max(size, 0.3) for size in SIZES], [np.mean(t) for t in times], "o-", ms=3, label=planner)
        panel.set(xscale="log", yscale="log", xlabel="zones (left: none)", title=kind.lower().replace("_", "-"))
    axes[0].set_ylabel("processor time of a search, mean [ms]")
    axes[0].legend(fontsize=8)
    finished(figure, file)


# -- PRM


def measure_prm(seed: int, quick: bool) -> list[Row]:
    """A row per search: tasks whose straight movement is not free, planner and draw."""
    draws = 5 if quick else PRM_DRAWS
    rows = []
    for label, question in _blocked(seed, quick):
        for planner in ("prm", *OTHERS):
            for draw in range(draws):
                row = _row(planner, question, draw + draws * seed, edges=PRM_EDGES)
                rows.append({"task": f"{label} {seed}", "draw": draw} | row)
    return rows


def _blocked(seed: int, quick: bool) -> list[tuple[str, Question]]:
    """Questions whose straight movement is not free: tasks of cells, and among MOST zones of each type."""
    tasks = [task for cell in PRM_CELLS for task in tasks_of(cell)]
    asked = [(task.label, Question(task.scene, task.start, task.goal, task.margin)) for task in tasks]
    blocked = [one for one in asked if not one[1].straight_is_free()]
    chosen = np.random.default_rng(5).permutation(len(blocked))[seed % 2 :: 2]
    found = [blocked[k] for k in chosen[: 1 if quick else PRM_TASKS]]
    for kind in KINDS:
        among = questions(kind, (MOST,), 1 if quick else PRM_TASKS, seed)
        found += [(f"{kind.lower()} zones {k}", one[MOST]) for k, one in enumerate(among)]
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


def judge_prm(rows: Sequence[Row]) -> list[Statement]:
    """Variation of PRM's time, and against every other planner's."""
    prm = _variations(rows, "prm")
    found = [
        Statement("PRM's time is unpredictable: it varies as much as it lasts",
                  "coefficient of variation of the processor time, median of the tasks",
                  *interval(median, list(prm.values())), len(prm), "tasks", bound=1.0)
    ]  # fmt: skip
    for name in OTHERS:
        other = _variations(rows, name)
        tasks = [task for task in prm if prm[task] > 0.0 and other.get(task, 0.0) > 0.0]
        ratio = interval(geometric_mean, [prm[task] / other[task] for task in tasks])
        says = f"PRM's time varies more than that of {name}"
        figure = "ratio of the coefficients of variation, geometric mean"
        found.append(Statement(says, figure, *ratio, len(tasks), "tasks", bound=1.0))
    return found


def follows_prm(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    prm, *others = statements
    more = [one.says.rpartition(" ")[2] for one in others if one.verdict == HOLDS]
    less = [one.says.rpartition(" ")[2] for one in others if one.verdict == FAILS]
    rest = [one.says.rpartition(" ")[2] for one in others if one.verdict not in (HOLDS, FAILS)]
    parts = [
        f"{what} {', '.join(names)}"
        for what, names in (("more than", more), ("less than", less), ("not distinguishable from", rest))
        if names
    ]
    return (
        f"PRM's coefficient of variation is {prm.value:.2f} [{prm.low:.2f}, {prm.high:.2f}]: it varies "
        f"{'; '.join(parts)}. Every planner that draws at random has a time that varies, the genetic correction "
        "included; what helps users is a budget in counted work, and the same answer for the same seed, which PRM "
        "alone can't promise, for it divides its work by time."
    )


def tables_prm(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Time and variation of every planner."""
    found = []
    for name in ("prm", *OTHERS):
        mine = [row for row in rows if row["planner"] == name]
        ms = [1e3 * row["seconds"] for row in mine]
        line: Row = {"planner": name, "solved": f"{100 * np.mean([row['solved'] for row in mine]):.0f} %"}
        line |= {"median ms": f"{np.median(ms):.1f}", "95th percentile ms": f"{np.percentile(ms, 95):.1f}"}
        varies = {key: list(_variations(rows, name, key).values()) for key in ("seconds", "edges")}
        time, checks = (f"{np.median(x):.2f}" if x else "" for x in varies.values())
        found.append(line | {"variation of time": time, "of checks": checks})
    return {"Searches alone, until the first certified path": found}


KPIECE = Experiment(
    "kpiece_cells",
    "KPIECE: are the cells superfluous with few zones?",
    "KPIECE divides the space into cells, which are superfluous where there are few forbidden zones.",
    "OMPL's KPIECE1 among 1 to 100 zones (open, semi-closed, closed; machines of 0.3 to 0.6 m at random around "
    "the robot), with cells of 0.3 rad over the first three joints, and with cells larger than the joints' "
    "range. Movements between free configurations, the same ones in every size, whose straight movement is "
    f"blocked in the largest. Counted: checks until the first path, at most {EDGES}. Superfluous: at least "
    f"{SUPERFLUOUS:.0%} of the checks that it takes without cells.",
    measure_kpiece,
    judge_kpiece,
    follows_kpiece,
)
RRT = Experiment(
    "rrt_zones",
    "RRT and the number of zones",
    "RRT becomes slow as the number of forbidden zones grows.",
    "The same cells and movements among 0 to 100 zones; OMPL's RRT and RRTConnect, the planner's own "
    f"bidirectional tree and the genetic correction, at most {EDGES} checks each. Slower: at least {SLOWER} times the "
    "checks among one zone.",
    measure_rrt,
    judge_rrt,
    follows_rrt,
    tables_rrt,
    draw_rrt,
    "Mean processor time of one search over the number of zones, by type.",
)
PRM = Experiment(
    "prm_time",
    "PRM: is its time unpredictable?",
    "The time that PRM takes is unpredictable.",
    f"Movements whose straight one is blocked, tasks of {', '.join(PRM_CELLS)} and among {MOST} zones of each type; "
    f"{PRM_DRAWS} draws of each planner per task, at most {PRM_EDGES} checks; processor time until the first "
    f"certified path. A task counts for planners that solve at least {MOSTLY:.0%} of its draws. OMPL's planners run "
    "in a process per search, all on the same kernel.",
    measure_prm,
    judge_prm,
    follows_prm,
    tables_prm,
)
EXPERIMENTS = (KPIECE, RRT, PRM)
