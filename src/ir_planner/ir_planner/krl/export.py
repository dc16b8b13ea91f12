"""Programs and trajectories written as KRL, read back, driven by the controller's model and proved
again.

A movement becomes a PTP_SPLINE through points of its trajectory with a TIME_BLOCK that gives each
its time. As many points are taken as the movement needs to stay certified and near to what was
planned. They are passed at the planned times as far as the limits allow.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator

from ir_description import Cell
from ir_kernels import portable
from ir_krl import (
    Attached,
    Part,
    WrittenPause,
    WrittenSignals,
    WrittenSpline,
    check_name,
    follow,
    parse,
    written,
)
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import total_report
from ir_planner.errors import RequestError
from ir_planner.krl.driven import DrivenStep, drive
from ir_planner.krl.export_path import deviation_along, fitted_path, one_after_the_other
from ir_planner.krl.geometry import tool_in_flange
from ir_planner.krl.judged import Judge
from ir_planner.krl.passing import passing_times
from ir_planner.program import Charge, Pause
from ir_planner.scene import STILL, PlanningScene
from ir_planner.timing import GRID_S

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
_ASKS = {"BUS_POWER_OFF": "AB", "HIBERNATION": "HIB", "STAND_ON_BRAKES": ""}


@dataclass(frozen=True, eq=False)
class KrlExport:
    """Texts of the program; the largest deviation [rad] of a joint from the plan, and the reports
    of what was planned and of what the controller drives.
    """

    source: str
    data: str
    deviation: float
    planned: TrajectoryReport
    exported: TrajectoryReport


def export(
    steps: Sequence[PlannedMovement], name: str, scene: PlanningScene, judge: Judge, charge: Charge
) -> KrlExport:
    """Write steps (movements with their points, and pauses) as program `name`; charge: of the
    capacitor, as the program begins.

    Raises RequestError where a movement can't be written so that it stays certified, KrlError for
    the name.
    """
    moving = [step for step in steps if not step.is_pause]
    if not moving:
        raise RequestError(StatusCode.INVALID_MOTION_PLAN, "the program has no movement to export")
    check_name(name)
    fitted = {id(step): _written_as(step, scene, judge) for step in moving}
    parts = [part for step in steps for part in _parts(step, fitted)]
    start = _points_of(moving[0]).positions[0]
    header = [f"{scene.cell.name}: {len(moving)} movements, points and times as planned"]
    from_home = bool(np.abs(start - scene.cell.machine_home).max() < STILL)
    source, data = written(name, start, parts, attached(scene), header, from_home=from_home)
    driven = (step.trajectory for step in _driven(source, data, scene) if step.moves)
    after = []
    deviation = 0.0
    here = start
    for step in steps:
        if step.is_pause:
            charge.stood(step, Pause(step.to_station, step.duration, "", here, judge.scene(step)))
            continue
        again = one_after_the_other(list(itertools.islice(driven, len(fitted[id(step)]))))
        found = judge(again, step)
        if not found.verification.certified:
            raise RequestError(
                StatusCode.INVALID_MOTION_PLAN,
                f"{_called(step)} isn't certified as the controller would drive it: "
                f"{found.verification.status.message}",
            )
        deviation = max(deviation, _deviation_of(step, fitted[id(step)], again))
        moved = charge.moved(
            replace(step, trajectory=again, report=found.report), found.energy, judge.scene(step)
        )
        after.append(moved.report)
        here = again.positions[-1]
    return KrlExport(
        source, data, deviation, _together([one.report for one in moving]), _together(after)
    )


def attached(scene: PlanningScene) -> Attached:
    """Tool and load of the scene as TOOL_DATA and LOAD_DATA give them, in KUKA's flange."""
    cell: Cell = scene.cell
    tool = cell.tool
    if tool is None:
        return Attached(tool_in_flange(cell.tcp), 0.0, np.zeros(3), np.zeros(3))
    turn = tool_in_flange(np.eye(4))[:3, :3]
    inertia = portable.matmul(turn, tool.inertia, turn.T)
    return Attached(
        tool_in_flange(cell.tcp),
        tool.mass,
        portable.matmul(turn, tool.com),
        np.diag(inertia).copy(),
    )


def _written_as(step: PlannedMovement, scene: PlanningScene, judge: Judge) -> list[Part]:
    """The motions of a movement: a SPLINE for each stroke along a path, else one PTP_SPLINE."""
    if step.kind != MovementKind.CARTESIAN:
        return [_fitted(step, scene, judge)]
    planned = _points_of(step)

    def back(parts: list[Part]) -> list[JointTrajectory]:
        source, data = written("M", planned.positions[0], parts, attached(scene), [])
        return [step.trajectory for step in _driven(source, data, scene)]

    return fitted_path(step, planned, scene, back)


