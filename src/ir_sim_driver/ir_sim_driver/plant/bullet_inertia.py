"""Inertias that Bullet can compute with: not taken for impossible by rounding, nor skewed by one bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ir_description import Load

_THICKNESS = 1e-6  # share of the largest principal moment; a thousand times finer than it is known
ATTEMPTS = 20  # one in sixteen fails
_NUDGE = 1e-9  # relative: far below any confidence in an inertia


def solid(load: Load) -> Load:
    """The load with an inertia that Bullet does not take for impossible by rounding, and then for zero.

    A flat disc fulfils the triangle inequality of the principal moments with equality.
    """
    moments = np.linalg.eigvalsh(load.inertia)
    if moments[0] + moments[1] - moments[2] > _THICKNESS * moments[2]:
        return load
    return replace(load, inertia=load.inertia + np.eye(3) * (_THICKNESS * moments[2]))


def nudged(load: Load, attempt: int) -> Load:
    """The load with an inertia that differs by about _NUDGE; as it is at attempt 0."""
    noise = np.random.default_rng(attempt).normal(size=(3, 3)) * (_NUDGE * np.abs(load.inertia).max())
    return load if attempt == 0 else replace(load, inertia=load.inertia + noise + noise.T)
