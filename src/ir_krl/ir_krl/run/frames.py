"""FRAME values [mm, deg] to poses (4, 4) [m] and back, and what a position says beside its
frame.
"""

from __future__ import annotations

import numpy as np

from ir_description.poses import abc_from_rotation, pose_of, rotation_from_abc
from ir_krl.errors import KrlRunError, Place
from ir_krl.run.values import Structure, Value, kind_of, number
from ir_msgs_py.arrays import FloatArray

PLACE_NAMES = ("X", "Y", "Z")
ANGLE_NAMES = ("A", "B", "C")
FRAME_NAMES = (*PLACE_NAMES, *ANGLE_NAMES)
EXTERNAL_NAMES = ("E1", "E2", "E3", "E4", "E5", "E6")
AXIS_NAMES = ("A1", "A2", "A3", "A4", "A5", "A6")
_MM = 1e-3  # m


def is_axis_value(value: Structure) -> bool:
    """Whether a structure holds axis angles: AXIS or E6AXIS."""
    return any(name in value.fields for name in AXIS_NAMES)


def components(value: Structure, names: tuple[str, ...], place: Place) -> dict[str, float]:
    """Those of `names` that are there, as numbers. Raises KrlRunError."""
    return {name: number(value.fields[name], name, place) for name in names if name in value.fields}


def pose(value: Value, what: str, place: Place) -> FloatArray:
    """The pose (4, 4) [m] of a FRAME, POS or E6POS; components that are missing are 0. Raises
    KrlRunError.
    """
    if not isinstance(value, Structure) or is_axis_value(value):
        raise KrlRunError(f"{what} is {kind_of(value)}, not a FRAME", place)
    found = components(value, FRAME_NAMES, place)
    xyz = [_MM * found.get(name, 0.0) for name in PLACE_NAMES]
    return pose_of(xyz, rotation_from_abc([found.get(name, 0.0) for name in ANGLE_NAMES]))


def frame(transform: FloatArray, kind: str = "FRAME") -> Structure:
    """The FRAME [mm, deg] of a pose (4, 4) [m]."""
    values = [*(transform[:3, 3] / _MM), *abc_from_rotation(transform[:3, :3])]
    return Structure(
        {name: float(value) for name, value in zip(FRAME_NAMES, values, strict=True)}, kind
    )


def axes(value: Structure, place: Place) -> dict[str, float]:
    """Axis angles [rad] by name."""
    return {
        name: float(np.radians(angle))
        for name, angle in components(value, AXIS_NAMES, place).items()
    }
