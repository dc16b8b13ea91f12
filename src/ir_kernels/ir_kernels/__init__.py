"""Batch functions over arrays: kinematics, exact distances, certified motion, path search,
dynamics, inverse kinematics, motions along splines.
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
from ir_kernels.dynamics import EXCEEDS, WITHIN, DynamicsModel, Gradients, TorqueBounds
from ir_kernels.errors import InputError, KernelError
from ir_kernels.geometry import ENVIRONMENT, SELF, Pair
from ir_kernels.ik_set import IkSet, InverseKinematics
from ir_kernels.inverse_kinematics import SearchedIk, ThreeParallelIk, inverse_kinematics
from ir_kernels.limits import (
    Extrema,
    MotionExtrema,
    motion_extrema,
    polynomial_extrema,
    polynomial_samples,
)
from ir_kernels.power import DcBus, DcBusParameters, DriveEnergy, dc_bus, drive_energy
from ir_kernels.search import BidirectionalTree
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_kernels.spline import (
    CubicPath,
    ProfileDescent,
    SplineCost,
    SplineDescent,
    SplineStarts,
    SplineValue,
)
from ir_kernels.spline_terms import SplineTerms, end_points
from ir_kernels.surfaces import Surface

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
    "CubicPath",
    "DcBus",
    "DcBusParameters",
    "DriveEnergy",
    "DynamicsModel",
    "Extrema",
    "Gradients",
    "IkSet",
    "InputError",
    "InverseKinematics",
    "KernelError",
    "MinDistance",
    "MotionExtrema",
    "Pair",
    "ProfileDescent",
    "SearchedIk",
    "SphericalWristIk",
    "SplineCost",
    "SplineDescent",
    "SplineStarts",
    "SplineTerms",
    "SplineValue",
    "Surface",
    "ThreeParallelIk",
    "TorqueBounds",
    "Witnesses",
    "ccd",
    "dc_bus",
    "drive_energy",
    "end_points",
    "inverse_kinematics",
    "motion_extrema",
    "polynomial_extrema",
    "polynomial_samples",
]
