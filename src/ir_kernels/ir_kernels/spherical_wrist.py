"""Closed-form inverse kinematics of 6R arms with a spherical wrist: every branch and every turn
within the limits.

Branch numbers 0..7, in bits: 4 the arm reaches backwards over its base, 2 the other elbow, 1 the
other wrist.
"""

from numpy.typing import ArrayLike

from ir_kernels import compiled, data, portable
from ir_kernels.arguments import shaped
from ir_kernels.chain import Chain
from ir_kernels.ik_set import IkSet, limits
from ir_kernels.reference import inverse_kinematics as reference
from ir_kernels.wrist_geometry import wrist_geometry


class SphericalWristIk:
    """All configurations within the limits that bring `chain`'s tcp to a pose.

    position_min, position_max (6,) rad. A singular wrist (axes 4 and 6 parallel) leaves one
    parameter free: the representative with q4 = 0 (or the limit nearest to 0) is given; a wrist
    centre on axis 1 likewise gives q1 = 0 and its opposite. Raises KernelError where the chain
    isn't a 6R arm with z1 _|_ z2 || z3, z4 _|_ z5 _|_ z6 and axes 4 to 6 meeting in a point
    (1e-9 m).
    """

    def __init__(
        self,
        chain: Chain,
        position_min: ArrayLike,
        position_max: ArrayLike,
        *,
        core: compiled.Core = compiled.MODULE,
    ) -> None:
        self.chain = chain
        self.geometry = wrist_geometry(chain)
        self.position_min, self.position_max = limits(position_min, position_max)
        self._to_base = portable.inv(chain.base_pose)
        self._from_tcp = portable.inv(chain.tcp)
        self._core = None
        if core is not None and hasattr(core, "SphericalWristIk"):
            bounds = (self.position_min, self.position_max)
            self._core = core.SphericalWristIk(
                self.geometry, self._to_base, self._from_tcp, *bounds
            )

    def solve(self, poses: ArrayLike) -> IkSet:
        """All solutions for poses (N, 4, 4) of the tcp in the world; tcp(q) meets the pose to 1e-9
        m and 1e-9 rad.
        """
        targets = shaped("poses", poses, None, 4, 4)
        result = None if self._core is None else self._core.solve(targets)
        if result is None:  # no compiled core, or it refused a pose: the check says which and why
            data.poses(targets, "poses")
            hand = portable.matmul(self._to_base, targets, self._from_tcp)
            result = reference.solve(self.geometry, hand, self.position_min, self.position_max)
        for array in result:
            array.setflags(write=False)
        return IkSet(*result)
