"""Forward kinematics and Jacobians of a serial chain of revolute joints, the first of which may be
a rail, as product of transforms.
"""

import numpy as np

from ir_kernels import portable
from ir_values.arrays import FloatArray


def axis_rotation(axis: FloatArray, angle: FloatArray) -> FloatArray:
    """(N, 3, 3): rotation by `angle` (N,) about the unit `axis` (3,) (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    outer = np.outer(axis, axis)
    s = portable.sin(angle)[:, None, None]
    c = portable.cos(angle)[:, None, None]
    result: FloatArray = outer + c * (np.eye(3) - outer) + s * cross
    return result


def link_poses(
    joint_origin: FloatArray,
    joint_axis: FloatArray,
    base_pose: FloatArray,
    q: FloatArray,
    first_slides: bool = False,
) -> FloatArray:
    """(N, n + 1, 4, 4): poses of the links 0..n in the world at q (N, n)."""
    result = np.empty((len(q), len(joint_axis) + 1, 4, 4))
    result[:, 0] = base_pose
    for i, (origin, axis) in enumerate(zip(joint_origin, joint_axis, strict=True)):
        turn = np.zeros((len(q), 4, 4))
        if first_slides and i == 0:
            turn[:, :3, :3] = np.eye(3)
            turn[:, :3, 3] = q[:, :1] * axis
        else:
            turn[:, :3, :3] = axis_rotation(axis, q[:, i])
        turn[:, 3, 3] = 1.0
        result[:, i + 1] = portable.matmul(result[:, i], origin, turn)
    return result


def axes(joint_axis: FloatArray, poses: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Origins and unit directions (N, n, 3) of the joint axes in the world, from link poses (N, n +
    1, 4, 4).
    """
    frames = poses[:, 1:]
    return frames[..., :3, 3], np.einsum("kjab,jb->kja", frames[..., :3, :3], joint_axis)


def point_jacobian(
    joint_axis: FloatArray,
    poses: FloatArray,
    points: FloatArray,
    link: FloatArray | int,
    first_slides: bool = False,
) -> FloatArray:
    """(N, 3, n): velocity in the world of points (N, 3) fixed to `link` (one, or (N,)), per joint
    velocity.
    """
    origin, direction = axes(joint_axis, poses)
    columns = np.cross(direction, points[:, None] - origin)
    if first_slides:
        columns[:, 0] = direction[:, 0]
    moved = np.arange(1, len(joint_axis) + 1) <= np.broadcast_to(link, len(points))[:, None]
    return (columns * moved[..., None]).transpose(0, 2, 1)


def jacobian(
    joint_axis: FloatArray, poses: FloatArray, tcp: FloatArray, first_slides: bool = False
) -> FloatArray:
    """(N, 6, n): linear, then angular velocity of the tcp (4, 4 in link n) in the world, per joint
    velocity.
    """
    point = (portable.matmul(poses[:, -1], tcp))[:, :3, 3]
    linear = point_jacobian(joint_axis, poses, point, len(joint_axis), first_slides)
    angular = axes(joint_axis, poses)[1].transpose(0, 2, 1)
    if first_slides:
        angular[:, :, 0] = 0.0
    return np.concatenate([linear, angular], axis=1)
