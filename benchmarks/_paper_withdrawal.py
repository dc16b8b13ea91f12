"""How surely does the withdrawal of eq. (7) leave a machine, and which of its parts does it
need?
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from _paper_result import (
    FAILS,
    HOLDS,
    Experiment,
    Row,
    Statement,
    geometric_mean,
    interval,
    mean_difference,
    percent,
    share,
)
from _paper_stations import MARGIN, Place, cells_of, difference, of_reading, places

from ir_msgs_py.options import PlanOptions
from ir_planner.request import Context, Work
from ir_planner.scene import path_cost
from ir_planner.search import fewest_corners
from ir_planner.service.exit import Exit
from ir_planner.service.exit_paths import ExitTree
from ir_planner.service.stochastic_withdrawal import ModifiedGa, withdraw
from ir_values.arrays import FloatArray

CELLS = ("cnc_door", "deep_box", "demo")
# of each cell and seed; searches per station and reading
VARIANTS = 136
DRAWS = 1
QUICK_DRAWS = 1
# certified edges of a search, and its ceiling
EDGES = 8_000
SECONDS = 20.0
SURE = 95.0  # % of the searches
POINTS = 2.0  # percentage points of searches from which on a difference is worth having
SOONER = 0.9  # of the time
NO_DRIFT = 0.001  # m: the least first step, so that the mean hardly moves the tool
# m, m, rad: a line, its points, and their steps in a branch
FARTHEST = 2.0
SPACING = 0.03
JUMP = 0.35


@dataclass(frozen=True)
class Reading:
    """Settings of the walk, or another search in its place; line: straight back along the tool's
    axis.
    """

    changed: dict[str, Any]
    tree: bool = False
    line: bool = False


DEFAULT = "as read"
PRINTED = "as printed"
TREES = "two trees instead"
LINE = "a straight line instead"
READINGS = {
    DEFAULT: Reading({}),
    "inverse weights": Reading({"weighting": "inverse"}),
    "no drift": Reading({"step": NO_DRIFT}),
    PRINTED: Reading({"reading": "printed"}),
    "inverse weights, no drift": Reading({"weighting": "inverse", "step": NO_DRIFT}),
    "inverse weights, as printed": Reading({"weighting": "inverse", "reading": "printed"}),
    TREES: Reading({}, tree=True),
    LINE: Reading({}, line=True),
}


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per search: station, reading, whether it left, processor time, edges and W of the
    path.
    """
    rows = []
    for number, place in enumerate(
        places(CELLS[:1] if quick else CELLS, seed, 1 if quick else VARIANTS)
    ):
        _searched(
            place, READINGS[DEFAULT], 1000 * seed
        )  # the place's models are there before any clock starts
        for name in in_turn(list(READINGS), number):
            for draw in range(QUICK_DRAWS if quick else DRAWS):
                row = place.words | {"reading": name, "draw": draw}
                rows.append(row | _searched(place, READINGS[name], 1000 * seed + draw))
    return rows


def in_turn(names: Sequence[str], number: int) -> list[str]:
    """The names from another one on at every place: none of them is always the first to be
    timed.
    """
    first = number % len(names)
    return [*names[first:], *names[:first]]


def _searched(place: Place, reading: Reading, seed: int) -> Row:
    options = PlanOptions(seed=seed, safety_distance=place.margin, planning_time=SECONDS)
    work = Work(EDGES, time.process_time() + SECONDS, time.process_time)
    problem = Exit.of(place.q[0], Context.of(place.scene, options, work, place.station.name))
    settings = ModifiedGa(**reading.changed)
    sequence = np.random.SeedSequence(seed)
    begin = time.process_time()
    if reading.line:
        paths = straight_out(problem)
    elif reading.tree:
        paths = ExitTree().find(problem, 1, sequence, work).paths
    else:
        paths = withdraw(problem, settings, np.random.default_rng(sequence), 1).paths
    seconds = time.process_time() - begin
    row: Row = {
        "solved": bool(paths),
        "seconds": seconds,
        "edges": work.iterations,
        "W": float("nan"),
    }
    if paths:
        free = problem.inside.of(
            place.scene, place.margin, Work(10**6, np.inf, time.monotonic), place.station.name
        )
        row["W"] = path_cost(
            place.scene.weights, fewest_corners(paths[0], free, place.scene.weights, 11)
        )
    return row


