"""Batch functions over arrays: kinematics, exact distances, certified motion, path search,
dynamics, inverse kinematics, motions along splines.
"""

from ir_kernels.ccd import CcdSettings, ccd
from ir_kernels.chain import Chain
from ir_kernels.collision import COLLIDES, FREE, UNDECIDED, CollisionModel
from ir_kernels.dynamics import DynamicsModel
from ir_kernels.errors import KernelError
from ir_kernels.inverse_kinematics import inverse_kinematics
from ir_kernels.power import dc_bus
from ir_kernels.spline import SplineCost, SplineDescent

__all__ = [
    "COLLIDES",
    "FREE",
    "UNDECIDED",
    "CcdSettings",
    "Chain",
    "CollisionModel",
    "DynamicsModel",
    "KernelError",
    "SplineCost",
    "SplineDescent",
    "ccd",
    "dc_bus",
    "inverse_kinematics",
]
