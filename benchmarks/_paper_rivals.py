"""The paper's claims against other planners: KPIECE's cells, RRT among many zones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from _paper_peers import Question, searched
from _paper_result import (
    FAILS,
    HOLDS,
    Experiment,
    Row,
    Statement,
    finished,
    geometric_mean,
    interval,
    panels,
)
from _paper_zones import KINDS, MOST, questions

from ir_values.arrays import FloatArray

EDGES = 6000  # checks of a search, in certified edges: one that spends them counts with them
SIZES = (0, 1, 3, 10, 30, MOST)
FEW = 10  # zones up to which there are few
KPIECE_SIZES = (1, 10, 30, MOST)
# cells per type and seed of either claim, movements in each
KPIECE_PLACES = 80
PLACES = 8
TASKS = 3
# cells among MOST zones alone, and who searches there
CROWDED = 48
RIVALS = ("rrt", "genetic")
_SEEDS = 1000  # between the cells of two seeds
ONE_CELL = math.inf  # rad: a finite one, however large, parts the joints at zero
SUPERFLUOUS = 0.9  # of the checks without cells: less would be worth having them
SLOWER = 1.2  # times the checks among one zone from which on a planner has slowed down
COMPARED = ("rrt", "rrt_connect", "tree", "genetic")


def _among_zones(
    seed: int, sizes: tuple[int, ...], places: Sequence[int], *, quick: bool
) -> Iterator[tuple[Row, Question]]:
    """What rows say of a question (type and number of zones, cell, movement), and the question."""
    for kind in KINDS:
        for place in places[:1] if quick else places:
            for k, asked in enumerate(
                questions(kind, sizes, 1 if quick else TASKS, _SEEDS * seed + place)
            ):
                for size, question in asked.items():
                    yield {"kind": kind, "zones": size, "place": place, "task": k}, question


def _row(
    planner: str, question: Question, seed: int, cell: float | None = None, edges: int = EDGES
) -> Row:
    found = searched(planner, question, seed, edges, cell)
    return {
        "planner": planner,
        "solved": found.solved,
        "edges": found.edges,
        "seconds": found.seconds,
    }


def _ratios(
    rows: Sequence[Row], one: Row, other: Row, key: str = "edges"
) -> tuple[FloatArray, list[str]]:
    """Ratios of a figure between rows that differ in what the two conditions say only; and the cell
    with its
    smaller and larger versions that each comes from: cells are what is drawn independently.
    """
    named = [name for name in ("seed", "kind", "place", "zones", "task", "draw") if name not in one]

    def taken(condition: Row) -> dict[tuple[object, ...], float]:
        same = [row for row in rows if all(row[k] == v for k, v in condition.items())]
        return {tuple(row.get(name) for name in named): max(float(row[key]), 1e-4) for row in same}

    a = taken(one)
    b = taken(other)
    both = [k for k in a if k in b]
    return np.array([a[k] / b[k] for k in both]), [str(k[:3]) for k in both]


# -- KPIECE


def measure_kpiece(seed: int, quick: bool) -> list[Row]:
    """A row per search with cells of 0.3 rad, and with one cell alone."""
    rows = []
    for asked, question in _among_zones(seed, KPIECE_SIZES, range(KPIECE_PLACES), quick=quick):
        for draw in range(1 if quick else 2):
            for name, cell in (("cells", None), ("no cells", ONE_CELL)):
                rows.append(
                    asked | {"grid": name, "draw": draw} | _row("kpiece", question, draw, cell)
                )
    return rows


def judge_kpiece(rows: Sequence[Row]) -> list[Statement]:
    """Checks with cells over checks without."""
    found = []
    for name, some in (
        (f"up to {FEW} zones", [row for row in rows if row["zones"] <= FEW]),
        (f"more than {FEW} zones", [row for row in rows if row["zones"] > FEW]),
    ):
        ratio, places = _ratios(some, {"grid": "cells"}, {"grid": "no cells"})
        found.append(
            Statement(
                f"among {name} the cells save no checks worth the name",
                "checks with cells over without, geometric mean",
                *interval(geometric_mean, ratio, groups=places),
                len(ratio),
                "pairs of searches",
                bound=SUPERFLUOUS,
            )
        )
    return found


def follows_kpiece(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    few, many = statements
    tenth = 1.0 - SUPERFLUOUS
    start = {
        HOLDS: f"The paper is right: with few zones the cells save less than {tenth:.0%} of the "
        f"checks ({few.value:.2f} of those without)",
        FAILS: f"Even with few zones the cells save more than {tenth:.0%} of the checks "
        f"({few.value:.2f} of those without)",
    }.get(few.verdict, f"With few zones the ratio is {few.value:.2f}, which doesn't decide it")
    then = {HOLDS: "nor do they among more", FAILS: "among more they save more than that"}
    if few.verdict != HOLDS:
        then = {
            HOLDS: "among more they save less than that",
            FAILS: "among more they do save that much",
        }
    rest = "costs no checks" if max(few.low, many.low) <= 1.0 else "costs checks"
    return (
        f"{start}; {then.get(many.verdict, 'whether they save that among more is open')} "
        f"({many.value:.2f} "
        f"[{many.low:.2f}, {many.high:.2f}]). The grid {rest}: it stays as OMPL has it."
    )


# -- RRT


def measure_rrt(seed: int, quick: bool) -> list[Row]:
    """A row per search of each planner in every size of some cells, and of two among MOST zones of
    others.
    """
    rows: list[Row] = []
    for sizes, places, planners in (
        (SIZES, range(PLACES), COMPARED),
        ((MOST,), range(PLACES, PLACES + CROWDED), RIVALS),
    ):
        for asked, question in _among_zones(seed, sizes, places, quick=quick):
            draw = TASKS * asked["place"] + asked["task"]
            rows.extend(asked | _row(planner, question, draw) for planner in planners)
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
        says = (
            f"RRT slows down with the number of zones: {where}"
            if own
            else f"for comparison: {planner}"
        )
        figure = f"checks among {MOST} zones over checks among one, geometric mean"
        mean = interval(geometric_mean, ratio, groups=groups)
        bound = SLOWER if own else float("nan")
        found.append(Statement(says, figure, *mean, len(ratio), "movements", "", bound))
    among = [row for row in rows if row["zones"] == MOST]
    ratio, groups = _ratios(among, {"planner": "genetic"}, {"planner": "rrt"}, "seconds")
    mean = interval(geometric_mean, ratio, groups=groups)
    says = f"among {MOST} zones the genetic correction is faster than RRT"
    figure = "processor time over RRT's"
    found.append(
        Statement(
            says,
            f"{figure}, geometric mean",
            *mean,
            len(ratio),
            "movements",
            "",
            1.0,
            at_least=False,
        )
    )
    return found


def follows_rrt(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    opened, semi, closed, rrt, connect, tree, genetic, time = (one.value for one in statements)
    helps = {HOLDS: ": it is faster", FAILS: ": it is not faster"}.get(
        statements[-1].verdict, ", which decides nothing"
    )
    slows = {HOLDS: "RRT does slow down", FAILS: "RRT hardly slows down"}.get(
        statements[3].verdict, "Whether RRT slows down is open"
    )
    compared = {"RRTConnect": statements[4], "the planner's own tree": statements[5],
                "the genetic correction": statements[6]}  # fmt: skip
    too = [name for name, one in compared.items() if one.low >= SLOWER]
    others = f"{', '.join(too)} slow down too" if too else "none of the others surely slows down"
    return (
        f"{slows}: it needs {opened:.1f}, {semi:.1f} and {closed:.1f} times the checks among "
        f"{MOST} open, semi-closed and closed zones ({rrt:.1f} over all). Of the others, "
        f"RRTConnect needs {connect:.1f}, the planner's own tree {tree:.1f} and the genetic "
        f"correction {genetic:.1f} times: {others}. Those that ask for the straight movement "
        "first spend one check where it is free, as it is among few zones. Over all searches "
        f"among {MOST} zones, solved or not, the genetic correction takes {time:.2f} times the "
        f"processor time of RRT{helps}."
    )


def in_every_size(rows: Sequence[Row]) -> list[Row]:
    """Rows of the cells where every planner searched in every size: the same movements."""
    return [row for row in rows if row["place"] in range(PLACES)]


def tables_rrt(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Median processor time and the share solved, by size."""
    rows = in_every_size(rows)
    found = []
    for kind in KINDS:
        for size in SIZES:
            line: Row = {"type": kind.lower().replace("_", "-"), "zones": size}
            for planner in COMPARED:
                some = [
                    r
                    for r in rows
                    if (r["kind"], r["zones"], r["planner"]) == (kind, size, planner)
                ]
                ms = 1e3 * float(np.median([row["seconds"] for row in some]))
                line[planner] = (
                    f"{ms:.1f} ms, {100 * np.mean([row['solved'] for row in some]):.0f} %"
                )
            found.append(line)
    return {"Median processor time of a search and share solved within its checks": found}


