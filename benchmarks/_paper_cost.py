"""How well does W of eq. (9) rank movements by joules?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from _paper_pairs import CELL, DRAWN, Pair, pairs
from _paper_result import (
    FAILS,
    HOLDS,
    Experiment,
    Row,
    Statement,
    finished,
    interval,
    panels,
    percent,
    rank_correlation,
)
from scipy.stats import kendalltau

from ir_planner import Planner
from ir_planner.scene import movement_cost
from ir_planner.scene.movement_cost import movement_weights
from ir_values.arrays import FloatArray

# per seed
PAIRS = 4000
QUICK_PAIRS = 60
# rank correlation from which on W puts about four of five random pairs in the order of joules
RANKS = 0.8
LOSES = 5.0  # % of the least joules that a choice by W may cost
DIRECTIONS = ("up", "down", "level")
EMPTY = "the load left out of (9)"
PRINTED = "(9) as printed, all joints weigh the same"
CHOICE = "a pose costs hardly more than the one of least energy"


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per movement, and one with what else reaches the same pose where anything does."""
    planner = Planner(CELL)
    rows = []
    for pair in pairs(planner, QUICK_PAIRS if quick else PAIRS, seed):
        trajectory = pair.common()
        assert trajectory is not None
        row = {"kind": "movement", **_costs(pair), "joules": pair.drive_energy(trajectory)}
        row |= {"seconds": trajectory.duration, "load": pair.load, "direction": pair.direction}
        rows.append(row | {"rise_m": pair.rise})
        rows += _choice(pair)
    return rows


def _costs(pair: Pair) -> dict[str, float]:
    """W as read, which counts the load with the last link, and its two other readings."""
    robot = pair.scene.cell.robot
    moved = np.abs(pair.q1 - pair.q0)
    empty = movement_weights(robot.link_mass, robot.velocity_max)
    found = {"W": float(movement_cost(pair.scene.weights, pair.q0, pair.q1))}
    return found | {
        EMPTY: float(moved @ empty),
        PRINTED: float(moved.sum() * pair.scene.weights[0]),
    }


def _choice(pair: Pair) -> list[Row]:
    """What the choice by W costs among the configurations at the goal's pose; none without a
    choice.
    """
    goals = pair.scene.inverse_kinematics.solve(pair.scene.chain.tcp_poses(pair.q1[None])).q
    others = [one for one in (replace(pair, q1=goal) for goal in goals) if one.straight_is_free()]
    movements = [
        (_costs(one), trajectory, one) for one in others if (trajectory := one.common()) is not None
    ]
    if len(movements) < 2:
        return []
    joules = [one.drive_energy(trajectory) for _, trajectory, one in movements]
    chosen = {
        name: joules[int(np.argmin([W[name] for W, _, _ in movements]))] for name in movements[0][0]
    }
    found = {"kind": "choice", "choices": len(joules), **chosen, "least": min(joules)}
    return [
        found | {"mean": float(np.mean(joules)), "load": pair.load, "direction": pair.direction}
    ]


def concordant(x: FloatArray, y: FloatArray) -> float:
    """Share of pairs of rows that x and y put in the same order."""
    return 0.5 + 0.5 * float(kendalltau(x, y).statistic)


def excess(chosen: FloatArray, least: FloatArray) -> float:
    """By how much the sum of what was chosen exceeds the sum of the least [%]."""
    return 100.0 * float(chosen.sum() / least.sum() - 1.0)


def judge(rows: Sequence[Row]) -> list[Statement]:
    """Rank correlation over all movements and by direction and load; what a choice by W costs."""
    moved = [row for row in rows if row["kind"] == "movement"]
    choices = [row for row in rows if row["kind"] == "choice"]
    parts = {"all movements": moved}
    parts |= {
        f"movements {name}": [r for r in moved if r["direction"] == name] for name in DIRECTIONS
    }
    parts |= {
        f"load {load}": [r for r in moved if r["load"] == load]
        for load in sorted({r["load"] for r in moved})
    }
    W, joules, seconds = (
        np.array([row[key] for row in moved]) for key in ("W", "joules", "seconds")
    )
    order = percent(interval(concordant, W, joules))
    return [
        *(_ranked(name, some) for name, some in parts.items()),
        Statement("two movements are put in the order of their "
"joules", "pairs in the same order", *order,
                  len(W), "movements", "%"),
        _chosen(f"the configuration of least W at {CHOICE}", "W", choices, LOSES),
        _chosen("for comparison: a configuration drawn at random", "mean", choices),
        Statement("for comparison: the duration of the fastest "
"PTP", "rank correlation with E_drive",
                  *interval(rank_correlation, seconds, joules), len(moved), "movements"),
        *(_ranked(f"all movements, {name}", moved, name) for name in (EMPTY, PRINTED)),
        *(_chosen(f"for comparison: the configuration of least W, {name}", name, choices)
          for name in (EMPTY, PRINTED)),
    ]  # fmt: skip


