"""How much energy do optimised movements take against the common S-curve PTP (-80 to +20 % of
section V)?
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from _paper_pairs import CELL, DRAWN, S_M, Pair, pairs
from _paper_result import (
    FAILS,
    HOLDS,
    Experiment,
    Row,
    Statement,
    finished,
    interval,
    median,
    panels,
    percent,
    wilson,
)

from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, Planner
from ir_values.arrays import FloatArray

# per seed
PAIRS = 1200
QUICK_PAIRS = 24
# % of section V
LOW = -80.0
HIGH = 20.0
WITHIN = 0.95  # share of the movements that must lie within
# J of the common PTP from which on a relative change is no accident of a small reference
LARGE = 1000.0
UNCHANGED = 0.05  # % up to which the answer is taken for the PTP itself
PLANNING_S = 60.0
SAME_TIME = "same time"
LEAST_J = "free, least J"
ITSELF = f"{SAME_TIME}: the PTP itself is the answer"
SLOWED = f"the common PTP slowed down for {LEAST_J.split(', ')[1]}"
# objective, whether the duration is that of the PTP, and one of how many movements is asked
ARMS = {
    SAME_TIME: ("energy", True, 1),
    LEAST_J: ("time_and_energy", False, 1),
    "free, least time": ("time", False, 2),
    "free, least W": ("movement_cost", False, 1),
}


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per movement: the common PTP, and the planner's answers to what is asked of it."""
    planner = Planner(CELL)
    return [_row(planner, pair) for pair in pairs(planner, QUICK_PAIRS if quick else PAIRS, seed)]


def _row(planner: Planner, pair: Pair) -> Row:
    common = pair.common()
    assert common is not None
    row: Row = {"load": pair.load, "direction": pair.direction, "common_s": common.duration}
    row |= {"common_J": pair.drive_energy(common), "base_W": pair.scene.base_watts}
    slowed = pair.common(objective=ARMS[LEAST_J][0])
    if slowed is not None:
        row |= {f"{SLOWED} J": pair.drive_energy(slowed), f"{SLOWED} s": slowed.duration}
    for name, (objective, same, every) in ARMS.items():
        if pair.number // 2 % every:
            continue
        asked = PlanOptions(
            objective=objective,
            duration=common.duration if same else 0.0,
            load=pair.load,
            planning_time=PLANNING_S,
            safety_distance=S_M,
        )
        found = planner.plan_regional(
            start=pair.q0, goal=Goal(configuration=pair.q1), options=asked
        ).trajectory
        if found is not None:
            row |= {f"{name} J": pair.drive_energy(found), f"{name} s": found.duration}
    return row


def change(rows: Sequence[Row], arm: str) -> FloatArray:
    """Change of E_drive against the common PTP [%], of the movements whose reference is not
    small.
    """
    large = [row for row in rows if row["common_J"] >= LARGE and f"{arm} J" in row]
    return np.array([100.0 * (row[f"{arm} J"] / row["common_J"] - 1.0) for row in large])


def judge(rows: Sequence[Row]) -> list[Statement]:
    """The distribution for every arm."""
    found = []
    for arm in ARMS:
        x = change(rows, arm)
        inside = percent(wilson(int(((x >= LOW) & (x <= HIGH)).sum()), len(x)))
        found += [
            Statement(f"{arm}: the change lies between {LOW:g} and "
f"{HIGH:+g} %", "share of the movements",
                      *inside, len(x), "movements", "%", 100.0 * WITHIN),
            Statement(f"{arm}: savings reach {-LOW:g} %", "change, first percentile",
                      *interval(lambda x: float(np.percentile(x, 1.0)), x), len(x), "movements", "%", LOW,  # noqa: E501
                      at_least=False),
            Statement(f"{arm}: some movements take {HIGH:g} % more", "change, 99th percentile",
                      *interval(lambda x: float(np.percentile(x, 99.0)), x), len(x), "movements", "%", HIGH),  # noqa: E501
            Statement(f"{arm}: what is usual", "change, median", *interval(median, x), len(x), "movements",  # noqa: E501
                      "%"),
        ]  # fmt: skip
    x = change(rows, SLOWED)
    kept = np.abs(change(rows, SAME_TIME)) < UNCHANGED
    same = percent(wilson(int(kept.sum()), len(kept)))
    return [
        *found,
        _lowered(rows),
        Statement(ITSELF, "share of the movements", *same, len(kept), "movements", "%"),
        Statement("for comparison: "
f"{SLOWED}", "change, median", *interval(median, x), len(x), "movements",
                  "%"),
    ]  # fmt: skip


