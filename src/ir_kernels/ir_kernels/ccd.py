"""Inverse kinematics of any serial chain by cyclic coordinate descent (eqs. 2 and 3), many starts
at once.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import compiled, data
from ir_kernels.arguments import checked
from ir_kernels.chain import Chain
from ir_kernels.errors import KernelError
from ir_kernels.reference import ccd as reference
from ir_values.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class CcdSettings:
    """How long to search, and when an answer is good.

    rotation_length: lambda of eq. 2, m/rad: how many metres of distance one radian of rotation
    weighs.
    xi: a start stops its sweeps when Psi < xi, m^2 (eq. 6); 1e-8 means at most 1e-4 m and 2e-4 rad.
    max_sweeps: passes over all joints at most. newton_steps: damped least-squares steps at most
    after the sweeps, 0 for pure eq. 3; each of them is one evaluation. newton_tolerance: Psi below
    which these stop, m^2.
    """

    rotation_length: float = 0.5
    xi: float = 1e-8
    max_sweeps: int = 500
    newton_steps: int = 0
    newton_tolerance: float = 1e-20

    def __post_init__(self) -> None:
        for name in ("rotation_length", "xi", "newton_tolerance"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0.0):
                raise KernelError(f"{name} is {value}: it has to be finite and not negative")
        for name in ("max_sweeps", "newton_steps"):
            if getattr(self, name) < 0:
                raise KernelError(f"{name} is {getattr(self, name)}: it has to be 0 or more")


class CcdResult(NamedTuple):
    """Where every start ended, in the order of the starts.

    q (P, n) rad within the limits; psi (P,) of eq. 2, m^2; position_error (P,) m; rotation_error
    (P,) rad; sweeps (P,) and newton_steps (P,): the work spent.
    """

    q: FloatArray
    psi: FloatArray
    position_error: FloatArray
    rotation_error: FloatArray
    sweeps: IntArray
    newton_steps: IntArray

    def reached(self, position_error: float = 1e-4, rotation_error: float = 3e-4) -> BoolArray:
        """(P,): which starts ended within these errors, m and rad."""
        close = (self.position_error <= position_error) & (self.rotation_error <= rotation_error)
        return np.asarray(close)


def ccd(
    chain: Chain,
    pose: ArrayLike,
    starts: ArrayLike,
    position_min: ArrayLike,
    position_max: ArrayLike,
    settings: CcdSettings | None = None,
    *,
    core: compiled.Core = compiled.MODULE,
) -> CcdResult:
    """Bring `chain`'s tcp to `pose` (4, 4) in the world from each of `starts` (P, n) rad.

    Each joint in turn, from the tool to the base, takes the value within [position_min,
    position_max] (n,) that minimises Psi: closed form per joint, so Psi never grows. Starts outside
    the limits are moved onto them. Starts don't know of each other: a start ends the same in any
    batch. Raises KernelError, also for a chain with a rail.
    """
    if chain.first_slides:
        raise KernelError(
            "joint 1 is a rail: coordinate descent turns joints, give it the arm alone"
        )
    settings = CcdSettings() if settings is None else settings
    target = data.pose(pose, "pose")
    first = checked("starts", starts, None, chain.n)
    low = data.array(np.ascontiguousarray(position_min), "position_min", (chain.n,))
    high = data.array(np.ascontiguousarray(position_max), "position_max", (chain.n,))
    if (low > high).any():
        j = int(np.argmax(low > high))
        raise KernelError(
            f"position_min[{j}] is {low[j]} rad, above position_max[{j}], {high[j]} rad"
        )
    limits = (settings.xi, settings.max_sweeps, settings.newton_steps, settings.newton_tolerance)
    arrays = (chain.joint_origin, chain.joint_axis, chain.base_pose, chain.tcp, target, low, high)
    if core is None or not hasattr(core, "ccd"):
        result = reference.run(reference.Problem(*arrays, settings.rotation_length), first, *limits)
    else:
        result = core.ccd(*arrays, settings.rotation_length, first, *limits)
    for array in result:
        array.setflags(write=False)
    return CcdResult(*result)
