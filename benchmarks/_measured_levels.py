"""How far work repeats from recording to recording: what is left to a predictor that knows the
shape of friction from all of them, and not its level in the one that it predicts.

Per axis the torque is what the bodies ask for, an inertia and an offset, common to all recordings,
and friction (viscous, dry and with the gear's torque; or also with the logarithm of the speed)
times a factor of each recording. As the recording that is predicted has its say in all but its own
factor, no predictor with friction of this shape does better, but by luck.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ir_recorder.fit import Estimate, shaft_work
from ir_recorder.fit.channels import Motors
from ir_values.arrays import BoolArray, FloatArray

_BEND = 0.1  # rad/s: where friction by the logarithm of the speed turns
_ROUNDS = 60
_STEADY = 1e-5


@dataclass(frozen=True, eq=False)
class Repeated:
    """levels (R, n): factor of friction of each recording and axis; errors (R,): of the work of
    each with the mean factor of the others, shares.
    """

    levels: FloatArray
    errors: FloatArray


def repeated(estimate: Estimate, *, bent: bool) -> Repeated:
    """Levels and errors of the recordings of a fit by torques or currents; bent: friction grows
    with the logarithm of the speed too.
    """
    motors = estimate.motors
    assert motors is not None  # asked for
    rows = len(motors.window) // motors.n
    measured = motors.measured.reshape(motors.n, rows).T
    ends = [*(run.first for run in estimate.runs), np.iinfo(np.int64).max]
    window = motors.window[:rows]
    inside = [(window >= a) & (window < b) for a, b in pairwise(ends)]
    bodies = motors.bodies(estimate.prior.mean)
    parts = [
        _axis(
            measured[:, j],
            bodies[:, j],
            _friction(motors, bodies, estimate, j, bent=bent),
            motors.accelerations()[:, j],
            inside,
        )
        for j in range(motors.n)
    ]
    levels = np.column_stack([level for level, _, _ in parts])
    rest = np.column_stack([own for _, own, _ in parts])
    friction = np.column_stack([own for _, _, own in parts])
    errors = []
    for k, own in enumerate(inside):
        others = np.delete(levels, k, axis=0).mean(axis=0)
        predicted = rest[own] + friction[own] * others
        work = shaft_work(measured[own], motors.speed[own])
        errors.append(shaft_work(predicted, motors.speed[own]) / work - 1.0)
    return Repeated(levels, np.array(errors))


def _friction(
    motors: Motors, bodies: FloatArray, estimate: Estimate, j: int, *, bent: bool
) -> FloatArray:
    """Shapes (W, K) of an axis' friction."""
    runs = estimate.runs
    side = motors.reduced([run.prepared.turning_over(motors.travel).side for run in runs])[:, j]
    speed = motors.speed[:, j]
    shapes = [speed, side, np.abs(bodies[:, j]) * side]
    if bent:
        shapes.append(side * np.log1p(np.abs(speed) / _BEND))
    return np.column_stack(shapes)


def _axis(
    measured: FloatArray,
    bodies: FloatArray,
    friction: FloatArray,
    acceleration: FloatArray,
    inside: list[BoolArray],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Factors (R,) of the recordings with mean 1, and the torque (W,) without friction and of
    friction at factor 1, by least squares in turn.
    """
    known = np.column_stack([bodies, acceleration, np.ones(len(bodies))])
    level = np.ones(len(inside))
    for _ in range(_ROUNDS):
        factor = np.ones(len(measured))
        for own, each in zip(inside, level, strict=True):
            factor[own] = each
        columns = np.column_stack([known, friction * factor[:, None]])
        size = np.sqrt((columns**2).mean(axis=0)) + 1e-12
        found = np.linalg.lstsq(columns / size, measured, rcond=1e-6)[0] / size
        rest = known @ found[: known.shape[1]]
        lost = friction @ found[known.shape[1] :]
        new = np.array(
            [lost[own] @ (measured - rest)[own] / (lost[own] @ lost[own]) for own in inside]
        )
        new /= new.mean()
        if np.abs(new - level).max() < _STEADY:
            break
        level = new
    return level, rest, lost
