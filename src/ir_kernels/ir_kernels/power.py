"""From joint torques to joules at the mains: axis power, the DC link, energy of a sampled
trajectory.

The axes of one controller share a DC link that the supply only feeds (it rectifies). What braking
axes give back goes to the other axes, then into the capacitor; the rest is dissipated in the brake
resistor.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import compiled
from ir_kernels.arguments import checked
from ir_kernels.errors import KernelError
from ir_kernels.reference import dynamics as reference
from ir_values.arrays import FloatArray

Regeneration = Literal["shared", "none", "fed_back"]
REGENERATIONS: tuple[Regeneration, ...] = ("shared", "none", "fed_back")


@dataclass(frozen=True)
class DcBusParameters:
    """What the DC link can do with braking energy.

    capacity_energy [J]: what fits into the capacitor between rest voltage and brake chopper, C
    (U_on^2 - U_0^2) / 2. regeneration: "shared" (the surplus beyond the capacitor is dissipated),
    "none" (every axis' braking energy is dissipated, nothing is shared or stored), "fed_back" (the
    surplus beyond the capacitor returns to the mains).
    """

    capacity_energy: float
    regeneration: Regeneration = "shared"

    def __post_init__(self) -> None:
        if not (np.isfinite(self.capacity_energy) and self.capacity_energy >= 0.0):
            raise KernelError(
                f"capacity_energy is {self.capacity_energy} J: it has to be finite and not negative"
            )
        if self.regeneration not in REGENERATIONS:
            raise KernelError(
                f"regeneration is {self.regeneration!r}: known are {', '.join(REGENERATIONS)}"
            )


class DcBus(NamedTuple):
    """Step by step: mains (N,) W drawn for the axes, dissipated (N,) W in the resistor, stored (N,)
    J after the step.
    """

    mains: FloatArray
    dissipated: FloatArray
    stored: FloatArray


def _steps(dt: ArrayLike, N: int) -> FloatArray:
    steps = checked(
        "dt", np.broadcast_to(np.asarray(dt, float), (N,)).copy() if np.ndim(dt) == 0 else dt, N
    )
    if (steps <= 0.0).any():
        raise KernelError(f"dt holds {steps.min()} s: steps have to be longer than 0")
    return steps


def dc_bus(
    axis_power: ArrayLike,
    dt: ArrayLike,
    parameters: DcBusParameters,
    stored: float = 0.0,
    *,
    core: compiled.Core = compiled.MODULE,
) -> DcBus:
    """Run the DC link over N steps in which the axes take constant powers `axis_power` (N, n) W.

    `dt`: length of the steps, one number or (N,), s. `stored` [J]: in the capacitor (above its rest
    voltage) before the first step. In every step, with P the signed sum of the axes:

    - "shared": demand P > 0 empties the capacitor first, the mains give the rest; surplus P < 0
      fills it first, the rest is dissipated. mains >= 0.
    - "fed_back": the same, but the rest of the surplus returns to the mains: mains < 0, dissipated
    0.
    - "none": mains = sum of the positive axes, dissipated = sum of the negative ones; the capacitor
      stays as it is.

    Always mains dt = (sum of axes + dissipated) dt + change of stored, and 0 <= stored <=
    capacity_energy. What is left in the capacitor at the end is not credited to anyone. N may be 1:
    a driver hands `stored` on from call to call. Raises KernelError.
    """
    power = checked("axis_power", axis_power, None, None)
    steps = _steps(dt, len(power))
    if not 0.0 <= stored <= parameters.capacity_energy:
        raise KernelError(
            f"stored is {stored} J: it has to be within 0 and capacity_energy "
            f"{parameters.capacity_energy} J"
        )
    scan = reference.dc_bus if core is None or not hasattr(core, "dc_bus") else core.dc_bus
    result = scan(power, steps, parameters.capacity_energy, parameters.regeneration, float(stored))
    for array in result:
        array.setflags(write=False)
    return DcBus(*result)
