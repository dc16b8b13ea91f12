"""Measured positions as a motion: smoothed with a stated bandwidth, and what its energy is then
worth.

A spline of degree five with knots at twice the bandwidth is fitted by least squares, so that speed
and acceleration are its derivatives, whatever the rows' spacing. The bandwidth is the one of
several whose energy is known best. How well is found by experiment: the smoothed motion is sampled
as the trace was, with as much noise again, and smoothed once more. What the noise adds is the
difference that it makes there; what smoothing loses is at most a few times what it loses the second
time. `benchmarks/shop_floor.py` holds the bounds against motions whose energy is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count

import numpy as np
from scipy.interpolate import make_lsq_spline

from ir_cli.errors import InputError
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.program import Progress, nobody
from ir_values.arrays import FloatArray

BANDWIDTHS = (8.0, 11.0, 16.0, 22.0)  # Hz
# Hz: below it the movement itself is smoothed away
_LOWEST = 5.0
_HIGHEST = 100.0
_DEGREE = 5
_ROWS_PER_KNOT = 2.0  # at least: fewer leave the ends of the spline to the noise
_REPEATS = 4
_EVALUATIONS = 2 + _REPEATS  # of the energy, for each bandwidth
_PHASE = "smooth"
_LOST = 4.0  # times what smoothing loses the second time
_LEAST = 0.0075  # share of an energy that positions leave open in any case
# s: rows that lie farther apart leave this share open
_COARSE = 0.02
_COARSE_SHARE = 0.025
_STILL = 0.005  # rad/s
_AT_REST = 0.02  # rad/s: a trace that ends with less ends at rest
_DIFFERENCES = np.sqrt(20.0)  # the third difference of noise is so many times larger
_ROWS_MAX = 200_000
_PERIOD_MAX = 0.1  # s between rows: the least bandwidth needs as many
_PERIOD_MIN = 1e-4  # s: no controller logs faster
Joules = Callable[[JointTrajectory], float]


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """A motion from positions alone: its bandwidth [Hz], the rate [Hz] and the noise [rad] (one
    standard deviation, worst joint) of the positions, the joules that the noise adds, and the bound
    [J] within which the energy holds. notes: what was left out of the file or assumed of it.
    """

    trajectory: JointTrajectory
    bandwidth: float
    rate: float
    noise: float
    noise_joules: float
    bound: float
    notes: tuple[str, ...] = ()

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is to be known about an energy of this motion: its worth, then the notes."""
        return (self._worth, *self.notes)

    @property
    def _worth(self) -> str:
        return (
            f"from positions alone ({self.rate:.0f} Hz, {1e3 * self.noise:.3f} mrad of noise), "
            f"smoothed at {self.bandwidth:g} Hz: the energy holds within {self.bound:.0f} J, of "
            f"which noise adds about {self.noise_joules:.0f} J"
        )


def smoothed(
    names: tuple[str, ...], time: FloatArray, positions: FloatArray, bandwidth: float
) -> JointTrajectory:
    """The motion of positions (N, n) at time (N,) [s], smoothed at `bandwidth` [Hz]: a spline by
    least squares, with two knots per period of the bandwidth and several rows per knot.
    """
    period = float(np.median(np.diff(time)))
    step = max(0.5 / bandwidth, _ROWS_PER_KNOT * period)
    wanted = round((time[-1] - time[0]) / step)
    count = max(min(wanted, len(time) - _DEGREE - 2), 1)
    knots = _supported(np.linspace(time[0], time[-1], count + 1), time)
    before = np.full(_DEGREE, time[0])
    after = np.full(_DEGREE, time[-1])
    all_knots = np.concatenate([before, knots, after])
    spline = make_lsq_spline(time, positions, all_knots, k=_DEGREE)
    q = np.asarray(spline(knots, nu=0))
    qd = np.asarray(spline(knots, nu=1))
    qdd = np.asarray(spline(knots, nu=2))
    for end in (0, -1):
        if np.abs(qd[end]).max() < _AT_REST:
            qd[end] = 0.0
            qdd[end] = 0.0
    return JointTrajectory.from_seconds(names, knots, q, qd, qdd)


