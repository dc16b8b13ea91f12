"""Surfaces of triangles that are moved against each other: whether they come near each other, and
where.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import compiled, data
from ir_kernels.errors import KernelError
from ir_values.arrays import BoolArray, FloatArray


class Surface:
    """Triangles (T, 3, 3) [m] that stand for what is within `beside` (T,) [m] of them, in a tree of
    boxes; those without an area are segments or points. T may be 0.
    """

    def __init__(self, triangles: FloatArray, beside: FloatArray) -> None:
        """Raises KernelError for arrays of another shape, or values that are not finite."""
        if triangles.shape != (len(beside), 3, 3):
            raise KernelError(
                f"triangles has shape {triangles.shape}: expected ({len(beside)}, 3, 3) as beside"
            )
        if not (np.isfinite(triangles).all() and np.isfinite(beside).all()):
            raise KernelError("triangles or beside are not finite")
        self._core = core_of(triangles, beside, compiled.MODULE)

    def meets(
        self, other: Surface, poses: ArrayLike, near: float, enough: int
    ) -> tuple[BoolArray, int]:
        """Whether it is nearer than `near` [m] to another surface (N,), and how many pairs of
        boxes were looked at; after `enough` of them, it is taken to be. poses (N, 4, 4): of
        this surface in the other one.
        """
        rows = data.array(poses, "poses", (None, 4, 4))
        met, looked_at = self._core.meets(other._core, rows, near, enough)
        return np.asarray(met), int(looked_at)

    def touching(self, other: Surface, pose: ArrayLike, near: float) -> BoolArray:
        """Which of its triangles (T,) are nearer than `near` [m] to another surface; pose (4, 4):
        of this surface in the other one.
        """
        return np.asarray(self._core.touching(other._core, data.array(pose, "pose", (4, 4)), near))


def core_of(triangles: FloatArray, beside: FloatArray, module: compiled.Core) -> compiled.Core:
    """The surface of one compiled module, or the one in NumPy where that is None."""
    if module is None:
        from ir_kernels.reference.surfaces import Surface as InNumpy

        return InNumpy(triangles, beside)
    return module.Surface(triangles, beside)
