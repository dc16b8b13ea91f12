"""Enclosures of the power that the axes take from the DC bus over short pieces of time."""

import numpy as np

from ir_kernels.dynamics_data import DynamicsData
from ir_kernels.reference.enclosures import enclosure, pieces_of
from ir_kernels.reference.interval import OUTWARD, Dual, Interval, intersect, interval
from ir_kernels.reference.vectors import Number
from ir_values.arrays import FloatArray


def power_bounds(
    data: DynamicsData, coefficients: FloatArray, durations: FloatArray, longest: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Seconds, net and taken (K,) of pieces of at most `longest` s: see
    `ir_kernels.power_bounds`.
    """
    counts = np.maximum(np.ceil(durations / longest), 1).astype(int)
    pieces = pieces_of(durations, counts)
    rests = (coefficients[:, :, 1:] == 0.0).all(axis=2)
    found = enclosure(data, coefficients, rests, pieces)
    middle: Number = interval(np.zeros(len(pieces.segment)))
    slope = middle
    over = middle
    taken = np.zeros(len(pieces.segment))
    for j in range(data.n):
        # whatever the friction's sign is at an instant, it is one number of this interval there
        friction = found.coulomb[j]
        at_middle = _axis_power(data, j, found.torque0[j] + friction, found.speed0[j])
        torque = Dual(found.torque[j].v + friction, found.torque[j].d)
        power = _axis_power(data, j, torque, found.speed[j])
        sharp: Interval = intersect(power.v, at_middle + power.d * found.step)
        middle = middle + at_middle
        slope = slope + power.d
        over = over + sharp
        taken = taken + np.maximum(sharp.hi, 0.0)
    net = intersect(over, middle + slope * found.step)
    return pieces.end - pieces.begin, net.hi, taken * (1.0 + 8 * OUTWARD)


def _axis_power(data: DynamicsData, joint: int, torque: Number, speed: Number) -> Number:
    """Power [W] that an axis takes; for intervals and their derivatives alike."""
    copper = float(data.copper_loss[joint]) / float(data.gear_ratio[joint]) ** 2
    return torque * speed + torque * copper * torque
