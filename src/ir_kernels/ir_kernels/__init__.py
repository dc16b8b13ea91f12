"""Batch functions over arrays: kinematics, exact distances, certified motion, dynamics, inverse kinematics."""

from ir_kernels.errors import InputError, KernelError

__all__ = ["InputError", "KernelError"]
