"""Export of programs as KRL: written, read back, executed and certified again."""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial import cKDTree

from ir_description import Cell, PowerData, ProgramStep, Signal, cell_in
from ir_kernels import portable
from ir_krl import (
    Attached,
    Part,
    WrittenPath,
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
from ir_planner.checks import Evaluation, evaluate_trajectory, total_report
from ir_planner.errors import RequestError
from ir_planner.krl.execution import DrivenStep, drive
from ir_planner.krl.geometry import Arm, tool_in_flange
from ir_planner.krl.splines import passing_times
from ir_planner.program import Charge, Pause, doors_along
from ir_planner.scene import STILL, Drives, PlanningScene, with_parts
from ir_planner.timing import GRID_S

# Steps of a planned program, each judged as it was planned: with its load, its parts where they
# lie, doors as its signals move them, sweeping while they do, and what its station allows.


@dataclass(frozen=True, eq=False)
class Judge:
    """Evaluates trajectories as the steps that they belong to: with their load, their parts, their
    station.

    scenes: of each step by its id(); margin: S_m [m].
    """

    scenes: Mapping[int, PlanningScene]
    margin: float

    def __call__(self, trajectory: JointTrajectory, step: PlannedMovement) -> Evaluation:
        """What a trajectory makes of a step."""
        return evaluate_trajectory(trajectory, self.scene(step), self.margin, contacts_at(step))

    def scene(self, step: PlannedMovement) -> PlanningScene:
        """In which a step is driven."""
        return self.scenes[id(step)]


def judge_of(
    steps: Sequence[PlannedMovement], cell: Cell, power: PowerData, drives: Drives, margin: float
) -> Judge:
    """A judge of these steps, S_m `margin` m."""
    found = zip(steps, scenes_of(steps, cell, power, drives), strict=True)
    return Judge({id(step): scene for step, scene in found}, margin)


def contacts_at(step: PlannedMovement) -> str:
    """The station or path whose allowed contacts hold in a step, "" for none."""
    at = {
        MovementKind.SERVICE_EXIT: step.from_station,
        MovementKind.SERVICE_ENTRY: step.to_station,
        MovementKind.CARTESIAN: step.to_station,
    }
    return at.get(MovementKind(step.kind), "")


def scenes_of(
    steps: Sequence[PlannedMovement], cell: Cell, power: PowerData, drives: Drives
) -> list[PlanningScene]:
    """The scene of each step: what is held, where the parts lie, how the doors stand or sweep."""
    scenes = []
    places = cell.parts_at_start()
    doors = [dict(before) for before, _ in doors_along(cell, [_signalling(step) for step in steps])]
    for step, moved in zip(steps, doors, strict=True):
        standing = cell_in(with_parts(cell, places), moved)
        for (
            text
        ) in step.states:  # of machines that no signal moves: those that the step was planned with
            machine, _, state = text.partition("=")
            if machine not in moved:
                standing = standing.with_equipment(machine, state=state)
        scenes.append(PlanningScene(standing, cell.loads(places.held), power, drives))
        if step.attach or step.detach:
            places = places.after(
                ProgramStep("STATION", step.to_station, attach=step.attach, detach=step.detach)
            )
    return scenes


def _signalling(step: PlannedMovement) -> ProgramStep:
    """What a step waits for and sets, and how long it dwells."""
    return ProgramStep(
        "POSTURE",
        "home",
        dwell=step.duration if step.is_pause else 0.0,
        wait_for=tuple(_signal(text) for text in step.wait_for),
        set_signals=tuple(_signal(text) for text in step.set_signals),
    )


def _signal(text: str) -> Signal:
    name, _, value = text.partition("=")
    return Signal(name, value != "0")


# A movement along a path of the tool as KRL: one SPLINE of the tool from rest to rest, at its
# speed.
#
# Points lie on the planned path at equal distances. They are doubled until the path that the
# controller's model drives through them keeps to the planned one, and the tool's acceleration is
# lowered until the axes follow without losing the tool's speed.

TOOL_MAX = 1e-4  # m, of the tool from the planned path
JOINT_MAX = 2e-3  # rad, of a joint from the planned path
SPEED_MAX = 0.01  # share of the tool's speed
# m between points at first, how many at least and at most
_SPACING = 0.04
_FEWEST = 6
_MOST = 2000
_DENSE = 2e-5  # m between the places of the planned path that others are held against
_FINER = (1, 2, 4, 8, 16)
_ACCELERATIONS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15)  # shares of the planned one
_EVEN = 0.97  # of its speed that the tool keeps between its ramps
# shares of its speed and of its largest acceleration
_RAMP = 0.05
_LEVEL = 0.02
_RATE = 500.0  # Hz

