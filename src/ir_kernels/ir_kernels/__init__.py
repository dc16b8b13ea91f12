"""Batch functions over arrays: kinematics, exact distances, certified motion, path search, dynamics,
inverse kinematics, motions along splines.
"""

from ir_kernels.ccd import CcdResult, CcdSettings, ccd
from ir_kernels.chain import Chain
from ir_kernels.collision import (
    COLLIDES,
    FREE,
    UNDECIDED,
    Certificate,
    Certificates,
    CollisionModel,
    MinDistance,
    Witnesses,
)
from ir_kernels.dynamics import DynamicsModel, Gradients
from ir_kernels.errors import InputError, KernelError
from ir_kernels.geometry import ENVIRONMENT, SELF, Pair
from ir_kernels.inverse_kinematics import IkSet, SphericalWristIk
from ir_kernels.limits import Extrema, MotionExtrema, motion_extrema, polynomial_extrema
from ir_kernels.power import DcBus, DcBusParameters, DriveEnergy, dc_bus, drive_energy
from ir_kernels.search import BidirectionalTree
from ir_kernels.spline import SplineCost, SplineDescent, SplineValue
from ir_kernels.spline_terms import SplineTerms
from ir_kernels.torque_bounds import EXCEEDS, WITHIN, TorqueBounds

__all__ = [
    "COLLIDES",
    "ENVIRONMENT",
    "EXCEEDS",
    "FREE",
    "SELF",
    "UNDECIDED",
    "WITHIN",
    "BidirectionalTree",
    "CcdResult",
    "CcdSettings",
    "Certificate",
    "Certificates",
    "Chain",
    "CollisionModel",
    "DcBus",
    "DcBusParameters",
    "DriveEnergy",
    "DynamicsModel",
    "Extrema",
    "Gradients",
    "IkSet",
    "InputError",
    "KernelError",
    "MinDistance",
    "MotionExtrema",
    "Pair",
    "SphericalWristIk",
    "SplineCost",
    "SplineDescent",
    "SplineTerms",
    "SplineValue",
    "TorqueBounds",
    "Witnesses",
    "ccd",
    "dc_bus",
    "drive_energy",
    "motion_extrema",
    "polynomial_extrema",
]
