"""How well the tool keeps to its path: a bound of its distance from it at every instant, and its speed."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from ir_msgs_py.arrays import FloatArray
from ir_planner.cartesian.joint_curve import Angle, tool_poses
from ir_planner.cartesian.points import SentPath
from ir_planner.cartesian.tool_path import ToolPath
from ir_planner.curves import extremes
from ir_planner.scene import PlanningScene

_BETWEEN = 2e-5  # m that the bound may add between samples
_STEP_MAX, _STEP_MIN = 5e-3, 1e-4  # s
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
    seconds = stroke.duration
    bend = _largest_acceleration(sent, scene)
    step = float(np.clip(np.sqrt(8.0 * _BETWEEN / max(bend, 1e-9)), _STEP_MIN, _STEP_MAX))
    count = np.maximum(np.ceil(np.diff(tau) * seconds / (stroke.law.total * step)), 1).astype(int)
    pieces = zip(tau[:-1], tau[1:], count, strict=True)
    fine = np.append(np.concatenate([np.linspace(a, b, n + 1)[:-1] for a, b, n in pieces]), tau[-1])
    error = turn = speed_off = 0.0
    for begin in range(0, len(fine), _PIECE):
        part = fine[begin : begin + _PIECE]
        away, turned, off = _at(sent, k, part, path, angle, scene)
        error, turn, speed_off = max(error, away), max(turn, turned), max(speed_off, off)
    longest = float(np.diff(stroke.at(fine).t).max())
    return Kept(error + bend * longest**2 / 8.0, turn, speed_off)


def _at(
    sent: SentPath, k: int, tau: FloatArray, path: ToolPath, angle: Angle | None, scene: PlanningScene
) -> tuple[float, float, float]:
    stroke = sent.strokes[k]
    asked = stroke.at(tau)
    motion = sent.trajectory.sample(np.minimum(sent.begins[k] + asked.t, sent.trajectory.duration))
    poses, there = tool_poses(path, angle, asked.s), scene.chain.tcp_poses(motion.q)
    away = float(np.linalg.norm(poses[:, :3, 3] - there[:, :3, 3], axis=1).max())
    between = poses[:, :3, :3].transpose(0, 2, 1) @ there[:, :3, :3]
    turned = float(Rotation.from_matrix(between).magnitude().max())
    law = stroke.law
    phase = law.phase(tau)
    even = law.even[phase] & (tau > law.times[phase]) & (tau < law.times[phase + 1])
    if not even.any():
        return away, turned, 0.0
    jacobian = scene.chain.jacobian(motion.q[even])[:, :3]
    speed = np.linalg.norm(np.einsum("mij,mj->mi", jacobian, motion.qd[even]), axis=1)
    off = np.abs(speed / law.first[phase[even]] - 1.0)
    return away, turned, float(off.max())


def _largest_acceleration(sent: SentPath, scene: PlanningScene) -> float:
    """A bound [m/s^2] of |p''| of the tcp, twice: the path has about the same."""
    largest = extremes(*sent.trajectory.coefficients())
    reach = _reach(scene)
    speed = float(largest.velocity.max(axis=0).sum())
    turning = speed * float(largest.velocity.max(axis=0) @ reach)
    return 2.0 * (float(largest.acceleration.max(axis=0) @ reach) + turning)


def _reach(scene: PlanningScene) -> FloatArray:
    """Farthest (n,) m that the tcp can be from each axis."""
    chain = scene.chain
    links = np.linalg.norm(chain.joint_origin[1:, :3, 3], axis=1)
    tail = np.append(links, np.linalg.norm(chain.tcp[:3, 3]))
    return np.asarray(np.cumsum(tail[::-1])[::-1])