def draw_rrt(rows: Sequence[Row], file: Path) -> None:
    """Time over the number of zones."""
    rows = in_every_size(rows)
    (figure, axes) = panels(3, width=3.6, height=3.4)
    for panel, kind in zip(axes, KINDS, strict=True):
        for planner in COMPARED:
            mine = [row for row in rows if row["kind"] == kind and row["planner"] == planner]
            times = [
                [1e3 * row["seconds"] for row in mine if row["zones"] == size] for size in SIZES
            ]
            panel.plot(
                [max(size, 0.3) for size in SIZES],
                [np.mean(t) for t in times],
                "o-",
                ms=3,
                label=planner,
            )
        panel.set(
            xscale="log",
            yscale="log",
            xlabel="zones (left: none)",
            title=kind.lower().replace("_", "-"),
        )
    axes[0].set_ylabel("processor time of a search, mean [ms]")
    axes[0].legend(fontsize=8)
    finished(figure, file)


KPIECE = Experiment(
    "kpiece_cells",
    "KPIECE: are the cells superfluous with few zones?",
    "KPIECE divides the space into cells, which are superfluous where there are few forbidden "
    "zones.",
    "OMPL's KPIECE1 among 1 to 100 zones (open, semi-closed, closed; machines of 0.3 to 0.6 m "
    "at random around the robot), with cells of 0.3 rad over the first three joints, and with "
    "one cell alone. Movements between free configurations, the same ones in every size, whose "
    f"straight movement is blocked in the largest; {KPIECE_PLACES} cells of each type and seed. "
    f"Counted: checks until the first path, at most {EDGES}. Superfluous: at least "
    f"{SUPERFLUOUS:.0%} of the checks that it takes without cells.",
    measure_kpiece,
    judge_kpiece,
    follows_kpiece,
)
RRT = Experiment(
    "rrt_zones",
    "RRT and the number of zones",
    "RRT becomes slow as the number of forbidden zones grows.",
    f"Cells and movements drawn as for KPIECE, {PLACES} cells of each type and seed among 0 to "
    f"100 zones, and for the last statement {CROWDED} further ones among {MOST}; OMPL's RRT and "
    "RRTConnect, the planner's own bidirectional tree and the genetic correction, at most "
    f"{EDGES} checks each. The clock of OMPL's planners runs from their first check to their "
    "last, without what a process and its problem take to be set up; their checks come one by "
    f"one, those of the genetic correction in batches. Slower: at least {SLOWER} times the "
    "checks among one zone.",
    measure_rrt,
    judge_rrt,
    follows_rrt,
    tables_rrt,
    draw_rrt,
    "Mean processor time of one search over the number of zones, by type; the same movements in "
    "every size.",
)
EXPERIMENTS = (KPIECE, RRT)
