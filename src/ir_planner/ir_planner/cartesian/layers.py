"""Configurations along a path: at samples of it, for angles about the tool's axis, all of them."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import BoolArray, FloatArray, IntArray
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.orientations import about_tool
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.tool_path import ToolPath
from ir_planner.checks import FreeSpace, pair_value

SPACING = 0.01  # m between samples of the path
SPACING_TURN = np.radians(2.0)  # of the tool between them
ANGLE_STEP = np.radians(15.0)  # of the free angle
_SPACING_FREE = 0.02  # m, where the angle is free
_NODES_MAX = 400_000
_FEWEST = 8


@dataclass(frozen=True, eq=False)
class Layers:
    """s (N,): samples; q (M, n), layer (M,), angle (M,) rad: configurations within the limits; free
    (M,). turning (n,): axes whose whole turns are left out.
    """

    s: FloatArray
    q: FloatArray
    layer: IntArray
    angle: FloatArray
    free: BoolArray
    turning: BoolArray


def samples(path: ToolPath, spacing: float) -> FloatArray:
    """Arc lengths (N,) of samples of a path, closer where the tool turns and in rounded corners."""
    breaks = path.breaks
    rough = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in itertools.pairwise(breaks)]))
    rotations = path.poses(rough)[:, :3, :3]
    turned = np.einsum("mji,mjk->mik", rotations[:-1], rotations[1:])
    turns = portable.arccos(np.clip(0.5 * (np.trace(turned, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
    steps = np.ceil(np.maximum(np.diff(rough) / spacing, turns / SPACING_TURN) - 1e-9).astype(int)
    steps = np.maximum(steps, 1)
    parts = [
        np.linspace(a, b, k + 1)[:-1] for a, b, k in zip(rough[:-1], rough[1:], steps, strict=True)
    ]
    return np.append(np.concatenate(parts), rough[-1])


def angles_of(free_angle: float) -> FloatArray:
    """Angles (A,) rad that are looked at; pi: the whole circle."""
    if free_angle == 0.0:
        return np.zeros(1)
    if free_angle >= np.pi - 1e-6:
        return np.arange(-np.pi, np.pi - 1e-9, ANGLE_STEP)
    count = int(np.ceil(free_angle / ANGLE_STEP))
    return np.linspace(-free_angle, free_angle, 2 * count + 1)


def layers_of(
    path: ToolPath, free_angle: float, space: FreeSpace, start: FloatArray | None
) -> Layers:
    """All configurations along a path, but for whole turns. start (n,): the only one at its
    beginning. Raises PathRefusedError where the path leaves the reach or every configuration
    collides.
    """
    angles = angles_of(free_angle)
    s = samples(path, SPACING if len(angles) == 1 else _SPACING_FREE)
    if len(s) * len(angles) * _FEWEST > _NODES_MAX:
        raise PathRefusedError(
            f"the path has {len(s)} samples of {len(angles)} angles: it must be at most "
            f"{_NODES_MAX // _FEWEST} poses in all; divide the path"
        )
    result = configurations_at(path, s, free_angle, space, space.scene.turning)
    if start is not None:
        result = _begun(result, path, free_angle, space, start)
    _check_reached(result, space)
    return result


def configurations_at(
    path: ToolPath, s: FloatArray, free_angle: float, space: FreeSpace, turning: BoolArray
) -> Layers:
    """All configurations at arc lengths s (N,) m of a path, but for whole turns of the axes
    `turning` (n,): all that turn twice, or none.
    """
    angles = angles_of(free_angle)
    poses = np.repeat(path.poses(s), len(angles), axis=0)
    poses[:, :3, :3] = portable.matmul(poses[:, :3, :3], about_tool(np.tile(angles, len(s))))
    scene = space.scene
    found = (scene.inverse_kinematics_once if turning.any() else scene.inverse_kinematics).solve(
        poses
    )
    layer = found.pose_index // len(angles)
    angle = angles[found.pose_index % len(angles)]
    return Layers(s, found.q, layer, angle, space.states_free(found.q), turning)


def _begun(
    layers: Layers, path: ToolPath, free_angle: float, space: FreeSpace, start: FloatArray
) -> Layers:
    """The layers with one configuration in the first: the start."""
    wanted = path.poses(layers.s[:1])[0]
    there = space.scene.chain.tcp_poses(start[None])[0]
    away = float(portable.norm(there[:3, 3] - wanted[:3, 3]))
    turned = portable.matmul(wanted[:3, :3].T, there[:3, :3])
    angle = float(portable.arctan2(turned[2, 1], turned[1, 1]))
    tilt = float(portable.arccos(np.clip(turned[0, 0], -1.0, 1.0)))
    if away > _START_M or tilt > _START_RAD or abs(angle) > free_angle + _START_RAD:
        raise PathRefusedError(
            f"the tcp of start is {away * 1e3:.3g} mm and "
            f"{np.degrees(max(tilt, abs(angle))):.3g} deg from where the path begins: it must be "
            f"within {_START_M * 1e3:g} mm and {np.degrees(_START_RAD):.2g} deg",
            StatusCode.START_STATE_INVALID,
        )
    later = layers.layer > 0
    return replace(
        layers,
        q=np.concatenate([start[None], layers.q[later]]),
        layer=np.concatenate([[0], layers.layer[later]]),
        angle=np.concatenate([[angle], layers.angle[later]]),
        free=np.concatenate([space.states_free(start[None]), layers.free[later]]),
    )


# how near the start must be to the path's beginning
_START_M = 1e-5
_START_RAD = 1e-5


def _check_reached(layers: Layers, space: FreeSpace) -> None:
    """Raise PathRefusedError at the first place that no configuration reaches, or none that is
    free.
    """
    count = np.bincount(layers.layer, minlength=len(layers.s))
    free = np.bincount(layers.layer[layers.free], minlength=len(layers.s))
    if count.all() and free.all():
        return
    k = int(np.argmin(free > 0))
    at = f"at {layers.s[k]:.3f} m"
    if count[k] == 0:
        raise PathRefusedError(
            f"the path leaves the reach or an axis limit {at}: no configuration brings the tool "
            "there in the orientation asked for",
            StatusCode.NO_IK_SOLUTION,
        )
    raise PathRefusedError(
        f"all {count[k]} configurations collide {at}: "
        f"{nearest_sentence(layers.q[layers.layer == k], space)}",
        StatusCode.INVALID_MOTION_PLAN,
    )


def nearest_sentence(q: FloatArray, space: FreeSpace) -> str:
    """The pair of the configuration of q (M, n) that lacks least clearance."""
    near = space.scene.collision.min_distance(q, space.threshold)
    lacking = space.threshold[near.pair] - near.distance
    k = int(np.argmin(lacking))
    pair = pair_value(space.scene, q[k], int(near.pair[k]))
    return (
        f"in the best of them {pair.body_a} and {pair.body_b} ({pair.kind}) come to "
        f"{pair.distance * 1e3:.1f} mm, they must keep {space.threshold[near.pair[k]] * 1e3:.1f} mm"
    )
