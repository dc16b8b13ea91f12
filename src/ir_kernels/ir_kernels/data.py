"""Data of a robot, a load and a body for the kernels: structural types, and their checks.

Any object with these attributes serves (ir_description's dataclasses do). Lengths in m, angles in
rad, masses in kg. Links are counted 0..n: link 0 is the base, link i is moved by joint i (1..n);
arrays over joints are indexed 0..n-1.
"""

from collections.abc import Sequence
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ir_kernels import arguments, portable
from ir_kernels.errors import KernelError
from ir_values.arrays import FloatArray, IntArray

T = TypeVar("T", bound=np.generic)


class ChainLike(Protocol):
    """Kinematics of a serial chain of revolute joints. Where it has `first_slides` and that is
    true, joint 1 is a rail: it slides along its axis, its values are in m.
    """

    @property
    def joint_origin(self) -> FloatArray:
        """(n, 4, 4): pose of joint frame i (= link i + 1 at q_i = 0) in the frame of link i."""

    @property
    def joint_axis(self) -> FloatArray:
        """(n, 3): unit axis in the joint frame."""


class CapsuleLike(Protocol):
    """A ball of `radius` swept along the segment p0 p1 (equal: a sphere), fixed to a link."""

    @property
    def name(self) -> str:
        """Unique within one collision model."""

    @property
    def link(self) -> int:
        """0..n."""

    @property
    def p0(self) -> FloatArray:
        """(3,) in the link frame."""

    @property
    def p1(self) -> FloatArray:
        """(3,) in the link frame."""

    @property
    def radius(self) -> float:
        """Not negative."""


class BodyLike(Protocol):
    """A convex solid of the scene.

    size: box: full edge lengths; cylinder: (radius, length, 0), axis z; sphere: (radius, 0, 0);
    capsule: (radius, length between the centres of the end spheres, 0), axis z; plane: unused, z is
    the normal and the solid is below; mesh: unused, the solid is the convex hull of `vertices`.
    """

    @property
    def name(self) -> str:
        """Unique within one collision model."""

    @property
    def kind(self) -> str:
        """One of ir_kernels.geometry.KINDS."""

    @property
    def pose(self) -> FloatArray:
        """(4, 4) in the world."""

    @property
    def size(self) -> FloatArray:
        """(3,)."""

    @property
    def vertices(self) -> FloatArray:
        """(V, 3) in the body frame, (0, 3) for all kinds but mesh."""


def read_only(array: NDArray[T]) -> NDArray[T]:
    """The same array, which can't be written through this name any more."""
    array.setflags(write=False)
    return array


def array(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> FloatArray:
    """`value` as a finite, C-contiguous float64 array of `shape`, or KernelError.

    None in the shape is any length but 0: (None, 3) for (N, 3).
    """
    return arguments.finite(name, arguments.shaped(name, value, *shape))


def indices(value: ArrayLike, name: str, shape: tuple[int | None, ...], bound: int) -> IntArray:
    """`value` as an int64 array of `shape`, such as (n,), with 0 <= i < bound, or KernelError
    naming it.
    """
    raw = np.asarray(value)
    if raw.dtype.kind not in "iu":
        raise KernelError(f"{name} has dtype {raw.dtype}, expected whole numbers")
    arguments.shaped(name, raw, *shape)
    if raw.min() < 0 or raw.max() >= bound:
        raise KernelError(f"{name} holds {raw.min()}..{raw.max()}: expected 0 <= index < {bound}")
    return np.ascontiguousarray(raw, dtype=np.int64)


ROTATION_TOLERANCE = 1e-6  # what a rotation typed with seven digits deviates from one


def pose(value: ArrayLike, name: str) -> FloatArray:
    """A (4, 4) rigid transform, read-only; its rotation may deviate from an orthonormal one by
    ROTATION_TOLERANCE.
    """
    return read_only(poses(np.ascontiguousarray(value)[None], name)[0].copy())


def poses(value: ArrayLike, name: str) -> FloatArray:
    """(N, 4, 4) rigid transforms. Raises KernelError for what is none."""
    result = array(value, name, (None, 4, 4))
    rotation = result[:, :3, :3]
    deviation = np.abs(portable.matmul(rotation, rotation.transpose(0, 2, 1)) - np.eye(3)).max(
        initial=0.0
    )
    if deviation > ROTATION_TOLERANCE or (result[:, 3] != [0.0, 0.0, 0.0, 1.0]).any():
        raise KernelError(
            f"{name} is not a rigid transform: R R^T deviates from 1 by {deviation:.2g}, "
            "or the last row isn't 0 0 0 1"
        )
    if (np.linalg.det(rotation) < 0.0).any():
        raise KernelError(f"{name} mirrors: its rotation has determinant -1")
    return result


def unique_names(items: Sequence[CapsuleLike] | Sequence[BodyLike], name: str) -> tuple[str, ...]:
    """Names of the items; KernelError when one is used twice."""
    names = tuple(str(item.name) for item in items)
    if len(set(names)) < len(names):
        twice = next(one for k, one in enumerate(names) if one in names[:k])
        raise KernelError(f"{name}: the name {twice!r} is used more than once")
    return names
