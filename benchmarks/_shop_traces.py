"""Worth of positions alone: motions of known energy, sampled with noise, and the stated bound."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from _results import Claim, at_least, at_most, line_of

from ir_cli.smoothing import measured
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.checks import movement_energy
from ir_values.arrays import FloatArray

VISIT = ("infeed_pick", "gauge_measure", "home")
REST = 0.4  # s of standstill around each movement
RATES = (250.0, 83.3, 20.0)  # Hz: RSI, a KUKA trace, a slow logger
NOISES = (0.0, 1e-5, 1e-4, 5e-4)  # rad: none, an encoder's, a coarse log's, a camera's
DIGITS = 1e-4  # deg: what logs of controllers round to


@dataclass(frozen=True)
class Row:
    """All movements at one rate and noise: errors of the energy and the bound that was stated, in
    percent; share of the movements within the bound.
    """

    rate_hz: float
    noise_rad: float
    movements: int
    error_mean: float
    error_worst: float
    bound_mean: float
    within: float


def traces() -> tuple[list[dict[str, Any]], list[Claim]]:
    """Rows of all rates and noises, and what is claimed of them."""
    planner = Planner("demo")
    plan = planner.plan_program(stations=VISIT, start=planner.cell.machine_home, savings=True)
    assert plan.common is not None
    steps = (*plan.movements, *plan.common.movements)
    motions = [_rested(step.trajectory) for step in steps if step.trajectory is not None]
    scene = planner.scene("")
    draw = np.random.default_rng(0)

    def joules(motion: JointTrajectory) -> float:
        return movement_energy(motion, scene).total

    rows = [_row(motions, rate, noise, joules, draw) for rate in RATES for noise in NOISES]
    for row in rows:
        print(line_of(asdict(row)), flush=True)
    usual = [row for row in rows if row.rate_hz > 50.0 and row.noise_rad <= NOISES[2]]
    claims = [
        at_least(
            "energies within the stated bound",
            float(np.mean([row.within for row in rows])),
            "share",
            0.9,
        ),
        at_most(
            "error of an energy, usual logs, worst", max(row.error_worst for row in usual), "%", 3.0
        ),
    ]
    return [asdict(row) for row in rows], claims


def _row(
    motions: list[JointTrajectory],
    rate: float,
    noise: float,
    joules: Any,
    draw: np.random.Generator,
) -> Row:
    errors = []
    bounds = []
    for motion in motions:
        times: FloatArray = np.arange(0.0, motion.duration, 1.0 / rate)
        q = motion.sample(times).q
        q = q + draw.normal(0.0, noise, q.shape)
        q = np.radians(np.round(np.degrees(q) / DIGITS) * DIGITS)
        found = measured(motion.joint_names, times, q, joules)
        known = joules(_until(motion, times[-1]))
        errors.append(100.0 * (joules(found.trajectory) / known - 1.0))
        bounds.append(100.0 * found.bound / known)
    within = float(np.mean(np.abs(errors) <= np.array(bounds)))
    worst = float(np.abs(errors).max())
    return Row(
        rate, noise, len(motions), float(np.mean(errors)), worst, float(np.mean(bounds)), within
    )


def _rested(motion: JointTrajectory) -> JointTrajectory:
    """With a standstill before and after it."""
    times = np.concatenate(
        [[0.0], motion.times - motion.times[0] + REST, [motion.duration + 2.0 * REST]]
    )
    q = np.vstack([motion.positions[:1], motion.positions, motion.positions[-1:]])
    still = np.zeros((1, q.shape[1]))
    speeds = [
        np.vstack([still, values, still]) for values in (motion.velocities, motion.accelerations)
    ]
    return JointTrajectory.from_seconds(motion.joint_names, times, q, *speeds)


def _until(motion: JointTrajectory, end: float) -> JointTrajectory:
    """The same up to the last row that was sampled."""
    times = np.append(motion.times[motion.times < end - 1e-6], end)
    at = motion.sample(times)
    return JointTrajectory.from_seconds(motion.joint_names, times, at.q, at.qd, at.qdd)
