"""Batch functions over arrays: kinematics, exact distances, certified motion, path search,
dynamics, inverse kinematics, motions along splines.
"""

from ir_kernels.ccd import CcdSettings, ccd
from ir_kernels.chain import Chain
from ir_kernels.collision import COLLIDES, FREE, UNDECIDED, CollisionModel
from ir_kernels.dynamics import DynamicsModel, Gradients
from ir_kernels.errors import InputError, KernelError
from ir_kernels.ik_set import InverseKinematics
from ir_kernels.inverse_kinematics import SearchedIk, ThreeParallelIk, inverse_kinematics
from ir_kernels.limits import Extrema, motion_extrema, polynomial_extrema, polynomial_samples
from ir_kernels.power import DcBus, DcBusParameters, dc_bus, drive_energy
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_kernels.spline import CubicPath, SplineCost, SplineDescent, SplineStarts
from ir_kernels.spline_terms import SplineTerms, end_points
from ir_kernels.surfaces import Surface

__all__ = [
    "COLLIDES",
    "FREE",
    "UNDECIDED",
    "CcdSettings",
    "Chain",
    "CollisionModel",
    "CubicPath",
    "DcBus",
    "DcBusParameters",
    "DynamicsModel",
    "Extrema",
    "Gradients",
    "InputError",
    "InverseKinematics",
    "KernelError",
    "SearchedIk",
    "SphericalWristIk",
    "SplineCost",
    "SplineDescent",
    "SplineStarts",
    "SplineTerms",
    "Surface",
    "ThreeParallelIk",
    "ccd",
    "dc_bus",
    "drive_energy",
    "end_points",
    "inverse_kinematics",
    "motion_extrema",
    "polynomial_extrema",
    "polynomial_samples",
]
