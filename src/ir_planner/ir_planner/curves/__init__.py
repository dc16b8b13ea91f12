"""Curves over time and path: arc length, polynomials, splines through points, uniform B-splines."""

from ir_planner.curves.joint_spline import (
    natural_durations,
    spline_through,
    to_ppoly,
    virtual_knots,
)
from ir_planner.curves.polynomials import Extremes, extremes, motion_at
from ir_planner.curves.rotation_vectors import (
    RotationSpline,
    rotation_of,
    rotation_vector,
    turn_of,
    turned_evenly,
)
from ir_planner.curves.uniform_spline import (
    UniformSpline,
    along_motion,
    along_path,
    at_shares,
    evenly_spaced,
    fewest_seconds,
    in_short_steps,
)

__all__ = [
    "Extremes",
    "RotationSpline",
    "UniformSpline",
    "along_motion",
    "along_path",
    "at_shares",
    "evenly_spaced",
    "extremes",
    "fewest_seconds",
    "in_short_steps",
    "motion_at",
    "natural_durations",
    "rotation_of",
    "rotation_vector",
    "spline_through",
    "to_ppoly",
    "turn_of",
    "turned_evenly",
    "virtual_knots",
]
