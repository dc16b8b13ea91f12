"""What a person may have meant by a value that is refused: another unit, a decimal comma."""

from __future__ import annotations

import numpy as np

from ir_description.robot import RobotModel
from ir_msgs_py.arrays import FloatArray

_THOUSANDTHS = {"m": ("lengths", "mm"), "kg": ("masses", "g")}


def in_thousandths(value: float, low: float, high: float, unit: str) -> str:
    """Whether a value out of bounds is in mm or g: "; lengths are in m, is it 1.2?", "" where it is
    not.
    """
    meant = value / 1000.0
    if unit not in _THOUSANDTHS or value == 0.0 or not low <= meant <= high:
        return ""
    return (
        f"; {_THOUSANDTHS[unit][0]} are in {unit}: {meant:g} for {value:g} {_THOUSANDTHS[unit][1]}?"
    )


def decimal_comma(key: str) -> str:
    """What an unknown key of digits comes from."""
    return "; a decimal comma? decimals have a point" if key.isdigit() else ""


def other_angle_unit(key: str, values: FloatArray, robot: RobotModel) -> str:
    """Whether joint values (n,) beyond the limits are meant in the other unit than that of
    `key`.
    """
    degrees = key.endswith("_deg")
    meant = values if degrees else np.radians(values)
    if not ((meant >= robot.position_min) & (meant <= robot.position_max)).all():
        return ""
    name = key.removesuffix("_deg")
    return (
        f"; {key} is in {'degrees' if degrees else 'radians'}, write "
        f"{name if degrees else f'{name}_deg'}?"
    )
