"""Which inverse kinematics an arm has: in closed form where its axes allow it, else by a search."""

from numpy.typing import ArrayLike

from ir_kernels.arm_lines import arm_lines
from ir_kernels.chain import Chain
from ir_kernels.errors import InputError
from ir_kernels.ik_set import InverseKinematics
from ir_kernels.searched_ik import SearchedIk
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_kernels.three_parallel import ThreeParallelIk
from ir_kernels.wrist_geometry import wrist_geometry


def inverse_kinematics(
    chain: Chain, position_min: ArrayLike, position_max: ArrayLike
) -> InverseKinematics:
    """All configurations within the limits (6,) rad that bring `chain`'s tcp to a pose.

    Raises InputError for an arm that has not six axes, or whose axes 2 and 3 are not parallel.
    """
    lines = arm_lines(chain)
    if has_spherical_wrist(chain):
        return SphericalWristIk(chain, position_min, position_max)
    if lines.parallel(3):
        return ThreeParallelIk(chain, position_min, position_max)
    return SearchedIk(chain, position_min, position_max)


def has_spherical_wrist(chain: Chain) -> bool:
    """Whether the closed form for a spherical wrist serves."""
    try:
        wrist_geometry(chain)
    except InputError:
        return False
    return True
