"""Points that a uniform spline passes exactly: the correction of its control points of least
jerk.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import UniformSpline

_KNOT = 0.02  # intervals: what is nearer to a knot is passed there
_PER_POINT = 2.0  # control points that each point must have to itself
_LITTLE = 1e-9  # weight of the size of a correction beside its jerk
_STEPS = 3  # of Newton's towards the nearest place


@dataclass(frozen=True, eq=False)
class Passing:
    """points (P, n) are passed `at` (P,), in knots from the beginning; none where they were too
    dense.
    """

    at: FloatArray
    points: FloatArray

    @staticmethod
    def nothing(points: FloatArray) -> "Passing":
        """No point needs to be passed."""
        return Passing(np.zeros(0), points[:0])

    @staticmethod
    def of(spline: UniformSpline, near: FloatArray, points: FloatArray) -> "Passing":
        """Where a spline comes nearest to the inner points of `points` (M, n); near (M - 2,): about
        there.
        """
        inner = points[1:-1]
        if len(inner) == 0 or len(spline.control) - 6 < _PER_POINT * len(inner):
            return Passing.nothing(points)
        at = np.clip(near, 1.0, spline.intervals - 1.0)
        for _ in range(_STEPS):
            q, slope = _values(spline.control, at)
            speed = np.maximum((slope * slope).sum(axis=1), 1e-12)
            step = ((inner - q) * slope).sum(axis=1) / speed
            at = np.clip(at + np.clip(step, -0.5, 0.5), 1.0, spline.intervals - 1.0)
        whole = np.rint(at)
        at = np.where(np.abs(at - whole) < _KNOT, whole, at)
        if np.diff(at).min(initial=1.0) < _KNOT:
            return Passing.nothing(points)
        return Passing(at, inner)

    def corrected(self, spline: UniformSpline) -> UniformSpline:
        """The spline through the points; its ends stay."""
        if len(self.at) == 0:
            return spline
        count = len(spline.control)
        rows = _basis(self.at, count)[:, 3:-3]
        root = (cholesky_banded(jerk_bands(count, 1.0, _LITTLE)[:, 3:-3]), False)
        spread = cho_solve_banded(root, rows.T)
        missing = self.points - _values(spline.control, self.at)[0]
        control = spline.control.copy()
        control[3:-3] += spread @ np.linalg.lstsq(rows @ spread, missing, rcond=None)[0]
        return UniformSpline(control, spline.interval)

    def sent(
        self, spline: UniformSpline, joint_names: tuple[str, ...]
    ) -> tuple[JointTrajectory, UniformSpline]:
        """The motion with a point wherever one is passed beside a knot, and its spline: corrected
        for the nanoseconds that these times have.
        """
        step = int(np.ceil(spline.interval * 1e9 - 1e-3))
        times = np.rint(self.at * step).astype(np.int64)
        exact = Passing(times / step, self.points).corrected(
            UniformSpline(spline.control, step * 1e-9)
        )
        q, qd, qdd = exact.knots()
        knots = np.arange(len(q), dtype=np.int64) * step
        between = times[times % step != 0]
        k = between // step
        after = ((between % step) * 1e-9)[:, None]
        jerk = (qdd[k + 1] - qdd[k]) / exact.interval
        more = (
            q[k] + after * (qd[k] + after * (qdd[k] / 2.0 + after * jerk / 6.0)),
            qd[k] + after * (qdd[k] + after * jerk / 2.0),
            qdd[k] + after * jerk,
        )
        order = np.argsort(np.concatenate([knots, between]), kind="stable")
        values = (np.concatenate(pair)[order] for pair in zip((q, qd, qdd), more, strict=True))
        return JointTrajectory(joint_names, np.concatenate([knots, between])[order], *values), exact


def _basis(at: FloatArray, count: int) -> FloatArray:
    """Weights (P, count) of the control points where `at` (P,) knots have gone by."""
    k = np.clip(np.floor(at).astype(int), 0, count - 4)
    u = at - k
    weights = (1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3
    rows = np.zeros((len(at), count))
    for i, weight in enumerate(weights):
        rows[np.arange(len(at)), k + i] = weight / 6.0
    return rows


def _values(control: FloatArray, at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Positions (P, n), and slopes per knot."""
    k = np.clip(np.floor(at).astype(int), 0, len(control) - 4)
    u = (at - k)[:, None]
    c = [control[k + i] for i in range(4)]
    slope = (
        -((1 - u) ** 2) * c[0]
        + (3 * u**2 - 4 * u) * c[1]
        + (-3 * u**2 + 2 * u + 1) * c[2]
        + u**2 * c[3]
    ) / 2.0
    return _basis(at, len(control)) @ control, slope


def jerk_bands(count: int, weight: float, size: float) -> FloatArray:
    """size + weight D' D with the third differences D of `count` values, (4, count) in banded form,
    upper.
    """
    third = np.array([-1.0, 3.0, -3.0, 1.0])
    bands = np.zeros((4, count))
    for i in range(4):
        for j in range(i, 4):
            bands[3 - (j - i), j : count - 3 + j] += weight * third[i] * third[j]
    bands[3] += size
    return bands