def _supported(knots: FloatArray, time: FloatArray) -> FloatArray:
    """Without the knots (M,) that no row of time (N,) lies before: in gaps, where the robot stood
    still.
    """
    rows = np.searchsorted(time, knots)
    kept = np.concatenate([[True], np.diff(rows) > 0])
    kept[-1] = True
    return knots[kept]


def measured(
    names: tuple[str, ...],
    time: FloatArray,
    positions: FloatArray,
    joules: Joules,
    bandwidth: float = 0.0,
    progress: Progress = nobody,
) -> MeasuredMotion:
    """The motion of positions (N, n) at time (N,) [s] with the bandwidth [Hz] (0: the best of
    several) that leaves least open of its energy. InputError for too few or too many rows.
    """
    _check(time, bandwidth)
    tried = [bandwidth] if bandwidth > 0.0 else BANDWIDTHS
    steps = count(1)
    total = len(tried) * _EVALUATIONS
    progress(_PHASE, 0, total, 0.0)

    def shown(motion: JointTrajectory) -> float:
        found = joules(motion)
        progress(_PHASE, next(steps), total, 0.0)
        return found

    found = [_worth(names, time, positions, shown, one) for one in tried]
    return min(found, key=lambda one: one.bound)


def _check(time: FloatArray, bandwidth: float) -> None:
    """InputError for rows at time (N,) [s], or a bandwidth [Hz], that nothing can be smoothed
    with.
    """
    if not 8 <= len(time) <= _ROWS_MAX:
        raise InputError(
            f"{len(time)} rows of positions alone: 8 to {_ROWS_MAX} can be smoothed; --between "
            "takes one cycle out of a long file"
        )
    period = float(np.median(np.diff(time)))
    if period < _PERIOD_MIN:
        raise InputError(
            f"the rows are {period:.3g} s apart, no log has less than {_PERIOD_MIN:g} s: is the "
            "unit right?"
        )
    if period > _PERIOD_MAX:
        raise InputError(
            f"the rows are {period:.3g} s apart: positions alone say how the robot moved where "
            f"that is at most {_PERIOD_MAX:g} s; is the unit of time right?"
        )
    if bandwidth != 0.0 and not _LOWEST <= bandwidth <= _HIGHEST:
        raise InputError(
            f"the bandwidth is {bandwidth:g} Hz: it must be 0, or {_LOWEST:g} to {_HIGHEST:g} Hz"
        )


def _worth(
    names: tuple[str, ...],
    time: FloatArray,
    positions: FloatArray,
    joules: Joules,
    bandwidth: float,
) -> MeasuredMotion:
    """The smoothed motion of positions (N, n) at time (N,) [s], and the experiment that says what
    its energy [J] is worth: smoothed again, as it is and with noise like the measured one, it says
    how much smoothing loses and how much noise adds.
    """
    motion = smoothed(names, time, positions, bandwidth)
    seen = motion.sample(np.clip(time, motion.times[0], motion.duration)).q
    noise = _noise(time, positions, seen)
    draw = np.random.default_rng(0)
    once = joules(motion)
    again = joules(smoothed(names, time, seen, bandwidth))
    noisy = []
    for _ in range(_REPEATS):
        with_noise = seen + draw.normal(size=seen.shape) * noise
        noisy.append(joules(smoothed(names, time, with_noise, bandwidth)))
    added = max(float(np.mean(noisy)) - again, 0.0)
    period = float(np.median(np.diff(time)))
    share = _LEAST + (_COARSE_SHARE if period > _COARSE else 0.0)
    bound = added + 2.0 * float(np.std(noisy)) + _LOST * abs(again - once) + share * abs(once)
    used = min(bandwidth, 0.5 / (_ROWS_PER_KNOT * period))  # as fine as the rows allow
    return MeasuredMotion(motion, used, 1.0 / period, float(noise.max()), added, bound)


def _noise(time: FloatArray, positions: FloatArray, seen: FloatArray) -> FloatArray:
    """Standard deviation (n,) [rad]: of what smoothing removes, or at rest, whichever is larger."""
    removed = (positions - seen).std(axis=0)
    still = np.abs(np.gradient(seen, time, axis=0)).max(axis=1) < _STILL
    rough = np.diff(positions, n=3, axis=0)[still[3:] & still[:-3]]
    at_rest = rough.std(axis=0) / _DIFFERENCES if len(rough) > 3 else np.zeros_like(removed)
    return np.maximum(removed, at_rest)
