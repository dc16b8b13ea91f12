"""A stroke as slow as the axes need, wherever that is: where no speed has to be kept.

The slowness over the instants of the law is a spline whose control values lie evenly in the time
that the motion takes, not in that of the law: beside a singularity axes turn by half a turn within
hundredths of a millimetre, and what passes there in a microsecond at the speed asked for is given
the seconds that it takes.
"""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ir_kernels import portable
from ir_planner.cartesian.joint_curve import JointCurve
from ir_planner.cartesian.path_times import TimedStroke, fitting, instants, refused
from ir_planner.cartesian.speed_ramps import ENOUGH, StrokeSpan, law_of, use_of
from ir_planner.scene import MotionLimits, PlanningScene
from ir_values.arrays import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

_DEGREE = 4  # jerk is continuous
_SPACING_S = 0.02  # s of the motion between control values
_FEWEST = 40
_MOST = 4000
_CHANGE = 0.5  # of the rate at which the limits let a speed change, and at most
_FASTEST = 20.0  # 1/s
_FITS = 12  # of control values to the time that the motion takes
_ROUNDS = 8  # of more time with the same ones
_AROUND = 3  # control values that get more time together
_MORE = 1.003
_PER_PIECE = 3  # samples of a piece of the curve, and of one of the slowness


def looked_at(made: TimedStroke) -> FloatArray:
    """Instants (M,) s of the law so dense that no piece of the curve of the axes lies between."""
    tau = instants(made.law)
    s = made.curve.begin + made.law.at(tau)[0]
    knots = made.curve.knots
    inner = (
        knots[:-1, None] + np.arange(_PER_PIECE) / _PER_PIECE * np.diff(knots)[:, None]
    ).ravel()
    rising = np.concatenate([[True], np.diff(np.maximum.accumulate(s)) > 0.0])
    return np.unique(np.concatenate([tau, np.interp(inner, s[rising], tau[rising])]))


def unhurried(
    curve: JointCurve, spans: tuple[StrokeSpan, ...], limits: MotionLimits, scene: PlanningScene
) -> TimedStroke:
    """The stroke from rest to rest, slower than asked for wherever the axes need it. Raises
    PathRefusedError.
    """
    spans, ramps = fitting(curve, spans, 1.0, limits, scene)
    made = TimedStroke(curve, law_of(spans, ramps))
    tau = looked_at(made)
    need = use_of(made.at(tau), limits, scene)
    return made if need.max() <= ENOUGH else _stroke_with_time(made, tau, need, limits, scene)


def slower_between(
    made: TimedStroke,
    points: FloatArray,
    use: FloatArray,
    limits: MotionLimits,
    scene: PlanningScene,
) -> TimedStroke:
    """The stroke with more time between its points at instants (P,) s of the law, where what is
    sent uses more than the limits (P - 1,). Raises PathRefusedError.
    """
    tau = looked_at(made)
    owner = np.clip(np.searchsorted(points, tau, side="right") - 1, 0, len(use) - 1)
    need = np.maximum(_MORE * use[owner], 1.0)
    if made.slowness is not None:
        need = need * np.asarray(made.slowness(tau))
    return _stroke_with_time(made, tau, need, limits, scene)


def _stroke_with_time(
    made: TimedStroke,
    tau: FloatArray,
    need: FloatArray,
    limits: MotionLimits,
    scene: PlanningScene,
) -> TimedStroke:
    """The stroke with so much more time that it keeps the limits at all samples, from a need (M,)
    of it at instants tau (M,) s of the law.
    """
    speeds = np.abs(replace(made, slowness=None).at(tau).qd)
    for _ in range(_FITS):
        need = _changing(tau, np.maximum(need, 1.0), speeds, limits)
        knots, control = _spline_of(tau, need)
        asked = np.union1d(tau, _instants_within(knots))
        for _ in range(_ROUNDS):
            slowness = _slowness(knots, control)
            slowed = replace(made, slowness=slowness)
            motion = slowed.at(asked)
            use = use_of(motion, limits, scene)
            if use.max() <= ENOUGH:
                return slowed
            control = control * _more_time(knots, asked, use)
        need = np.asarray(slowness(tau)) * np.maximum(np.interp(tau, asked, use), 1.0)
    raise refused(motion, limits, scene, 1.0)


