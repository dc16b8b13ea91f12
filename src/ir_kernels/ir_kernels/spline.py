"""Motions along uniform cubic B-splines: what they cost, and the descent to cheaper ones.

q(t) follows control points c_0 .. c_{K-1} with `interval` seconds between knots; three equal points at an end mean
rest there. The cost is

    energy_value E + time_value T + sum_j travel_j int |qd_j| dt + penalties

with E the drives' energy at the mains over the common DC bus. What exceeds a bound is punished by the square of its
relative excess over time: speed, torque (of its share of the envelope) at samples, acceleration at the knots, jerk
between them, position by the control points; and clearance, for every pair nearer than its threshold and
`clearance_margin`, in units of `clearance_scale`. Nothing here is a proof: see CollisionModel.certify_trajectory and
DynamicsModel.torque_bounds.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ir_kernels import compiled
from ir_kernels.collision import CollisionModel
from ir_kernels.dynamics import DynamicsModel
from ir_kernels.power import Regeneration

FloatArray = NDArray[np.float64]
RowArray = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class SplineTerms:
    """What a motion is judged by; n joints, Z pairs.

    velocity, acceleration, jerk, low, high (n,): bounds, rad and s. travel (n,): cost per rad. threshold (R, Z) m: rows
    of safety distances, each interval of a spline says which row holds. torque_share: of the envelope. energy_value:
    cost per joule; time_value: per second. capacity_energy [J] and regeneration: see DcBusParameters.
    clearance_margin, clearance_scale [m]. penalty, clearance_penalty: cost per second of a relative excess of 1.
    """

    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    low: FloatArray
    high: FloatArray
    travel: FloatArray
    threshold: FloatArray
    torque_share: float = 0.98
    energy_value: float = 1.0
    time_value: float = 500.0
    capacity_energy: float = 0.0
    regeneration: Regeneration = "shared"
    clearance_margin: float = 0.001
    clearance_scale: float = 0.01
    penalty: float = 1e4
    clearance_penalty: float = 1e4


@dataclass(frozen=True, eq=False)
class SplineValue:
    """Cost; gradient (K, n) by the control points; derivative by the interval; energy [J] at the mains of the axes."""

    value: float
    gradient: FloatArray
    of_interval: float
    energy: float


@dataclass(frozen=True, eq=False)
class SplineDescent:
    """Where a descent ended: control (K, n), interval [s], cost, and how many evaluations it took."""

    control: FloatArray
    interval: float
    value: float
    evaluations: int


class SplineCost:
    """Cost of motions of one robot with its load in one scene, and the descent on it. Immutable."""

    def __init__(self, collision: CollisionModel, dynamics: DynamicsModel, terms: SplineTerms) -> None:
        self.n = dynamics.n
        self._core: Any = compiled.MODULE.SplineCost(collision._core, dynamics._core, terms)

    def value(self, control: ArrayLike, interval: float, row: ArrayLike | None = None) -> SplineValue:
        """Cost and derivatives of a spline (K, n), K >= 4; row (K - 3,): of the thresholds, None: the first."""
        points, rows = self._checked(control, row)
        return SplineValue(*self._core.value(points, rows, float(interval)))

    def descend(
        self,
        control: ArrayLike,
        interval: float,
        row: ArrayLike | None = None,
        *,
        fixed_interval: bool = False,
        evaluations: int = 100,
        tolerance: float = 1e-4,
    ) -> SplineDescent:
        """Go down from a spline (K, n), K >= 7, at rest at both ends, which stay.

        L-BFGS with a metric in which bending counts; the interval changes too unless `fixed_interval`. Ends after
        `evaluations`, or when ten steps gain less than `tolerance` of the cost. Deterministic.
        """
        points, rows = self._checked(control, row)
        found = self._core.descend(points, rows, float(interval), fixed_interval, evaluations, tolerance)
        return SplineDescent(*found)

    def _checked(self, control: ArrayLike, row: ArrayLike | None) -> tuple[FloatArray, RowArray]:
        points = np.ascontiguousarray(control, dtype=np.float64)
        rows = np.zeros(max(len(points) - 3, 0), np.int32) if row is None else np.asarray(row, np.int32)
        return points, rows
