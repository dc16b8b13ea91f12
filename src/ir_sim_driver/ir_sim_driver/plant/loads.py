"""What the flange carries: named loads of the cell joined by "+", or one that is described by
numbers.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, Load, RobotModel
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_msgs_py.status import StatusCode
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plant.load_diagram import LoadDiagram

CUSTOM = "custom"
# m, kg m^2: beyond what any robot carries; the load diagram is what bounds a load
_FAR = 100.0
_BIG = 1e6
_PAYLOAD_CODE = StatusCode.PLANNING_FAILED  # -1, as controllers answer an impossible payload


@dataclass(frozen=True, eq=False)
class Carried:
    """Loads in the frame of the last link, and the text that names them."""

    text: str
    loads: tuple[Load, ...]

    @property
    def mass(self) -> float:
        """Total mass [kg]."""
        return float(sum(load.mass for load in self.loads))

    @property
    def watts_always(self) -> float:
        """Electrical power [W] whatever the mode."""
        return float(sum(load.watts_always for load in self.loads))

    @property
    def watts_drive_bus(self) -> float:
        """Electrical power [W] more while the drive bus is up."""
        return float(sum(load.watts_drive_bus for load in self.loads))


def carried(cell: Cell, text: str) -> Carried:
    """Loads that `text` names: "gripper+part", or "none". Raises RequestRefusedError."""
    if text in ("", NO_LOAD):
        return Carried(NO_LOAD, ())
    known = {part.name: part.held(cell.tcp) for part in cell.parts}
    if cell.tool is not None:
        known[cell.tool.name] = cell.tool
    names = text.split(LOAD_SEPARATOR)
    for name in names:
        if name not in known:
            raise RequestRefusedError(
                StatusCode.INVALID_OBJECT_NAME,
                f"load {name[:80]!r} is unknown: known are "
                f"{', '.join((*sorted(known), NO_LOAD, CUSTOM))}",
            )
        if names.count(name) > 1:
            raise RequestRefusedError(
                StatusCode.INVALID_OBJECT_NAME, f"load {name!r} is named more than once"
            )
    return _within_payload(Carried(text, tuple(known[name] for name in names)), cell.robot)


def custom_load(
    cell: Cell, mass: float, com: FloatArray, inertia: FloatArray, always: float, drive_bus: float
) -> Carried:
    """A load from numbers [kg, m, kg m^2, W], com (3,), inertia (6,) (ixx ixy ixz iyy iyz izz) or
    none. Raises RequestRefusedError.
    """
    limit = cell.robot.rated_payload
    if not (math.isfinite(mass) and 0.0 <= mass <= limit):
        raise RequestRefusedError(
            _PAYLOAD_CODE, f"mass is {mass:g} kg: it must be in [0, {limit:g}] kg"
        )
    if inertia.size not in (0, 6):
        raise RequestRefusedError(
            _PAYLOAD_CODE, f"inertia has {inertia.size} values: it must have 6, or none"
        )
    for name, values, bound, unit in (
        ("center_of_mass", com, _FAR, "m"),
        ("inertia", inertia, _BIG, "kg m^2"),
    ):
        if not (np.abs(values) <= bound).all():  # NaN is refused too, and nothing overflows below
            raise RequestRefusedError(
                _PAYLOAD_CODE, f"{name} is {values}: at most {bound:g} {unit} each"
            )
    if mass == 0.0:
        return Carried(CUSTOM, ())
    matrix = np.zeros((3, 3))
    if inertia.size:
        matrix[np.triu_indices(3)] = inertia
        matrix = matrix + np.triu(matrix, 1).T
    else:
        matrix = np.eye(3) * (1e-6 * mass)  # a point; exactly zero is no rigid body
    try:
        load = Load(CUSTOM, "tool", mass, com, matrix, (), always, drive_bus)
    except ValueError as error:
        raise RequestRefusedError(_PAYLOAD_CODE, str(error)) from error
    return _within_payload(Carried(CUSTOM, (load,)), cell.robot)


def _within_payload(what: Carried, robot: RobotModel) -> Carried:
    excess = LoadDiagram(robot).excess(what.text, what.loads)
    if excess:
        raise RequestRefusedError(_PAYLOAD_CODE, excess)
    return what
