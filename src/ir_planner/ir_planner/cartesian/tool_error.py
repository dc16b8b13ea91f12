"""How well the tool keeps to its path: a bound of its distance from it at every instant, and its speed.

Between two instants the tool leaves the chord of its places by at most T^2 / 8 times a bound of its
acceleration, and the path leaves its own chord by at most du^2 / 8 times a bound of its second derivative.
The chords are nowhere farther apart than at their ends. So the largest distance at the instants with these
two sags is a bound of the distance at all times.
"""

from dataclasses import astuple, dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.cartesian.joint_curve import Angle, tool_poses
from ir_planner.cartesian.points import SentPath
from ir_planner.cartesian.timed import Driven
from ir_planner.cartesian.tool_path import ToolPath
from ir_planner.curves import extremes
from ir_planner.scene import PlanningScene

_BETWEEN = 2e-5  # m that the bound may add between samples
_STEP_MAX, _STEP_MIN = 0.02, 1e-4  # s
_PIECE = 20_000


@dataclass(frozen=True)
class Kept:
    """tool_error [m]: a bound; rotation_error [rad]; speed_deviation: share of the speed asked for."""

    tool_error: float
    rotation_error: float
    speed_deviation: float


def kept_of(sent: SentPath, path: ToolPath, angle: Angle | None, scene: PlanningScene) -> Kept:
    """What the trajectory that is sent keeps of the path."""
    found = [_of_stroke(sent, k, path, angle, scene) for k in range(len(sent.strokes))]
    return Kept(*(max(getattr(one, name) for one in found) for name in Kept.__dataclass_fields__))


def _of_stroke(sent: SentPath, k: int, path: ToolPath, angle: Angle | None, scene: PlanningScene) -> Kept:
    stroke, tau = sent.strokes[k], sent.instants[k]
    begin, last = sent.begins[k], sent.trajectory.duration
    accelerations = _accelerations(sent.trajectory, scene)

    def passed(at: FloatArray) -> FloatArray:
        return np.asarray(np.minimum(begin + stroke.at(at).t, last))

    points = passed(tau)
    step = np.sqrt(8.0 * _BETWEEN / np.maximum(_largest(accelerations, points, sent.trajectory), 1e-9))
    count = np.maximum(np.ceil(np.diff(points) / np.clip(step, _STEP_MIN, _STEP_MAX)), 1).astype(int)
    pieces = zip(tau[:-1], tau[1:], count, strict=True)
    fine = np.append(np.concatenate([np.linspace(a, b, n + 1)[:-1] for a, b, n in pieces]), tau[-1])
    kept = Kept(0.0, 0.0, 0.0)
    for first in range(0, len(fine) - 1, _PIECE):
        part = fine[first : first + _PIECE + 1]
        asked = stroke.at(part)
        times = np.minimum(begin + asked.t, last)
        away, turned, off = _at(sent, k, part, asked, times, path, angle, scene)
        u = path.parameter(asked.s)
        sags = np.diff(times) ** 2 * _largest(accelerations, times, sent.trajectory)
        sags += np.diff(u) ** 2 * path.bends(u)
        error = float((np.maximum(away[1:], away[:-1]) + sags / 8.0).max())
        found = (error, turned, off)
        kept = Kept(*(max(a, b) for a, b in zip(astuple(kept), found, strict=True)))
    return kept


def _at(
    sent: SentPath,
    k: int,
    tau: FloatArray,
    asked: Driven,
    times: FloatArray,
    path: ToolPath,
    angle: Angle | None,
    scene: PlanningScene,
) -> tuple[FloatArray, float, float]:
    """Distances (M,) m at instants tau (M,) s of the law of stroke k, the largest turn [rad], and the share
    by which the tool is off its speed.
    """
    motion = sent.trajectory.sample(times)
    poses, there = tool_poses(path, angle, asked.s), scene.chain.tcp_poses(motion.q)
    away = np.linalg.norm(poses[:, :3, 3] - there[:, :3, 3], axis=1)
    between = poses[:, :3, :3].transpose(0, 2, 1) @ there[:, :3, :3]
    turned = float(Rotation.from_matrix(between).magnitude().max())
    law = sent.strokes[k].law
    phase = law.phase(tau)
    even = law.even[phase] & (tau > law.times[phase]) & (tau < law.times[phase + 1])
    if not even.any():
        return away, turned, 0.0
    jacobian = scene.chain.jacobian(motion.q[even])[:, :3]
    speed = np.linalg.norm(np.einsum("mij,mj->mi", jacobian, motion.qd[even]), axis=1)
    off = np.abs(speed / law.first[phase[even]] - 1.0)
    return away, turned, float(off.max())


def _accelerations(trajectory: JointTrajectory, scene: PlanningScene) -> FloatArray:
    """Bounds (S,) [m/s^2] of |p''| of the tcp in each segment: the sum of |q''_j| r_j, and of |q'_j| |q'_k|
    times the distance r from the outer one of both axes.
    """
    largest, reach = extremes(*trajectory.coefficients()), _reach(scene)
    outer = np.minimum(reach[:, None], reach[None, :])
    turning = np.einsum("sj,jk,sk->s", largest.velocity, outer, largest.velocity)
    return np.asarray(largest.acceleration @ reach + turning)


def _largest(values: FloatArray, times: FloatArray, trajectory: JointTrajectory) -> FloatArray:
    """The largest value (M - 1,) of the segments between times (M,) s and the next, values (S,)."""
    last = len(values) - 1
    first = np.clip(np.searchsorted(trajectory.times, times[:-1], side="right") - 1, 0, last)
    second = np.clip(np.searchsorted(trajectory.times, times[1:], side="left") - 1, 0, last)
    return np.maximum(values[first], values[np.maximum(second, first)])


def _reach(scene: PlanningScene) -> FloatArray:
    """Farthest (n,) m that the tcp can be from each axis."""
    chain = scene.chain
    links = np.linalg.norm(chain.joint_origin[1:, :3, 3], axis=1)
    tail = np.append(links, np.linalg.norm(chain.tcp[:3, 3]))
    return np.asarray(np.cumsum(tail[::-1])[::-1])
