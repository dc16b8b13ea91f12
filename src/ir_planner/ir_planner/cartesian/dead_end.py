"""Why no chain of configurations leads on along a path: collisions, an axis limit or a
singularity.
"""

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray, IntArray
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.asked import Asked
from ir_planner.cartesian.chains import JUMP
from ir_planner.cartesian.joint_curve import singularity
from ir_planner.cartesian.layers import Layers, nearest_sentence
from ir_planner.cartesian.orientations import about_tool
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.whole_turns import difference
from ir_planner.scene import PlanningScene

_DAMPED = 1e-6  # of the squared singular values


def dead_end(asked: Asked, layers: Layers, reached: IntArray) -> PathRefusedError:
    """The refusal with place, axis and what may help; reached (M,): configurations that chains lead
    to.
    """
    last = int(layers.layer[reached].max())
    at = reached[layers.layer[reached] == last]
    here = layers.q[at]
    ahead = layers.q[layers.layer == last + 1]
    jumps = np.abs(difference(here[None], ahead[:, None], layers.turning))
    away = jumps.max(axis=2)
    if (near := away.min(axis=1) <= JUMP).any():
        return PathRefusedError(
            f"every configuration that leads up to {layers.s[last]:.3f} m collides at "
            f"{layers.s[last + 1]:.3f} m: {nearest_sentence(ahead[near], asked.space)}",
            StatusCode.INVALID_MOTION_PLAN,
        )
    scene = asked.context.scene
    step = _steps(asked, layers, at, last)
    why = _beyond_limit(here, step, scene) or _jump(here, jumps, scene)
    return PathRefusedError(
        f"no configuration leads past {layers.s[last]:.3f} m without a jump of an axis: {why}; "
        f"{_help(asked)}"
    )


def _steps(asked: Asked, layers: Layers, at: IntArray, last: int) -> FloatArray:
    """What the axes (M, n) would turn from configurations `at` (M,) to the next sample, by the
    Jacobian.
    """
    poses = asked.whole.poses(layers.s[last : last + 2])
    turned = portable.matmul(poses[:, None, :3, :3], about_tool(layers.angle[at])[None])
    chain = asked.context.scene.chain
    twist = np.zeros((len(at), 6))
    twist[:, :3] = poses[1, :3, 3] - poses[0, :3, 3]
    rotation = portable.matmul(turned[1], turned[0].transpose(0, 2, 1))
    twist[:, 3:] = 0.5 * np.stack(
        [rotation[:, b, a] - rotation[:, a, b] for a, b in _CYCLIC], axis=1
    )
    jacobian = chain.jacobian(layers.q[at])
    square = portable.matmul(jacobian.transpose(0, 2, 1), jacobian) + _DAMPED * np.eye(
        jacobian.shape[2]
    )
    right = np.einsum("mji,mj->mi", jacobian, twist)
    return np.asarray(portable.solve(square, right[:, :, None])[:, :, 0])


_CYCLIC = ((1, 2), (2, 0), (0, 1))


def _beyond_limit(here: FloatArray, step: FloatArray, scene: PlanningScene) -> str:
    """The axis limit that the configuration with the smallest step (M, n) would pass, if it passes
    one.
    """
    robot = scene.cell.robot
    k = int(np.argmin(np.abs(step).max(axis=1)))
    there = here[k] + step[k]
    over = np.maximum(there - robot.position_max, robot.position_min - there)
    j = int(np.argmax(over))
    if over[j] <= 0.0:
        return ""
    limit = robot.position_max[j] if there[j] > robot.position_max[j] else robot.position_min[j]
    return f"{robot.joint_names[j]} reaches its limit of {np.degrees(limit):.0f} deg there"


def _jump(here: FloatArray, jumps: FloatArray, scene: PlanningScene) -> str:
    """The axis that would jump where configurations here (M, n) and those ahead differ least, by
    jumps (A, M, n).
    """
    away = jumps.max(axis=2)
    a, h = np.unravel_index(int(np.argmin(away)), away.shape)
    j = int(np.argmax(jumps[a, h]))
    jump = np.degrees(jumps[a, h, j])
    return f"{scene.cell.robot.joint_names[j]} by {jump:.0f} deg{singularity(here[h], scene)}"


def _help(asked: Asked) -> str:
    angle = asked.path.free_angle
    helping = ["another orientation there"]
    if angle < np.pi - 1e-6:
        helping.append("a wider free_angle" if angle > 0.0 else "a free_angle")
    if asked.fixed:
        helping.append("no given start")
    return f"{' or '.join(helping)} may help"