def straight_out(problem: Exit) -> list[FloatArray]:
    """The path (M, n) straight back along the tool's axis to where it is out, if it is free."""
    back = np.arange(0.0, FARTHEST, SPACING)
    poses = np.repeat(np.asarray(problem.area.station.pose)[None], len(back), axis=0)
    poses[:, :3, 3] -= back[:, None] * poses[0, :3, 0]
    found = problem.inside.scene.inverse_kinematics.solve(poses)
    path = [problem.interaction]
    for k in range(1, len(back)):
        jump = np.abs(found.of_pose(k) - path[-1]).max(axis=1)
        if jump.min(initial=np.inf) > JUMP:
            return []
        path.append(found.of_pose(k)[int(np.argmin(jump))])
        if problem.is_out(path[-1][None])[0]:
            return [np.array(path)] if problem.inside.paths_free([np.array(path)])[0] else []
    return []


def _success(rows: Sequence[Row], zones: str, kinds: tuple[str, ...]) -> Statement:
    some = [row for row in rows if row["reading"] == DEFAULT and row["zone"] in kinds]
    cells = [(row["seed"], row["cell"]) for row in some]
    solved = percent(share([row["solved"] for row in some], cells))
    says = f"eq. (7) leaves {zones} zones"
    what = f"searches in {len(set(cells))} cells"
    return Statement(says, "searches that leave the zone", *solved, len(some), what, "%", SURE)


def _more(rows: Sequence[Row], says: str, one: str, other: str) -> Statement:
    some, keys = difference(rows, one, other, lambda row: row["solved"])
    cells = cells_of(keys)
    figure = f"searches that leave, {one} less {other}"
    what = f"searches in {len(set(cells))} cells"
    return Statement(says, figure, *mean_difference(some, cells), len(some), what, "points", POINTS)


