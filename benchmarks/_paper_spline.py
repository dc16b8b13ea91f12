"""What does the spline of eq. (10) cost in joules against a cubic and a quintic of the same
duration?
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _paper_pairs import CELL, DRAWN, Pair, pairs
from _paper_result import (
    FAILS,
    HOLDS,
    OPEN,
    Experiment,
    Row,
    Statement,
    bars,
    finished,
    interval,
    panels,
)
from scipy.interpolate import make_interp_spline

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.curves import natural_durations, spline_through, virtual_knots
from ir_planner.scene import torque_use
from ir_values.arrays import FloatArray

# per seed
PAIRS = 250
QUICK_PAIRS = 40
SLOWER = 1.5  # times the fastest common PTP, or longer: every curve has to stay within the limits
# by which a duration grows until they do, and how often at most
STEP = 1.05
STEPS = 60
_SAMPLES = 200
# of a path with vias, as the genetic correction has; how far [rad] they lie aside
VIAS = 2
ASIDE = 0.15
SAME = 1.0
SPLINE = "spline (10)"
CUBIC = "cubic"
QUINTIC = "quintic"
COMMON = "common S-curve"


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per movement and number of vias: joules of every curve and the seconds that all of them
    take.
    """
    planner = Planner(CELL)
    rng = np.random.default_rng([seed, 10])
    rows = []
    for pair in pairs(planner, QUICK_PAIRS if quick else PAIRS, seed):
        common = pair.common()
        assert common is not None
        straight = np.stack([pair.q0, pair.q1])
        aside = rng.normal(0.0, ASIDE, (VIAS, len(pair.q0)))
        middle = np.linspace(pair.q0, pair.q1, VIAS + 2)[1:-1] + aside
        for points in (straight, np.concatenate([straight[:1], middle, straight[1:]])):
            curves = curves_within(pair, points, SLOWER * common.duration)
            if curves is None:
                continue
            vias = len(points) - 2
            seconds = curves[SPLINE].duration
            if not vias and (slower := pair.common(seconds)) is not None:
                curves[COMMON] = slower
            rows.append(_row(pair, vias, curves) | {"seconds": seconds})
    return rows


CURVES = (SPLINE, CUBIC, QUINTIC)


def curve(pair: Pair, points: FloatArray, duration: float, name: str) -> JointTrajectory:
    """A curve through points (M, n): all of them at the same times. The cubic is at rest at both
    ends and accelerates there at once; the other two begin and end without acceleration.
    """
    steps = np.maximum(natural_durations(points, pair.scene.cell.robot.velocity_max), 1e-3)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    times = at * duration / at[-1]
    names = pair.scene.cell.robot.joint_names
    rest = np.zeros(points.shape[1])
    if name == SPLINE:
        found = spline_through(points, times, virtual_knots(times))
        return JointTrajectory.from_seconds(
            names, found.times, found.positions, found.velocities, found.accelerations
        )
    ends: Any = [(1, rest)] if name == CUBIC else [(1, rest), (2, rest)]
    spline = make_interp_spline(times, points, k=3 if name == CUBIC else 5, bc_type=(ends, ends))
    return JointTrajectory.from_seconds(names, times, *(spline(times, order) for order in range(3)))


def curves_within(
    pair: Pair, points: FloatArray, shortest: float
) -> dict[str, JointTrajectory] | None:
    """All curves through points (M, n) in the same seconds: in `shortest` or, by steps, in the
    first longer duration in which each stays within the limits; None where the arm can't be held
    there.
    """
    for k in range(STEPS):
        curves = {name: curve(pair, points, shortest * STEP**k, name) for name in CURVES}
        if all(_within(pair, each) for each in curves.values()):
            return curves
    return None


def _within(pair: Pair, trajectory: JointTrajectory) -> bool:
    """Whether samples keep the limits of speed, acceleration and of the torque that plans may
    use.
    """
    motion = trajectory.sample(np.linspace(0.0, trajectory.duration, _SAMPLES))
    limits = pair.scene.limits
    use = torque_use(pair.scene.dynamics, motion.q, motion.qd, motion.qdd)
    moves = (np.abs(motion.qd) <= limits.velocity) & (np.abs(motion.qdd) <= limits.acceleration)
    return bool((moves & (use <= limits.torque_share)).all())


