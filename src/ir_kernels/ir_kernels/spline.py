"""Motions along uniform cubic B-splines: what they cost, and the descent to cheaper ones.

q(t) follows control points c_0 .. c_{K-1} with `interval` seconds between knots; three equal points
at an end mean rest there. The cost is

    energy_value E + time_value T + sum_j travel_j int |qd_j| dt + penalties

with E the drives' energy at the mains over the DC link. What exceeds a bound is punished by
the square of its relative excess over time: speed, torque (of its share of the envelope) at
samples, acceleration at the knots, jerk between them, position by the control points; and
clearance, for every pair nearer than its threshold and `clearance_margin`, in units of
`clearance_scale`. Near standstill friction and |qd| are smoothed, so that the cost has derivatives,
and torque is judged with all of the friction; `smoothing` rounds the switch of the DC link. Samples
lie on the knots, where torque peaks, and midway between. Nothing here is a proof: see
CollisionModel.certify_trajectory and DynamicsModel.torque_bounds.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ir_kernels import arguments, compiled, data
from ir_kernels.collision import CollisionModel, core_of
from ir_kernels.dynamics import DynamicsModel
from ir_kernels.errors import KernelError
from ir_kernels.reference.descent import descend_along, descend_profile
from ir_kernels.spline_terms import SplineTerms, checked_terms
from ir_values.arrays import FloatArray

RowArray = NDArray[np.int32]
# m, or of a unit vector: what the chains of two models of one robot may differ by
SAME_CHAIN = 1e-5
MOST_EVALUATIONS = 2**31 - 1


class SplineValue(NamedTuple):
    """Cost; gradient (K, n) by the control points; derivative by the interval; energy [J] of the
    axes at the mains.
    """

    value: float
    gradient: FloatArray
    of_interval: float
    energy: float


class SplineStarts(NamedTuple):
    """How splines are laid along paths: `spacing` s between knots where the path is at full speed,
    within `fewest` and `most` control points between the ends; `slower` by that factor, or over
    `duration` s.
    """

    spacing: float
    slower: float
    fewest: int
    most: int
    duration: float = 0.0


class CubicPath(NamedTuple):
    """p(s), s in [0, 1]: breaks (B + 1,); cubics (4, B, n), lowest power first, in s from the break
    before each.
    """

    breaks: FloatArray
    cubics: FloatArray


class ProfileDescent(NamedTuple):
    """Where a descent on a speed profile ended: s (C,) at the inner knots, duration [s], cost, and
    how many evaluations it took.
    """

    s: FloatArray
    duration: float
    value: float
    evaluations: int


class SplineDescent(NamedTuple):
    """Where a descent ended: control (K, n), interval [s], cost, and how many evaluations it
    took.
    """

    control: FloatArray
    interval: float
    value: float
    evaluations: int


class SplineCost:
    """Cost of motions of one robot with its load in one scene, and the descent on it. Immutable.

    Raises KernelError for terms that make no sense, and for a chain that isn't the one of the
    dynamics. Several threads may use one object at once; the compiled core doesn't hold up others.
    """

    def __init__(
        self,
        collision: CollisionModel,
        dynamics: DynamicsModel,
        terms: SplineTerms,
        *,
        core: compiled.Core = compiled.MODULE,
    ) -> None:
        self.n = dynamics.n
        _same_chain(collision, dynamics)
        kept = checked_terms(terms, self.n, len(collision.pairs))
        self._rows = len(kept.threshold)
        self._terms = kept
        if core is None:
            from ir_kernels.reference.spline import SplineCost as Reference

            self._core: compiled.Core = Reference(collision._geometry, dynamics.data, kept)
            return
        scene = collision._core
        drives = dynamics._core
        if not isinstance(scene, core.Model):
            scene = core_of(collision._geometry, core)
        if not isinstance(drives, core.Dynamics):
            drives = core.Dynamics(dynamics.data)
        self._core = core.SplineCost(scene, drives, kept)

    def value(
        self, control: ArrayLike, interval: float, row: ArrayLike | None = None
    ) -> SplineValue:
        """Cost and derivatives of a spline (K, n), K >= 4; row (K - 3,): of the thresholds, None:
        the first.

        Raises KernelError. Numbers so large that the cost overflows make it inf or nan.
        """
        points, rows = self._checked(control, row, 4)
        seconds = arguments.number("interval", interval, 0.0, above=True)
        return SplineValue(*self._core.value(points, rows, seconds))

    def descend(
        self,
        control: ArrayLike,
        interval: float,
        row: ArrayLike | None = None,
        *,
        fixed_interval: bool = False,
        evaluations: int = 100,
        tolerance: float = 1e-4,
        ends: ArrayLike | None = None,
    ) -> SplineDescent:
        """Descend from a spline (K, n), K >= 7, at rest at both ends, which stay: three points at
        each. ends (2, 3, n): q, qd, qdd there instead, which these points follow from.

        L-BFGS with a metric in which bending counts; the interval changes too unless
        `fixed_interval`. Ends after `evaluations`, or when ten steps gain less than `tolerance` of
        the cost; at once where the cost is not finite. Deterministic. Raises KernelError.
        """
        points, rows = self._checked(control, row, 7)
        seconds = arguments.number("interval", interval, 0.0, above=True)
        gain = arguments.number("tolerance", tolerance, 0.0)
        most = _most(evaluations)
        moving = np.zeros(0) if ends is None else data.array(ends, "ends", (2, 3, self.n))
        return SplineDescent(
            *self._core.descend(points, rows, seconds, bool(fixed_interval), most, gain, moving)
        )

    def descend_along(
        self,
        paths: Sequence[FloatArray],
        starts: SplineStarts,
        *,
        evaluations: int,
        tolerance: float = 1e-4,
    ) -> list[SplineDescent]:
        """The same from splines from rest to rest along paths (M, n), M >= 2, that go somewhere;
        with the first row of thresholds. The control points found stay within the joints' ranges.
        Raises KernelError.
        """
        checked = [data.array(path, "path", (None, self.n)) for path in paths]
        for path in checked:
            if len(path) < 2 or (path == path[0]).all():
                raise KernelError(
                    "a path has no length: expected two or more configurations that differ"
                )
        if not checked:
            return []
        settings = (
            arguments.number("starts.spacing", starts.spacing, 0.0, above=True),
            arguments.number("starts.slower", starts.slower, 0.0, above=True),
            arguments.number("starts.duration", starts.duration, 0.0),
            max(starts.fewest, 1),
            max(starts.most, starts.fewest, 1),
        )
        points = np.concatenate(checked)
        counts = np.array([len(path) for path in checked])
        most = _most(evaluations)
        gain = arguments.number("tolerance", tolerance, 0.0)
        if hasattr(self._core, "descend_along"):
            found = self._core.descend_along(points, counts, *settings, most, gain)
        else:
            found = descend_along(self._core, self._terms, points, counts, settings, most, gain)
        return [SplineDescent(*each) for each in found]

    def descend_profile(
        self,
        path: CubicPath,
        s: ArrayLike,
        duration: float,
        *,
        fixed_duration: bool = False,
        evaluations: int = 100,
        tolerance: float = 1e-5,
    ) -> ProfileDescent:
        """Descend by where a path is passed at the inner knots of a spline, s (C,), C >= 4, and by
        its duration [s]; with the first row of thresholds. L-BFGS in a metric in which the jerk of
        s counts. Raises KernelError.
        """
        breaks = data.array(path.breaks, "path.breaks", (None,))
        cubics = data.array(path.cubics, "path.cubics", (4, len(breaks) - 1, self.n))
        places = data.array(s, "s", (None,))
        if len(places) < 4:
            raise KernelError(f"s has {len(places)} places: expected at least 4")
        seconds = arguments.number("duration", duration, 0.0, above=True)
        gain = arguments.number("tolerance", tolerance, 0.0)
        most = _most(evaluations)
        given = places, seconds, bool(fixed_duration), most, gain
        if hasattr(self._core, "descend_profile"):
            return ProfileDescent(*self._core.descend_profile(breaks, cubics, *given))
        return ProfileDescent(*descend_profile(self._core, (breaks, cubics), *given))

    def _checked(
        self, control: ArrayLike, row: ArrayLike | None, fewest: int
    ) -> tuple[FloatArray, RowArray]:
        points = data.array(control, "control", (None, self.n))
        if len(points) < fewest:
            raise KernelError(
                f"control has shape {points.shape}: expected (K, {self.n}) with K >= {fewest}"
            )
        count = len(points) - 3
        if row is None:
            return points, np.zeros(count, np.int32)
        return points, data.indices(row, "row", (count,), self._rows).astype(np.int32)


def _most(evaluations: int) -> int:
    if (
        isinstance(evaluations, bool)
        or not isinstance(evaluations, int | np.integer)
        or evaluations < 1
    ):
        raise KernelError(f"evaluations is {evaluations!r}: expected a whole number of at least 1")
    return min(int(evaluations), MOST_EVALUATIONS)


def _same_chain(collision: CollisionModel, dynamics: DynamicsModel) -> None:
    """Raise KernelError unless both models are of one chain."""
    chain = collision.chain
    other = dynamics.data
    if chain.n != other.n:
        raise KernelError(
            f"collision has {chain.n} joints, dynamics {other.n}: expected models of one robot"
        )
    off = max(
        float(np.abs(chain.joint_origin - other.origin).max()),
        float(np.abs(chain.joint_axis - other.axis).max()),
    )
    if off > SAME_CHAIN:
        raise KernelError(
            f"the chains of collision and dynamics differ by {off:.2g}: expected models of one "
            "robot"
        )
