"""Are BKPIECE and LBKPIECE faster than KPIECE, is SBL faster than PRM, and is KPIECE's path not the
shortest?
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from _paper_peers import searched
from _paper_prm import EDGES, MOST, blocked
from _paper_result import Experiment, Row, Statement, geometric_mean, interval, percent, share

DRAWS = 2
QUICK_DRAWS = 2
PLANNERS = ("kpiece", "bkpiece", "lbkpiece", "prm", "sbl", "rrt_connect")
RANKS = (("bkpiece", "kpiece"), ("lbkpiece", "kpiece"), ("sbl", "prm"))
PLACES = 54  # cells of each type of zones per seed
_SHIFT = 80  # of the seeds, from those of the chapter on PRM's time


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per search: task, planner and draw."""
    rows = []
    draws = QUICK_DRAWS if quick else DRAWS
    for place, label, question in blocked(seed + _SHIFT, quick, PLACES)[::3]:
        for planner in PLANNERS:
            for draw in range(draws):
                found = searched(planner, question, draw + draws * seed, EDGES)
                row: Row = {"place": f"{place} {seed}", "task": f"{label} {seed}", "draw": draw}
                row |= {"planner": planner, "solved": found.solved, "W": found.W}
                rows.append(row | {"edges": found.edges, "seconds": found.seconds})
    return rows


def _times(rows: Sequence[Row], planner: str, key: str) -> dict[str, float]:
    """The geometric mean over all draws of every task, solved or not."""
    mine: dict[str, list[float]] = {}
    for row in rows:
        if row["planner"] == planner:
            mine.setdefault(row["task"], []).append(max(float(row[key]), 1e-9))
    return {task: geometric_mean(np.array(some)) for task, some in mine.items()}


def _faster(rows: Sequence[Row], one: str, other: str, key: str) -> tuple[list[float], list[str]]:
    mine = _times(rows, one, key)
    theirs = _times(rows, other, key)
    places = {row["task"]: row["place"] for row in rows}
    return [mine[task] / theirs[task] for task in mine], [places[task] for task in mine]


def judge(rows: Sequence[Row]) -> list[Statement]:
    """Time and checks of each pair, and W of KPIECE's paths beside those of the others."""
    found = []
    for one, other in RANKS:
        for key, what, bound in (("seconds", "processor time", 1.0), ("edges", "checks", np.nan)):
            ratios, places = _faster(rows, one, other, key)
            ratio = interval(geometric_mean, ratios, groups=places)
            says = f"{one} is faster than {other}"
            figure = f"{what} of all searches over the other's, geometric mean"
            found.append(Statement(says if key == "seconds" else f"for comparison: {one} against "
                                   f"{other}, in checks", figure, *ratio, len(ratios), "tasks",
                                   bound=bound, at_least=False))  # fmt: skip
    ratios, shortest, places = _lengths(rows)
    ratio = interval(geometric_mean, ratios, groups=places)
    found.append(Statement("KPIECE's path is not the shortest",
                           "W of its path, shortened, over the least of the others', geometric "
                           "mean", *ratio, len(ratios), "searches", bound=1.0))  # fmt: skip
    mean = percent(share(shortest, places))
    says = "for comparison: KPIECE's path is the shortest of all planners'"
    found.append(Statement(says, "share of the searches", *mean, len(shortest), "searches", "%"))
    return found


def _lengths(rows: Sequence[Row]) -> tuple[list[float], list[float], list[str]]:
    """W of KPIECE's path over the least of the others' of the same task and draw, whether it is the
    least, and where.
    """
    asked: dict[tuple[str, int], dict[str, Row]] = {}
    for row in rows:
        if row["solved"]:
            asked.setdefault((row["task"], row["draw"]), {})[row["planner"]] = row
    ratios = []
    places = []
    for by_planner in asked.values():
        own = by_planner.pop("kpiece", None)
        if own is not None and by_planner:
            ratios.append(own["W"] / min(row["W"] for row in by_planner.values()))
            places.append(own["place"])
    return ratios, [float(ratio <= 1.0) for ratio in ratios], places


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    ranks = [
        f"{one} takes {statements[2 * k].value:.2f} times the time of {other} and "
        f"{statements[2 * k + 1].value:.2f} times its checks ({statements[2 * k].verdict})"
        for k, (one, other) in enumerate(RANKS)
    ]
    path, first = statements[-2:]
    return (
        f"{'; '.join(ranks)}. Times are those of searches in this arm's space with certified "
        f"motions. KPIECE's path costs {path.value:.2f} times the W of the best of the others "
        f"({path.verdict}) and is itself the best in {first.value:.0f} % of the searches, after "
        "the same shortening."
    )


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Every planner."""
    found = []
    for name in PLANNERS:
        mine = [row for row in rows if row["planner"] == name]
        line: Row = {"planner": name}
        line["solved"] = f"{100 * np.mean([row['solved'] for row in mine]):.0f} %"
        line["median ms"] = f"{1e3 * np.median([row['seconds'] for row in mine]):.1f}"
        line["mean ms"] = f"{1e3 * np.mean([row['seconds'] for row in mine]):.1f}"
        line["median checks"] = f"{np.median([row['edges'] for row in mine]):.0f}"
        found.append(line | {"mean checks": f"{np.mean([row['edges'] for row in mine]):.0f}"})
    return {"Searches alone, until the first certified path": found}


EXPERIMENT = Experiment(
    "ranks",
    "Which of the planners is faster, and whose path is shorter?",
    "The bidirectional KPIECE and its lazy variant are faster than KPIECE, SBL is faster than PRM, "
    "and the path that KPIECE finds is not the shortest.",
    f"Every third of the tasks as for PRM's time, in cells, and among {MOST} zones in {PLACES} "
    f"other places of each type and seed; {DRAWS} draws of each planner per task, at most {EDGES} "
    "checks; processor time of every search, solved or not. Lengths are W of eq. (9) of paths that "
    "were shortened alike.",
    measure,
    judge,
    follows,
    tables,
)
