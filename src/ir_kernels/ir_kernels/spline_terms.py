"""Terms of the cost of a motion along a spline: bounds, weights and thresholds, checked once."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import arguments, data
from ir_kernels.errors import KernelError
from ir_kernels.power import REGENERATIONS, Regeneration
from ir_values.arrays import FloatArray

NOT_NEGATIVE = (
    "energy_value",
    "time_value",
    "capacity_energy",
    "smoothing",
    "clearance_margin",
    "penalty",
    "clearance_penalty",
)
_UNIT = 1e-6  # by which the length of a direction may differ from 1


@dataclass(frozen=True, eq=False)
class SplineTerms:
    """What a motion is judged by; n joints, Z pairs.

    velocity, acceleration, jerk, low, high (n,): bounds, rad and s. travel (n,): cost per rad.
    threshold (R, Z) m: rows of safety distances, each interval of a spline says which row holds;
    -inf leaves a pair out. torque_share: of the envelope. energy_value: cost per joule; time_value:
    per second, 0 leaves it out (what a second is worth is the robot's or the request's to say).
    capacity_energy [J] and regeneration: see DcBusParameters; smoothing [W]: by how much the switch
    of the DC link between mains, capacitor and resistor is rounded, 0: not at all.
    clearance_margin, clearance_scale [m]. penalty, clearance_penalty: cost per second of a relative
    excess of 1. tilt_axis (3,) in the last link may lean by tilt_max [rad] from tilt_direction (3,)
    in the world, pi: as it likes; an excess of tilt_scale [rad] counts like one of 1, with
    clearance_penalty.
    """

    velocity: FloatArray
    acceleration: FloatArray
    jerk: FloatArray
    low: FloatArray
    high: FloatArray
    travel: FloatArray
    threshold: FloatArray
    torque_share: float = 0.98
    energy_value: float = 1.0
    time_value: float = 0.0
    capacity_energy: float = 0.0
    regeneration: Regeneration = "shared"
    smoothing: float = 0.0
    clearance_margin: float = 0.001
    clearance_scale: float = 0.01
    penalty: float = 1e4
    clearance_penalty: float = 1e4
    tilt_axis: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    tilt_direction: FloatArray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    tilt_max: float = math.pi
    tilt_scale: float = 0.02


def _copy(value: ArrayLike) -> ArrayLike:
    """The same numbers, contiguous, where nobody else writes; what is no array is left to the
    checks.
    """
    return value.copy() if isinstance(value, np.ndarray) else value


def _check_bounds(arrays: dict[str, FloatArray]) -> None:
    """Raise KernelError for bounds that no motion can keep."""
    for name in ("velocity", "acceleration", "jerk"):
        if (arrays[name] <= 0.0).any():
            raise KernelError(f"terms.{name} holds {arrays[name].min()}: bounds have to be above 0")
    if (arrays["low"] > arrays["high"]).any():
        j = int(np.argmax(arrays["low"] > arrays["high"]))
        raise KernelError(
            f"terms.low[{j}] is {arrays['low'][j]}, above terms.high[{j}] {arrays['high'][j]}"
        )
    if (arrays["travel"] < 0.0).any():
        raise KernelError(
            f"terms.travel holds {arrays['travel'].min()}: a cost per rad can't be negative"
        )


def checked_terms(terms: SplineTerms, n: int, pairs: int) -> SplineTerms:
    """The terms as contiguous arrays and floats, or KernelError naming the one that makes no
    sense.
    """
    names = ("velocity", "acceleration", "jerk", "low", "high", "travel")
    arrays: dict[str, FloatArray] = {
        name: data.array(_copy(getattr(terms, name)), f"terms.{name}", (n,)) for name in names
    }
    _check_bounds(arrays)
    if terms.regeneration not in REGENERATIONS:
        raise KernelError(
            f"terms.regeneration is {terms.regeneration!r}: known are {', '.join(REGENERATIONS)}"
        )
    numbers: dict[str, float] = {
        name: arguments.number(f"terms.{name}", getattr(terms, name), 0.0) for name in NOT_NEGATIVE
    }
    return SplineTerms(
        velocity=arrays["velocity"],
        acceleration=arrays["acceleration"],
        jerk=arrays["jerk"],
        low=arrays["low"],
        high=arrays["high"],
        travel=arrays["travel"],
        energy_value=numbers["energy_value"],
        time_value=numbers["time_value"],
        capacity_energy=numbers["capacity_energy"],
        smoothing=numbers["smoothing"],
        clearance_margin=numbers["clearance_margin"],
        penalty=numbers["penalty"],
        clearance_penalty=numbers["clearance_penalty"],
        threshold=_thresholds(terms.threshold, pairs),
        torque_share=arguments.number(
            "terms.torque_share", terms.torque_share, 0.0, 1.0, above=True
        ),
        clearance_scale=arguments.number(
            "terms.clearance_scale", terms.clearance_scale, 0.0, above=True
        ),
        regeneration=terms.regeneration,
        tilt_axis=_unit(terms.tilt_axis, "terms.tilt_axis"),
        tilt_direction=_unit(terms.tilt_direction, "terms.tilt_direction"),
        tilt_max=arguments.number("terms.tilt_max", terms.tilt_max, 0.0, math.pi),
        tilt_scale=arguments.number("terms.tilt_scale", terms.tilt_scale, 0.0, above=True),
    )


def _unit(value: ArrayLike, name: str) -> FloatArray:
    """A direction (3,) of length 1. Raises KernelError."""
    direction = data.array(_copy(value), name, (3,))
    x, y, z = direction.tolist()
    length = math.sqrt(x * x + y * y + z * z)
    if abs(length - 1.0) > _UNIT:
        raise KernelError(f"{name} has length {length}: expected 1")
    return direction


def _thresholds(value: ArrayLike, pairs: int) -> FloatArray:
    """Safety distances (R, Z) [m] as they are given, checked: R >= 1 rows, of which every interval
    of a spline names one, for the Z pairs of the collision model; without pairs (R, 0).
    """
    name = "terms.threshold"
    if pairs == 0:
        rows = np.shape(value)
        if len(rows) != 2 or rows[0] == 0 or rows[1] != 0:
            raise KernelError(f"{name} has shape {rows}: expected (R, 0), there are no pairs")
        return np.zeros(rows)
    limits = arguments.shaped(name, _copy(value), None, pairs)
    if np.isnan(limits).any() or (limits == np.inf).any():
        raise KernelError(
            f"{name} holds nan or +inf: expected lengths in m, or -inf to ignore a pair"
        )
    return limits


def end_points(state: FloatArray, interval: float) -> FloatArray:
    """Three control points (3, n) with q, qd, qdd, state (3, n), at the knot in their middle."""
    q, qd, qdd = state
    middle = q - interval * interval * qdd / 6.0
    bend = 0.5 * interval * interval * qdd
    return np.stack([middle + bend - interval * qd, middle, middle + bend + interval * qd])


def end_slopes(state: FloatArray, interval: float) -> FloatArray:
    """Their derivatives (3, n) by the interval."""
    _, qd, qdd = state
    bend = 2.0 / 3.0 * interval * qdd
    return np.stack([bend - qd, -interval * qdd / 3.0, bend + qd])
