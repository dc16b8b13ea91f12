"""Inertias that Bullet can compute with: not taken for impossible by rounding, nor skewed by one bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ir_description import Load, RobotModel
from ir_msgs_py.arrays import FloatArray

_THICKNESS = 1e-6  # share of the largest principal moment; a thousand times finer than it is known
_LIGHTEST = 1e-9  # kg
ATTEMPTS = 20  # one in sixteen fails
_NUDGE = 1e-9  # relative: far below any confidence in an inertia


def solid(load: Load) -> Load:
    """The load with an inertia that Bullet does not take for impossible by rounding, and then for zero.

    A flat disc fulfils the triangle inequality of the principal moments with equality. Masses near the
    smallest number that there is become NaN in Bullet.
    """
    if load.mass < _LIGHTEST:
        load = replace(load, mass=_LIGHTEST)
    moments = np.linalg.eigvalsh(load.inertia)
    if moments[0] + moments[1] - moments[2] > _THICKNESS * moments[2]:
        return load
    return replace(load, inertia=load.inertia + np.eye(3) * (_THICKNESS * moments[2]))


def nudged(load: Load, attempt: int) -> Load:
    """The load with an inertia that differs by about _NUDGE; as it is at attempt 0."""
    return load if attempt == 0 else replace(load, inertia=_nudge(load.inertia, attempt))


def nudged_robot(robot: RobotModel, attempt: int) -> RobotModel:
    """The robot with inertias of its links that differ by about _NUDGE; as it is at attempt 0."""
    if attempt == 0:
        return robot
    inertias = [_nudge(J, attempt + ATTEMPTS * i) for i, J in enumerate(robot.link_inertia)]
    return replace(robot, link_inertia=np.array(inertias))


def _nudge(inertia: FloatArray, seed: int) -> FloatArray:
    noise = np.random.default_rng(seed).normal(size=(3, 3)) * (_NUDGE * np.abs(inertia).max())
    nudged: FloatArray = inertia + noise + noise.T
    return nudged