def _lowered(rows: Sequence[Row]) -> Statement:
    """Of the movements that save as much as section V says, how many lower the tool."""
    changes = [(row, change([row], SAME_TIME)) for row in rows]
    much = [row for row, found in changes if len(found) and found[0] <= LOW]
    some = percent(wilson(sum(row["direction"] == "down" for row in much), len(much)))
    says = f"{SAME_TIME}: of those that save {-LOW:g} % or more, what lowers the tool"
    return Statement(says, "share of the movements", *some, len(much), "movements", "%")


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    by = {one.says: one for one in statements}
    usual = by[f"{SAME_TIME}: what is usual"]
    most = by[f"{SAME_TIME}: savings reach {-LOW:g} %"]
    highest = by[f"{SAME_TIME}: some movements take {HIGH:g} % more"].value
    free, time = (by[f"{arm}: what is usual"].value for arm in (LEAST_J, "free, least time"))
    slowed = by[f"for comparison: {SLOWED}"].value
    inside = by[f"{SAME_TIME}: the change lies between {LOW:g} and {HIGH:+g} %"].verdict
    upper = by[f"{SAME_TIME}: some movements take {HIGH:g} % more"].verdict
    fits = {
        HOLDS: "At an equal duration the range of section V holds",
        FAILS: "At an equal duration the range of section V does not hold",
    }.get(inside, "Whether the range of section V holds at an equal duration is open")
    ends = {
        (HOLDS, HOLDS): ", and both of its ends occur",
        (HOLDS, FAILS): ", its lower end occurs, its upper one does not",
        (FAILS, HOLDS): ", its upper end occurs, its lower one does not",
        (FAILS, FAILS): ", but neither of its ends occurs",
    }.get((most.verdict, upper), "")
    return (
        f"{fits}{ends}; the median change is {usual.value:.1f} % [{usual.low:.1f}, "
        f"{usual.high:.1f}], the first percentile {most.value:.0f} %, the 99th {highest:+.1f} % "
        f"(the PTP is among the answers, and the answer itself for {by[ITSELF].value:.0f} % of "
        f"the movements). {_why(by)}Free in time the median is {free:+.1f} % for least J, where "
        f"the common PTP slowed down for the same has {slowed:+.1f} %, and {time:+.1f} % for "
        "least time: what is saved depends on the duration and the objective, so a range "
        "without both says little."
    )


def _why(by: dict[str, Statement]) -> str:
    """Where large savings come from, "" where there are none."""
    lowered = by[f"{SAME_TIME}: of those that save {-LOW:g} % or more, what lowers the tool"]
    if not lowered.count:
        return ""
    back = ", which gives energy back that the optimised time scaling keeps in the DC link"
    return (
        f"Of the {lowered.count} movements that save {-LOW:g} % or more, {lowered.value:.0f} % "
        f"lower the tool{back if lowered.low > 50.0 else ''}. "
    )


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Medians by direction and load."""
    found = []
    for load in sorted({row["load"] for row in rows}):
        for direction in ("up", "level", "down"):
            some = [row for row in rows if (row["load"], row["direction"]) == (load, direction)]
            line: Row = {"load": load, "direction": direction, "movements": len(some)}
            for arm in (*ARMS, SLOWED):
                x = change(some, arm)
                line[f"{arm} [%]"] = f"{np.median(x):+.1f}" if len(x) else ""
            found.append(line)
    return {"Median change of E_drive by load and direction": found}


def draw(rows: Sequence[Row], file: Path) -> None:
    """Distributions over all movements."""
    figure, (axes,) = panels(1, width=7.5, height=3.8)
    for arm in ARMS:
        x = np.sort(np.clip(change(rows, arm), -100.0, 100.0))
        axes.plot(x, np.arange(1, len(x) + 1) / max(len(x), 1), lw=1.6, label=arm)
    axes.axvspan(LOW, HIGH, color="0.5", alpha=0.15, label="range of section V")
    axes.set(
        xlabel="change of E_drive against the common S-curve PTP [%]",
        ylabel="share of the movements",
    )
    axes.legend(fontsize=8)
    finished(figure, file)


EXPERIMENT = Experiment(
    "savings",
    "Energy of optimised movements against the common PTP",
    "Section V: optimised trajectories take between 80 % less and 20 % more energy than the "
    "common ones.",
    f"Free straight movements in `open` ({DRAWN}). Reference: the fastest common S-curve PTP "
    "between the same configurations. Answers of the planner: of the same duration, and free in "
    "time for J, for time, and for W; beside least J the PTP, slowed down as is best for J. "
    "E_drive by the full dynamics on a shared DC link. Relative changes only where the reference "
    f"is at least {LARGE / 1e3:g} kJ.",
    measure,
    judge,
    follows,
    tables,
    draw,
    "Distribution of the change of drive energy; grey: the range of section V.",
)