def judge(rows: Sequence[Row]) -> list[Statement]:
    """Success by type of zone, what each part adds, and trees instead."""
    types = (("open", ("OPEN",)), ("semi-closed", ("SEMI_CLOSED",)), ("closed", ("CLOSED",)))
    found = [_success(rows, name, kinds) for name, kinds in types]
    for says, one, other in (
        (
            "weights proportional to the mass do better than inverse ones",
            DEFAULT,
            "inverse weights",
        ),
        ("the drift of the mean is needed", DEFAULT, "no drift"),
        (
            "the drift is needed with inverse weights",
            "inverse weights",
            "inverse weights, no drift",
        ),
        ("eq. (7) as read does better than as printed", DEFAULT, PRINTED),
        ("eq. (7) leaves more often than two trees", DEFAULT, TREES),
    ):
        found.append(_more(rows, says, one, other))
    over = "processor time over that of the other, geometric mean"
    for says, other, figure, key, bound in (
        (
            "weights proportional to the mass are sooner out",
            "inverse weights",
            over,
            "seconds",
            SOONER,
        ),
        ("the drift is sooner out", "no drift", over, "seconds", SOONER),
        ("eq. (7) as read is sooner out than as printed", PRINTED, over, "seconds", SOONER),
        ("eq. (7) is sooner out than two trees", TREES, over, "seconds", SOONER),
        (
            "its path costs less W than that of two trees",
            TREES,
            "W when shortened over the other's",
            "W",
            1.0,
        ),
    ):
        a = of_reading(rows, DEFAULT)
        b = of_reading(rows, other)
        both = [k for k in a if a[k]["solved"] and b[k]["solved"] and b[k][key] > 0.0]
        ratios = [a[k][key] / b[k][key] for k in both]
        ratio = interval(geometric_mean, ratios, groups=cells_of(both))
        found.append(
            Statement(says, figure, *ratio, len(both), "searches", "", bound, at_least=False)
        )
    return [*found, _more(rows, "eq. (7) leaves more often than a straight line", DEFAULT, LINE)]


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    opened, semi, closed, weights, drift, _, printed, trees, *soon, cost, line = statements
    by_weights, by_drift, by_mean, by_trees = (one.value for one in soon)
    cheaper = {
        HOLDS: "its paths cost less than those of trees",
        FAILS: "its paths cost no less than trees'",
    }
    faster = {HOLDS: "it is sooner out", FAILS: "it is not sooner out"}
    price = cheaper.get(cost.verdict, "what its paths cost against trees' is open")
    speed = faster.get(soon[-1].verdict, "whether it is sooner out is open")
    return (
        f"The withdrawal alone leaves {opened.value:.0f} % of the open, {semi.value:.0f} % of "
        f"the semi-closed and {closed.value:.0f} % of the closed zones. Weights in proportion to "
        f"the mass change that by {weights.value:+.1f} points against inverse ones and take "
        f"{by_weights:.2f} times their processor time; the drift {drift.value:+.1f} points and "
        f"{by_drift:.2f} times the time without; as read against as printed "
        f"{printed.value:+.1f} points and {by_mean:.2f} times the time. Against two trees: "
        f"{trees.value:+.1f} points, {by_trees:.2f} times the time, {cost.value:.2f} times the W: "
        f"{price}, and {speed}. Against the straight line: {line.value:+.1f} points. Where every "
        "search leaves, success can't set readings apart, but their times can. The planner asks "
        "(7) first, and trees where it finds nothing."
    )


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Success of every reading by type of zone."""
    found = []
    for name in READINGS:
        line: Row = {"reading": name}
        for zone in ("OPEN", "SEMI_CLOSED", "CLOSED"):
            some = [r for r in rows if r["reading"] == name and r["zone"] == zone]
            share = (
                f"{100 * np.mean([r['solved'] for r in some]):.0f} % of {len(some)}" if some else ""
            )
            line[zone.lower().replace("_", "-")] = share
        mine = [row for row in rows if row["reading"] == name]
        line["median ms"] = f"{1e3 * np.median([row['seconds'] for row in mine]):.1f}"
        found.append(
            line
            | {"95th percentile ms": f"{1e3 * np.percentile([r['seconds'] for r in mine], 95):.0f}"}
        )
    return {"Searches that leave the zone, and their processor time": found}


EXPERIMENT = Experiment(
    "withdrawal",
    "Withdrawal by eq. (7), the modified GA",
    "From the goal configuration a population of perturbed copies, W_i n_i with n_i ~ N(mu_i, "
    "sigma), weighted by the mass from the tool to the joint and ranked by the total metric "
    "distance D, leads out of semi-closed and closed zones.",
    f"Stations of {', '.join(CELLS)} and of {2 * VARIANTS - 1} mirrored, turned and jittered "
    f"variants of each, nothing held, from their cheapest free configuration, {DRAWS} per "
    f"station, at most {EDGES} certified steps. Readings: weights proportional to the mass (as "
    "printed) or inverse; the mean with its drift outwards, without (a first step of "
    f"{1e3 * NO_DRIFT:g} mm, and momentum to match); all of (7) as printed (W_i n_i, n_i ~ N(mu, "
    f"sigma), mu proportional to D and equal for all joints: {ModifiedGa().step:g} rad at the "
    "first D, for the paper has no number; after a collision mean q_i and sigma 1 rad); as rivals "
    "two bidirectional trees, and a straight line back along the tool's "
    f"axis. Left: outside the zone and free without allowed contacts. {MARGIN}",
    measure,
    judge,
    follows,
    tables,
)
