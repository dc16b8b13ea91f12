"""Movements written as a PTP_SPLINE with a TIME_BLOCK, near to what was planned."""

import numpy as np

from ir_kernels import portable
from ir_krl.write import WrittenSpline
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import RequestError
from ir_planner.krl.splines import passing_times
from ir_planner.krl.step_evaluation import ReadBack, StepEvaluator, called, points_of
from ir_planner.timing import GRID_S
from ir_values.arrays import FloatArray

# A movement becomes a PTP_SPLINE through points of its trajectory with a TIME_BLOCK that gives each
# its time. As many points are taken as the movement needs to stay certified and near to what was
# planned. They are passed at the planned times as far as the limits allow.

DEVIATION_MAX = 2e-3  # rad, of a joint from the planned movement
_SPACING = 0.2  # s between points at first
_POINTS_MIN = 6
_POINTS_MAX = 400
_SLOWINGS = 4  # per number of points
_CLOSE = 1.001
_ROUNDING = 1e-6  # grid steps
# of the planned duration and energy
_ENOUGH = 1.01
_ENOUGH_J = 1.02
_FINEST = 0.04  # s between points, where more of them no longer help
_SAMPLES_PER_S = 250


def fitted_spline(step: PlannedMovement, evaluator: StepEvaluator, back: ReadBack) -> WrittenSpline:
    """The movement through as many points as it needs, doubled from `_SPACING`, to be certified,
    near to the plan, and hardly slower or dearer. Raises RequestError.
    """
    planned = points_of(step)
    joules = evaluator(planned, step).report.energy
    count = max(int(np.ceil(planned.duration / _SPACING)), _POINTS_MIN)
    found: list[tuple[float, WrittenSpline]] = []
    reason = ""
    while count <= _POINTS_MAX:
        fits, reason = _certified_slowed(step, planned, count, evaluator, back)
        if fits is not None:
            spline, spent = fits
            longer = spline.seconds / planned.duration
            more = spent / joules
            found.append((longer + more, spline))
            if longer <= _ENOUGH and more <= _ENOUGH_J:
                return spline
        if found and count * _FINEST > planned.duration:
            break
        count *= 2
    if found:
        return min(found, key=lambda one: one[0])[1]
    raise RequestError(
        StatusCode.INVALID_MOTION_PLAN,
        f"{called(step)} can't be written with {_POINTS_MAX} points: {reason}",
    )


def _certified_slowed(
    step: PlannedMovement,
    planned: JointTrajectory,
    count: int,
    evaluator: StepEvaluator,
    back: ReadBack,
) -> tuple[tuple[WrittenSpline, float] | None, str]:
    """The movement through `count` points, slowed until it is certified, and its joules; else None,
    and the reason.
    """
    slower = 1.0
    reason = ""
    times = np.linspace(0.0, planned.duration, count + 1)
    passed = passing_times(planned.sample(times).q, times, evaluator.scene(step))
    for _ in range(_SLOWINGS):
        spline = _spline(step, planned, passed * slower)
        (again,) = back([spline])
        away = deviation_in_time(spline, again, planned)
        if away > DEVIATION_MAX:
            return (
                None,
                f"with {count} points a joint is {away:.4f} rad off; {DEVIATION_MAX:g} rad are "
                "allowed",
            )
        found = evaluator(again, step)
        if found.verification.certified:
            return (spline, found.report.energy), ""
        reason = found.verification.status.message
        needed = _needed(found.report)
        if needed <= 1.0:  # no matter of time: the path is too near to something
            break
        slower *= needed * _CLOSE
    return None, reason


def _needed(report: TrajectoryReport) -> float:
    """By how much the time has to grow for the limits of speed, acceleration, jerk and torque."""
    ratios = (
        report.velocity_ratio,
        report.acceleration_ratio,
        report.jerk_ratio,
        report.torque_ratio,
    )
    roots = (1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 2.0)
    return max(
        float(portable.power(ratio.max(initial=0.0), root))
        for ratio, root in zip(ratios, roots, strict=True)
    )


def _spline(step: PlannedMovement, planned: JointTrajectory, passed: FloatArray) -> WrittenSpline:
    """Points at equal planned times, passed at shares of the times (M + 1,) s, the last one whole
    steps of the grid after the start.
    """
    seconds = GRID_S * np.ceil(float(passed[-1]) / GRID_S - _ROUNDING)
    points = planned.sample(np.linspace(0.0, planned.duration, len(passed))[1:]).q
    return WrittenSpline(called(step), points, 100.0 * np.diff(passed) / passed[-1], float(seconds))


def deviation_in_time(
    spline: WrittenSpline, driven: JointTrajectory, planned: JointTrajectory
) -> float:
    """Largest difference of a joint [rad], each point passed when the spline passes it."""
    from scipy.interpolate import PchipInterpolator

    passed = np.concatenate([[0.0], np.cumsum(spline.shares)]) / spline.shares.sum()
    share = np.linspace(0.0, 1.0, max(round(planned.duration * _SAMPLES_PER_S), 2))
    meanwhile = np.clip(
        PchipInterpolator(np.linspace(0.0, 1.0, len(passed)), passed)(share), 0.0, 1.0
    )
    away = driven.sample(meanwhile * driven.duration).q - planned.sample(share * planned.duration).q
    return float(np.abs(away).max())