def _row(pair: Pair, vias: int, curves: dict[str, JointTrajectory]) -> Row:
    row: Row = {"vias": vias, "load": pair.load, "direction": pair.direction}
    return row | {name: pair.drive_energy(trajectory) for name, trajectory in curves.items()}


def over(one: FloatArray, other: FloatArray) -> float:
    """Joules of all movements together over those of the other curve."""
    return float(one.sum() / other.sum())


def judge(rows: Sequence[Row]) -> list[Statement]:
    """Joules of the spline over those of the others."""
    found = []
    for vias in (0, VIAS):
        some = [row for row in rows if row["vias"] == vias]
        for name in (CUBIC, QUINTIC, COMMON):
            both = [(row[SPLINE], row[name]) for row in some if name in row]
            if not both:
                continue
            ratio = interval(over, *np.array(both).T)
            where = f"through {vias} vias" if vias else "between two points"
            says = f"{where} the spline costs no more than the {name}"
            figure = f"E_drive of the spline over that of the {name}"
            found.append(
                Statement(says, figure, *ratio, len(both), "movements", "", SAME, at_least=False)
            )
    return found


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    by = {one.says: one.value for one in statements}
    cubic = by["between two points the spline costs no more than the cubic"]
    quintic = by["between two points the spline costs no more than the quintic"]
    cubic_vias, quintic_vias = (by[f"through {VIAS} vias the spline costs no more than the {name}"]
                                for name in (CUBIC, QUINTIC))  # fmt: skip
    return (
        f"Between two points the spline takes {100 * (quintic - 1):+.1f} % joules against the "
        f"quintic and {100 * (cubic - 1):+.1f} % against the cubic; through {VIAS} vias "
        f"{100 * (quintic_vias - 1):+.1f} % and {100 * (cubic_vias - 1):+.1f} %. "
        f"{_cheaper(statements)} The cubic accelerates at once, with a jump of torque at either "
        "end, the others do not. Eq. (10) is kept as a curve; the planner optimises path and "
        "time scaling for joules."
    )


def _cheaper(statements: Sequence[Statement]) -> str:
    """Which curves it costs more than, which not, and what is open."""
    parts = []
    for verdict, words in (
        (FAILS, "It costs more than"),
        (HOLDS, "It costs no more than"),
        (OPEN, "Open:"),
    ):
        some = [
            one.says.split(" the spline costs no more than ")
            for one in statements
            if one.verdict == verdict
        ]
        if some:
            parts.append(f"{words} {'; '.join(f'{curve} {where}' for where, curve in some)}.")
    return " ".join(parts)


def draw(rows: Sequence[Row], file: Path) -> None:
    """Ratios as bars."""
    figure, (axes,) = panels(1, width=7.0, height=2.8)
    values: dict[str, tuple[float, float, float]] = {}
    for one in judge(rows):
        shown = one.says.replace(" the spline costs no more than", ":")
        low, high = (100.0 * (x - 1.0) for x in (one.low, one.high))
        values[shown] = 100.0 * (one.value - 1.0), low, high
    bars(axes, values, color="tab:blue", alpha=0.7)
    axes.axvline(0.0, color="0.3", lw=1.0)
    axes.set_xlabel("extra E_drive of the spline (10) at the same duration [%]")
    finished(figure, file)


EXPERIMENT = Experiment(
    "spline",
    "The spline of eq. (10) against cubic and quintic",
    "Trajectories are composed of five cubic segments per joint with continuous speed and "
    "acceleration, "
    "which begin and end at rest without acceleration, as the smooth curve of low degree.",
    f"Random free movements in `open` ({DRAWN}): straight ones, and ones through {VIAS} vias "
    f"{ASIDE} rad aside (then eq. (10) has its five cubics). All curves pass the same points at "
    f"the same times: in {SLOWER} times the duration of the fastest common PTP, or longer by "
    f"steps of {100 * (STEP - 1):.0f} % until each of them keeps the limits of speed, "
    "acceleration and torque (of jerk none: the cubic starts with a jump of acceleration).",
    measure,
    judge,
    follows,
    draw=draw,
    caption="Drive energy of the spline relative to the other curves, 95 % intervals.",
)
