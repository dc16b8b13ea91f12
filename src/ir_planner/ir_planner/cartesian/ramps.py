"""How long the tool takes from one speed to the next: as short as the limits of the axes allow."""

from collections.abc import Callable

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_planner.cartesian.driven import use_of, with_speed
from ir_planner.cartesian.joint_curve import JointCurve
from ir_planner.cartesian.speed_law import Span, ramp_places
from ir_planner.scene import MotionLimits, PlanningScene

USED = 0.97  # of a limit: the interpolant between points needs a little more than the samples
PER_RAMP = 13
ENOUGH = 1.0 + 1e-4
_RAMPS = portable.geomspace(0.01, 10.0, 13)  # s
_FINER = 8
_ZOOMS = 3


def ramps_of(
    curve: JointCurve,
    spans: tuple[Span, ...],
    limits: MotionLimits,
    scene: PlanningScene,
    *,
    slow: bool,
    used: float = USED,
) -> FloatArray:
    """The shortest ramps (K + 1,) s between the speeds at all boundaries that need no more of the
    limits than the constant speed beside them does, or `used`. slow: where that is too much, one
    that keeps them, if there is one; a path that begins near a singularity is driven slowly there.
    """
    found = [_ramp(curve, spans, k, limits, scene, slow, used) for k in range(len(spans) + 1)]
    return np.array(found)


def _ramp(
    curve: JointCurve,
    spans: tuple[Span, ...],
    k: int,
    limits: MotionLimits,
    scene: PlanningScene,
    slow: bool,
    used: float,
) -> float:
    """The ramp [s] at boundary k."""
    _, first, last = ramp_places(spans, k, _RAMPS[:1])
    if first == last:
        return 0.0

    def use(durations: FloatArray) -> tuple[FloatArray, FloatArray]:
        return _ramps_use(curve, spans, k, durations, limits, scene)

    def beside(ramp: FloatArray, cruise: FloatArray) -> BoolArray:
        return np.less_equal(ramp, np.maximum(used, cruise))

    found = _shortest(lambda durations: beside(*use(durations)))
    if slow and use(np.array([found]))[0][0] > ENOUGH:
        longer = _shortest(lambda durations: use(durations)[0] <= used)
        if use(np.array([longer]))[0][0] <= ENOUGH:
            return longer
    return found


def _shortest(fits_of: Callable[[FloatArray], BoolArray]) -> float:
    """The shortest duration [s] that fits, the longest where none does."""
    durations = _RAMPS
    for _ in range(_ZOOMS):
        fits = fits_of(durations)
        d = int(np.argmax(fits)) if fits.any() else len(fits) - 1
        low = durations[max(d - 1, 0)]
        durations, found = np.linspace(low, durations[d], _FINER), float(durations[d])
    return found


def _ramps_use(
    curve: JointCurve,
    spans: tuple[Span, ...],
    k: int,
    durations: FloatArray,
    limits: MotionLimits,
    scene: PlanningScene,
) -> tuple[FloatArray, FloatArray]:
    """What ramps of these durations (R,) s need of the limits (R,), and the constant speed there
    (R,).
    """
    begin, first, last = ramp_places(spans, k, durations)
    x = np.linspace(0.0, 1.0, PER_RAMP)
    T = durations[:, None]
    rise = last - first
    s = curve.begin + begin[:, None] + T * x * (first + rise * (x * x) * (1.0 - 0.5 * x))
    v = np.broadcast_to(first + rise * (x * x) * (3.0 - 2.0 * x), s.shape)
    a = rise / T * 6.0 * x * (1.0 - x)
    j = rise / (T * T) * (6.0 - 12.0 * x)
    none = np.zeros(s.size)
    places = s.ravel()
    even = np.full(s.size, max(first, last))
    along = curve.at(np.clip(places, curve.begin, curve.end))
    ramp = use_of(with_speed(along, none, places, v.ravel(), a.ravel(), j.ravel()), limits, scene)
    cruise = use_of(with_speed(along, none, places, even, none, none), limits, scene)
    return ramp.reshape(s.shape).max(axis=1), cruise.reshape(s.shape).max(axis=1)