def _changing(
    tau: FloatArray, need: FloatArray, speeds: FloatArray, limits: MotionLimits
) -> FloatArray:
    """The need (M,) raised so that its logarithm changes in the time that it makes no faster than a
    share of the limits lets axes change their speeds, `speeds` (M, n) rad/s of the law.
    """
    for _ in range(4):
        level = portable.log(need)
        axes = np.maximum(speeds / need[:, None], 1e-9)
        rates = np.minimum(limits.acceleration / axes, np.sqrt(limits.jerk / axes))
        changed = _times(tau, need * np.minimum(_CHANGE * rates.min(axis=1), _FASTEST))
        ahead = np.maximum.accumulate(level + changed) - changed
        back = np.maximum.accumulate((level - changed)[::-1])[::-1] + changed
        need = portable.exp(np.maximum(ahead, back))
    return np.asarray(need)


def _times(tau: FloatArray, slowness: FloatArray) -> FloatArray:
    """Seconds (M,) at instants tau (M,) s of the law."""
    steps = 0.5 * (slowness[1:] + slowness[:-1]) * np.diff(tau)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _spline_of(tau: FloatArray, need: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Knots and control values of a slowness that is nowhere below the need (M,)."""
    t = _times(tau, need)
    count = int(np.clip(t[-1] / _SPACING_S, _FEWEST, _MOST))
    inner = np.interp(np.linspace(0.0, t[-1], count + 1), t, tau)
    knots = np.concatenate([[inner[0]] * _DEGREE, inner, [inner[-1]] * _DEGREE])
    control = np.ones(count + _DEGREE)
    for k, (first, last) in enumerate(_supports(knots)):
        a, b = np.searchsorted(tau, (first, last))
        control[k] = need[max(a - 1, 0) : b + 1].max()
    return knots, control


def _supports(knots: FloatArray) -> FloatArray:
    """Where each control value counts (C, 2) s."""
    count = len(knots) - _DEGREE - 1
    return np.column_stack([knots[:count], knots[_DEGREE + 1 :]])


def _slowness(knots: FloatArray, control: FloatArray) -> "BSpline":
    from scipy.interpolate import BSpline

    return BSpline(knots, control, _DEGREE)


def _instants_within(knots: FloatArray) -> FloatArray:
    """Instants (M,) s within the pieces of the slowness."""
    inner = np.unique(knots)
    share = np.arange(_PER_PIECE) / _PER_PIECE
    return np.append((inner[:-1, None] + share * np.diff(inner)[:, None]).ravel(), inner[-1])


def _more_time(knots: FloatArray, tau: FloatArray, use: FloatArray) -> FloatArray:
    """By what each control value (C,) has to grow where the use (M,) at tau (M,) s is above 1."""
    from scipy.ndimage import convolve1d, maximum_filter1d

    inner = np.unique(knots)
    piece = np.clip(np.searchsorted(inner, tau, side="right") - 1, 0, len(inner) - 2)
    worst = np.ones(len(inner) - 1)
    np.maximum.at(worst, piece, use)
    count = len(knots) - _DEGREE - 1
    at = np.clip(np.arange(count) - _DEGREE // 2, 0, len(worst) - 1)
    over = np.maximum(_MORE * worst[at] - 1.0, 0.0)
    apart = np.arange(-_AROUND, _AROUND + 1) / (_AROUND + 1)
    window = (1.0 - apart * apart) * (1.0 - apart * apart)
    widest = maximum_filter1d(over, 2 * _AROUND + 1)
    return np.asarray(1.0 + convolve1d(widest, window / window.sum(), mode="nearest"))
