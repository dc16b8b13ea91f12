"""A serial chain of revolute joints, the first of which may be a rail: poses of its links and of
the tool centre point, and the Jacobian.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import compiled, data, portable
from ir_kernels.data import ChainLike
from ir_kernels.errors import KernelError
from ir_values.arrays import FloatArray

AXIS_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Chain:
    """Kinematics of `robot`, standing at `base_pose` in the world, with `tcp` the pose of its tool
    point in link n.

    `robot` gives joint_origin (n, 4, 4) and joint_axis (n, 3). Joint values are (N, n) in rad, of a
    joint 1 that slides (`first_slides`) in m; limits are no business of the kinematics. Raises
    KernelError for anything that isn't a chain.
    """

    robot: ChainLike
    base_pose: FloatArray
    tcp: FloatArray
    joint_origin: FloatArray
    joint_axis: FloatArray
    first_slides: bool

    def __init__(
        self, robot: ChainLike, base_pose: ArrayLike | None = None, tcp: ArrayLike | None = None
    ) -> None:
        identity = np.eye(4)
        origin = data.read_only(data.poses(robot.joint_origin, "joint_origin").copy())
        axis = data.array(robot.joint_axis, "joint_axis", (len(origin), 3)).copy()
        length = np.linalg.norm(axis, axis=1)
        if len(origin) == 0:
            raise KernelError("joint_origin has length 0: a chain has at least one joint")
        if (np.abs(length - 1.0) > AXIS_TOLERANCE).any():
            raise KernelError(f"joint_axis has lengths {length}: expected unit vectors")
        slides = bool(getattr(robot, "first_slides", False))
        if slides and len(origin) == 1:
            raise KernelError("joint_origin has length 1: a rail carries at least one joint")
        object.__setattr__(self, "first_slides", slides)
        object.__setattr__(self, "robot", robot)
        object.__setattr__(
            self, "base_pose", data.pose(identity if base_pose is None else base_pose, "base_pose")
        )
        object.__setattr__(self, "tcp", data.pose(identity if tcp is None else tcp, "tcp"))
        object.__setattr__(self, "joint_origin", origin)
        object.__setattr__(self, "joint_axis", data.read_only(axis / length[:, None]))

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joint_axis)

    def checked(self, q: ArrayLike, name: str = "q") -> FloatArray:
        """`q` as (N, n) finite joint values, or KernelError naming it."""
        return data.array(q, name, (None, self.n))

    def link_poses(self, q: ArrayLike) -> FloatArray:
        """(N, n + 1, 4, 4): poses of the links 0..n in the world at q (N, n)."""
        q = self.checked(q)
        if compiled.MODULE is None:
            from ir_kernels.reference import chain as reference

            return reference.link_poses(
                self.joint_origin, self.joint_axis, self.base_pose, q, self.first_slides
            )
        poses: FloatArray = compiled.MODULE.link_poses(
            self.joint_origin, self.joint_axis, self.base_pose, q, self.first_slides
        )
        return poses

    def tcp_poses(self, q: ArrayLike) -> FloatArray:
        """(N, 4, 4): pose of the tool centre point in the world at q (N, n)."""
        poses: FloatArray = portable.matmul(self.link_poses(q)[:, -1], self.tcp)
        return poses

    def jacobian(self, q: ArrayLike) -> FloatArray:
        """(N, 6, n): linear [m/rad], then angular velocity of the tcp in the world, per joint
        velocity, at q (N, n); of a rail its direction and 0.
        """
        q = self.checked(q)
        if compiled.MODULE is None:
            from ir_kernels.reference import chain as reference

            return reference.jacobian(
                self.joint_axis, self.link_poses(q), self.tcp, self.first_slides
            )
        result: FloatArray = compiled.MODULE.jacobian(
            self.joint_origin, self.joint_axis, self.base_pose, self.tcp, q, self.first_slides
        )
        return result