def _ranked(name: str, rows: Sequence[Row], W: str = "W") -> Statement:
    found = interval(rank_correlation, [row[W] for row in rows], [row["joules"] for row in rows])
    says = f"W ranks movements by energy: {name}"
    figure = "rank correlation of W and E_drive"
    return Statement(says, figure, *found, len(rows), "movements", bound=RANKS)


def _chosen(says: str, by: str, choices: Sequence[Row], bound: float = math.nan) -> Statement:
    found = interval(excess, [row[by] for row in choices], [row["least"] for row in choices])
    count = len(choices), "poses", "%"
    return Statement(says, "E_drive above the least", *found, *count, bound, at_least=False)


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    by = {one.says.partition(": ")[2]: one for one in statements}
    choice = next(one for one in statements if one.says.endswith(CHOICE))
    words = {HOLDS: "the ranks agree", FAILS: "they do not agree enough"}
    parts = [f"{name} {one.value:.3g} "
f"({words.get(one.verdict, 'open')})" for name, one in by.items()
             if one.bound == RANKS]  # fmt: skip
    worth = {HOLDS: "hardly more", FAILS: "more than hardly more"}.get(
        choice.verdict, "which is open"
    )
    return (
        f"Rank correlations: {', '.join(parts)}. {_load(by)}W knows neither gravity nor the "
        "counterbalance: it says the same of lifting and of lowering. Where it chooses the "
        f"configuration at a pose, the energy lies {choice.value:.1f} % above the least "
        f"({worth}: {LOSES:g} %). Here W is a first ranking; what is reported and minimised are "
        "joules of the full dynamics."
    )


def _load(by: dict[str, Statement]) -> str:
    """What becomes of the ranks over all movements where the load is left out of W, "" if not
    asked.
    """
    pooled = by["all movements"]
    empty = by.get(f"all movements, {EMPTY}")
    if empty is None:
        return ""
    apart = empty.low > pooled.high, empty.high < pooled.low
    how = "better" if apart[0] else "worse" if apart[1] else "no differently"
    return (
        "The paper's sum is over links; read here, the load counts with the last one, which "
        "adds as much to the weight of every joint. With it left out W ranks loaded and empty "
        f"movements together {how}. "
    )


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rank correlation by direction and load together."""
    moved = [row for row in rows if row["kind"] == "movement"]
    loads = sorted({row["load"] for row in moved})
    found = []
    readings = []
    for load in loads:
        line: Row = {"load": load}
        for direction in DIRECTIONS:
            some = [row for row in moved if (row["load"], row["direction"]) == (load, direction)]
            line[direction] = _shown(_ranked("", some))
        found.append(line)
    for name in ("W", EMPTY, PRINTED):
        line = {"reading": "as read" if name == "W" else name}
        for direction in DIRECTIONS:
            some = [row for row in moved if row["direction"] == direction]
            line[f"rank, {direction}"] = _shown(_ranked("", some, name))
        for load in loads:
            some, poses = ([row for row in rows if (row["kind"], row["load"]) == (kind, load)]
                           for kind in ("movement", "choice"))  # fmt: skip
            line[f"rank, {load}"] = _shown(_ranked("", some, name))
            line[f"choice, {load} [%]"] = _shown(_chosen("", name, poses))
        readings.append(line)
    ranks = "Rank correlation of W and E_drive by load and direction, 95 % intervals, movements"
    return {
        ranks: found,
        "The same for each reading of (9), and E_drive above the least where W chooses": readings,
    }


def _shown(one: Statement) -> str:
    return f"{one.value:.3g} [{one.low:.3g}, {one.high:.3g}], {one.count}"


def draw(rows: Sequence[Row], file: Path) -> None:
    """W against joules."""
    figure, (axes,) = panels(1, width=6.5)
    for name, colour in (("up", "tab:red"), ("level", "0.5"), ("down", "tab:blue")):
        some = [row for row in rows if row.get("rise_m") is not None and row["direction"] == name]
        axes.plot(
            [r["W"] for r in some],
            [r["joules"] / 1e3 for r in some],
            ".",
            ms=4,
            color=colour,
            label=name,
        )
    axes.set(
        xlabel="W of eq. (9) [kg rad²/s²·rad]", ylabel="E_drive of the fastest common PTP [kJ]"
    )
    axes.legend(title="the tool moves")
    finished(figure, file)


EXPERIMENT = Experiment(
    "w_and_joules",
    "W of eq. (9) against joules",
    "A movement is chosen by the cost W, the sum over the joints of the mass that they carry, "
    "their largest speed squared and their travel: the least W takes the least energy.",
    f"Free straight movements in the cell `open` ({DRAWN}), each as the fastest common S-curve "
    "PTP. W and drive energy (full dynamics, shared DC link) are ranked; the claim needs a rank "
    f"correlation of {RANKS} (about four of five pairs in the right order).",
    measure,
    judge,
    follows,
    tables,
    draw=draw,
    caption="W against drive energy, coloured by whether the tool rises or sinks by more than "
    "0.15 m.",
)