def _deviation_of(step: PlannedMovement, parts: Sequence[Part], again: JointTrajectory) -> float:
    planned = _points_of(step)
    if isinstance(parts[0], WrittenSpline):
        return _deviation(parts[0], again, planned)
    return deviation_along(again, planned)


def _fitted(step: PlannedMovement, scene: PlanningScene, judge: Judge) -> WrittenSpline:
    """The movement through as many points as it needs, doubled from `_SPACING`, to be certified,
    near to the plan, and hardly slower or dearer.
    """
    planned = _points_of(step)
    joules = judge(planned, step).report.energy
    count = max(int(np.ceil(planned.duration / _SPACING)), _POINTS_MIN)
    found: list[tuple[float, WrittenSpline]] = []
    reason = ""
    while count <= _POINTS_MAX:
        fits, reason = _slowed(step, planned, count, scene, judge)
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
        f"{_called(step)} can't be written with {_POINTS_MAX} points: {reason}",
    )


def _slowed(
    step: PlannedMovement, planned: JointTrajectory, count: int, scene: PlanningScene, judge: Judge
) -> tuple[tuple[WrittenSpline, float] | None, str]:
    """The movement through `count` points, slowed until it is certified, and its joules; else None,
    and the reason.
    """
    slower = 1.0
    reason = ""
    times = np.linspace(0.0, planned.duration, count + 1)
    passed = passing_times(planned.sample(times).q, times, judge.scene(step))
    for _ in range(_SLOWINGS):
        spline = _spline(step, planned, passed * slower)
        again = _read_back(spline, planned.positions[0], scene)
        away = _deviation(spline, again, planned)
        if away > DEVIATION_MAX:
            return (
                None,
                f"with {count} points a joint is {away:.4f} rad off; {DEVIATION_MAX:g} rad are "
                "allowed",
            )
        found = judge(again, step)
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
    report = step.report
    comment = (
        f"{_called(step)}: {seconds:.2f} s, planned {report.duration:.2f} s and "
        f"{report.energy:.0f} J"
    )
    if np.isfinite(report.min_clearance):
        comment += f", clearance {1e3 * report.min_clearance:.0f} mm"
    points = planned.sample(np.linspace(0.0, planned.duration, len(passed))[1:]).q
    return WrittenSpline(comment, points, 100.0 * np.diff(passed) / passed[-1], float(seconds))


def _read_back(spline: WrittenSpline, start: FloatArray, scene: PlanningScene) -> JointTrajectory:
    """The movement alone, as the controller's model drives it."""
    source, data = written("M", start, [spline], attached(scene), [])
    (step,) = _driven(source, data, scene)
    return step.trajectory


def _parts(step: PlannedMovement, fitted: dict[int, list[Part]]) -> list[Part]:
    parts: list[Part] = [WrittenSignals(wait_for=_signals(step.wait_for))] if step.wait_for else []
    if step.is_pause:
        mode = step.power_mode or "STAND_ON_MOTORS"
        parts.append(
            WrittenPause(f"pause {step.duration:g} s: {mode}", step.duration, _ASKS.get(mode, ""))
        )
    else:
        parts.extend(fitted[id(step)])
    if step.set_signals:
        parts.append(WrittenSignals(set_signals=_signals(step.set_signals)))
    return parts


def _signals(texts: Sequence[str]) -> tuple[tuple[str, bool], ...]:
    split = (text.partition("=") for text in texts)
    return tuple((name, value != "0") for name, _, value in split)


def _driven(source: str, data: str, scene: PlanningScene) -> tuple[DrivenStep, ...]:
    home = scene.cell.machine_home
    program = follow(
        [parse(source, "export.src"), parse(data, "export.dat")],
        home,
        tool_in_flange(scene.cell.tcp),
    )
    return drive(program, scene, home)[0]


def _deviation(spline: WrittenSpline, driven: JointTrajectory, planned: JointTrajectory) -> float:
    """Largest difference of a joint [rad], each point passed when the spline passes it."""
    passed = np.concatenate([[0.0], np.cumsum(spline.shares)]) / spline.shares.sum()
    share = np.linspace(0.0, 1.0, max(round(planned.duration * _SAMPLES_PER_S), 2))
    meanwhile = np.clip(
        PchipInterpolator(np.linspace(0.0, 1.0, len(passed)), passed)(share), 0.0, 1.0
    )
    away = driven.sample(meanwhile * driven.duration).q - planned.sample(share * planned.duration).q
    return float(np.abs(away).max())


def _points_of(step: PlannedMovement) -> JointTrajectory:
    if step.trajectory is None:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN, f"{_called(step)} has no points: get them by its id"
        )
    return step.trajectory


def _called(step: PlannedMovement) -> str:
    return f"{step.from_station or 'start'} -> {step.to_station or 'goal'}"


def _together(reports: Sequence[TrajectoryReport]) -> TrajectoryReport:
    elapsed = np.cumsum([0.0, *(report.duration for report in reports)])[:-1]
    return total_report(tuple(reports), tuple(elapsed.tolist()))