ReadBack = Callable[[list[Part]], list[JointTrajectory]]
"""The movements of parts as the controller's model drives them, one for each."""


@dataclass(frozen=True, eq=False)
class _Stroke:
    """Part of the movement from rest to rest: times (M,) s, the tcp's places (M, 3) m, its speed
    (M,) m/s.
    """

    times: FloatArray
    places: FloatArray
    speed: FloatArray

    @property
    def along(self) -> FloatArray:
        """Arc lengths (M,) m."""
        steps = np.linalg.norm(np.diff(self.places, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def top(self) -> float:
        """The tool's speed [m/s]."""
        return float(self.speed.max())


def fitted_path(
    step: PlannedMovement, planned: JointTrajectory, scene: PlanningScene, back: ReadBack
) -> list[Part]:
    """A SPLINE for each stroke of a movement along a path. Raises RequestError where none keeps to
    it.
    """
    strokes = list(_strokes(planned, scene))
    for stroke in strokes:
        _check_even(step, stroke)
    reason = ""
    for finer in _FINER:
        for share in _ACCELERATIONS:
            written = [_written(step, one, planned, scene, finer, share) for one in strokes]
            if max(len(part.poses) for part in written) > _MOST:
                break
            reason, too_fast = _objection(back(list(written)), planned, strokes, scene)
            if not reason:
                return list(written)
            if not too_fast:
                break
    raise RequestError(
        StatusCode.INVALID_MOTION_PLAN, f"along {step.to_station}: no SPLINE keeps to it: {reason}"
    )


def _strokes(planned: JointTrajectory, scene: PlanningScene) -> Iterator[_Stroke]:
    assert planned.velocities is not None  # as every planned movement has
    rests = planned.times[~planned.velocities.any(axis=1)]
    for begin, end in itertools.pairwise(rests):
        count = max(int(np.ceil((end - begin) * _RATE)), 2) + 1
        times = np.linspace(begin, end, count)
        motion = planned.sample(times)
        jacobian = scene.chain.jacobian(motion.q)[:, :3]
        speed = np.linalg.norm(np.einsum("mij,mj->mi", jacobian, motion.qd), axis=1)
        yield _Stroke(times, scene.chain.tcp_poses(motion.q)[:, :3, 3], speed)


def _check_even(step: PlannedMovement, stroke: _Stroke) -> None:
    share = stroke.speed / stroke.top
    gain = np.abs(np.gradient(stroke.speed, stroke.times))
    lost = (share > _RAMP) & (share < _EVEN)
    level = lost & (gain < _LEVEL * gain.max())  # a ramp is level at its ends only
    reached = np.flatnonzero(share >= 1.0 - SPEED_MAX)
    if level.any() or share[reached[0] : reached[-1] + 1].min() < _EVEN:
        raise RequestError(
            StatusCode.INVALID_MOTION_PLAN,
            f"along {step.to_station}: the tool's speed changes along the path; a SPLINE is "
            "written with one",
        )


def _written(
    step: PlannedMovement,
    stroke: _Stroke,
    planned: JointTrajectory,
    scene: PlanningScene,
    finer: int,
    share: float,
) -> WrittenPath:
    along = stroke.along
    count = max(int(np.ceil(along[-1] / _SPACING)), _FEWEST) * finer
    times = np.interp(np.linspace(0.0, along[-1], count + 1)[1:], along, stroke.times)
    times[-1] = stroke.times[-1]
    poses = portable.matmul(
        Arm(scene).flange(planned.sample(times).q), tool_in_flange(scene.cell.tcp)
    )
    acceleration = float(np.abs(np.gradient(stroke.speed, stroke.times)).max())
    comment = f"along {step.to_station}: {along[-1]:.3f} m at {stroke.top:.3g} m/s"
    return WrittenPath(comment, poses, stroke.top, acceleration * share)


def _objection(
    driven: list[JointTrajectory],
    planned: JointTrajectory,
    strokes: list[_Stroke],
    scene: PlanningScene,
) -> tuple[str, bool]:
    """Why what is driven isn't the planned path at its speed ("": it is), and whether a lower
    acceleration may help.
    """
    for one, stroke in zip(driven, strokes, strict=True):
        (again,) = _strokes(one, scene)
        share = again.top / stroke.top
        if abs(share - 1.0) > SPEED_MAX:
            return f"the tool's speed is {share:.3f} times what it should be", share < 1.0
        along = stroke.along
        times = np.interp(np.arange(0.0, along[-1] + _DENSE, _DENSE), along, stroke.times)
        dense = planned.sample(times).q
        found = cKDTree(scene.chain.tcp_poses(dense)[:, :3, 3]).query(again.places)
        away = float(np.max(found[0]))
        nearest = np.asarray(found[1])
        if away > TOOL_MAX:
            return f"the tool is {1e3 * away:.3g} mm off, {1e3 * TOOL_MAX:g} mm are allowed", False
        joints = float(np.abs(one.sample(again.times).q - dense[nearest]).max())
        if joints > JOINT_MAX:
            return f"a joint is {joints:.4f} rad off, {JOINT_MAX:g} rad are allowed", False
    return "", False


def deviation_along(driven: JointTrajectory, planned: JointTrajectory) -> float:
    """Largest difference of a joint [rad] from the nearest configuration of the planned
    movement.
    """
    dense = planned.sample(
        np.linspace(0.0, planned.duration, max(int(planned.duration * _RATE), 2) * 4)
    ).q
    at = driven.sample(np.linspace(0.0, driven.duration, max(int(driven.duration * _RATE), 2))).q
    nearest = cKDTree(dense).query(at)[1]
    return float(np.abs(at - dense[nearest]).max())


def one_after_the_other(parts: list[JointTrajectory]) -> JointTrajectory:
    """Movements that each begin where the one before ends, at rest, as one."""
    first = parts[0]
    begins = np.cumsum([0, *(int(part.times_ns[-1]) for part in parts[:-1])])
    times = [part.times_ns[1:] + begin for part, begin in zip(parts, begins, strict=True)]

    def column(name: str) -> FloatArray:
        rows = [getattr(part, name) for part in parts]
        return np.concatenate([rows[0][:1], *(row[1:] for row in rows)])

    return JointTrajectory(
        first.joint_names,
        np.concatenate([first.times_ns[:1], *times]),
        column("positions"),
        column("velocities"),
        column("accelerations"),
    )


# Programs and trajectories written as KRL, read back, driven by the controller's model and proved
# again.
#
# A movement becomes a PTP_SPLINE through points of its trajectory with a TIME_BLOCK that gives each
# its time. As many points are taken as the movement needs to stay certified and near to what was
# planned. They are passed at the planned times as far as the limits allow.

DEVIATION_MAX = 2e-3  # rad, of a joint from the planned movement
_SPACING_EXPORT = 0.2  # s between points at first
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
    count = max(int(np.ceil(planned.duration / _SPACING_EXPORT)), _POINTS_MIN)
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
