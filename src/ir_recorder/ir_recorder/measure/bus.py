"""The DC link as a tank of joules: a rectifier that only fills, a chopper that takes what is too
much.

The charge above the rectified mains is what the capacitors hold. The chopper switches at two
voltages, between which a braking robot leaves the charge at random; here it is held in their
middle, so that powers change steadily with the parameters. With the watts, their derivatives go
through the same steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp, log1p

import numpy as np

from ir_description.robot import DcLink
from ir_msgs_py.arrays import FloatArray

_SATURATED = 40.0  # beyond, a double is one of the two lines


@dataclass(frozen=True, eq=False)
class BusFlow:
    """Watts (N,) that the rectifier gives, their derivatives (N, P), and joules (N,) held after
    each step.
    """

    watts: FloatArray
    slopes: FloatArray
    charge: FloatArray


def bus_flow(
    link: DcLink,
    wanted: FloatArray,
    step: float,
    slopes: FloatArray | None = None,
    charge: float = 0.0,
    softness: float = 0.0,
) -> BusFlow:
    """Run the link over N steps of `step` [s] in which the axes together want `wanted` (N,) W.

    slopes (N, P): derivatives of `wanted` by parameters. charge [J]: at the start.
    softness [J]: over which rectifier and chopper begin to conduct; 0: at once.
    """
    top = 0.5 * (_joules(link, link.chopper_on) + _joules(link, link.chopper_off))
    tangents = np.zeros((len(wanted), 0)) if slopes is None else slopes
    if softness > 0.0:
        return _soft_flow(top, wanted, step, tangents, charge, softness)
    given = np.zeros(len(wanted))
    given_slopes = np.zeros_like(tangents)
    held = np.empty(len(wanted))
    held_slope = np.zeros(tangents.shape[1])
    free = False  # whether held_slope is anything but zero
    for k, joules in enumerate((wanted * step).tolist()):
        rest = charge - joules
        if rest < 0.0:
            given[k] = -rest / step
            charge = 0.0
            given_slopes[k] = tangents[k] - held_slope / step if free else tangents[k]
            free = False
        elif rest > top:
            charge = top
            free = False
        else:
            charge = rest
            held_slope = (held_slope if free else 0.0) - tangents[k] * step
            free = True
        held[k] = charge
    return BusFlow(given, given_slopes, held)


def _soft_flow(
    top: float,
    wanted: FloatArray,
    step: float,
    tangents: FloatArray,
    charge: float,
    softness: float,
) -> BusFlow:
    """The same with switches that conduct more and more: given = S ln(1 + exp(-rest / S)), S the
    softness.

    No kink stops a descent, however many samples change from one state of the link to another.
    """
    given, held, conducts, passes = np.empty((4, len(wanted)))
    for k, joules in enumerate((wanted * step).tolist()):
        rest = charge - joules
        filled, filling = _soft(-rest / softness)
        lost, losing = _soft((rest - top) / softness)
        charge = rest + softness * (filled - lost)
        given[k] = softness * filled / step
        held[k] = charge
        conducts[k] = filling
        passes[k] = 1.0 - filling - losing
    slope = np.zeros(tangents.shape[1])
    given_slopes = np.empty_like(tangents)
    for k, passed in enumerate(passes.tolist()):
        given_slopes[k] = slope - tangents[k] * step
        slope = passed * given_slopes[k]
    given_slopes *= (-conducts / step)[:, None]
    return BusFlow(given, given_slopes, held)


def _soft(x: float) -> tuple[float, float]:
    """ln(1 + e^x) and its derivative."""
    if abs(x) > _SATURATED:
        return max(x, 0.0), float(x > 0.0)
    power = exp(x)
    return log1p(power), power / (1.0 + power)


def _joules(link: DcLink, volts: float) -> float:
    """Above what the rectified mains keep in the capacitors."""
    return 0.5 * link.capacitance * (volts**2 - link.voltage**2)
