"""Batch functions over arrays: kinematics, exact distances, certified motion, dynamics, inverse kinematics."""

from ir_kernels.dynamics import DynamicsModel, Gradients
from ir_kernels.errors import InputError, KernelError
from ir_kernels.inverse_kinematics import IkSet, SphericalWristIk
from ir_kernels.power import DcBus, DcBusParameters, DriveEnergy, dc_bus, drive_energy

__all__ = [
    "DcBus",
    "DcBusParameters",
    "DriveEnergy",
    "DynamicsModel",
    "Gradients",
    "IkSet",
    "InputError",
    "KernelError",
    "SphericalWristIk",
    "dc_bus",
    "drive_energy",
]
