"""Movements along a path of the tool, written as SPLINE blocks."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ir_kernels import portable
from ir_krl.write import WrittenPath
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import RequestError
from ir_planner.krl.geometry import Arm, tool_in_flange
from ir_planner.krl.step_evaluation import ReadBack
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

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
) -> list[WrittenPath]:
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
    q = planned.sample(times).q
    poses = portable.matmul(Arm(scene).flange(q), tool_in_flange(scene.cell.tcp))
    acceleration = float(np.abs(np.gradient(stroke.speed, stroke.times)).max())
    comment = f"along {step.to_station}: {along[-1]:.3f} m at {stroke.top:.3g} m/s"
    rails = q[:, : scene.cell.robot.base]
    return WrittenPath(comment, poses, stroke.top, acceleration * share, rails)


def _objection(
    driven: list[JointTrajectory],
    planned: JointTrajectory,
    strokes: list[_Stroke],
    scene: PlanningScene,
) -> tuple[str, bool]:
    """Why what is driven isn't the planned path at its speed ("": it is), and whether a lower
    acceleration may help.
    """
    from scipy.spatial import cKDTree

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
    from scipy.spatial import cKDTree

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
