"""What may move in a cell, and the cell with it moved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from ir_description import Cell, Load
from ir_description.poses import composed, inverse, pose_of, rotation_from_abc
from ir_msgs_py.arrays import FloatArray

Range: TypeAlias = "tuple[float, float]"
Values: TypeAlias = "Mapping[str, float]"
"""By variable: m or degrees from where things stand in the cell file."""

_STANDING = ("x", "y", "z", "turn_deg")
TURNS = {
    "base": _STANDING,
    "equipment": _STANDING,
    "tool": ("x", "y", "z", "a_deg", "b_deg", "c_deg"),
}
JOINTS = tuple(f"a{k}_deg" for k in range(1, 13))
# decimals: what people can set up
_METRES = 3
_DEGREES = 1


@dataclass(frozen=True)
class Variable:
    """Its name, as base.x or equipment.gauge.turn_deg, and how far it may go."""

    name: str
    low: float
    high: float

    @property
    def owner(self) -> str:
        """What moves: base, park, tool, or equipment. and a machine's name."""
        return self.name.rpartition(".")[0]

    @property
    def part(self) -> str:
        """How it moves: x, turn_deg, ..."""
        return self.name.rpartition(".")[2]

    @property
    def unit(self) -> str:
        """m or deg."""
        return "deg" if self.name.endswith("_deg") else "m"

    def at(self, share: float) -> float:
        """The value at a share of the range, in whole millimetres or tenths of degrees."""
        value = self.low + share * (self.high - self.low)
        rounded = round(value, _DEGREES if self.unit == "deg" else _METRES)
        return min(max(rounded, self.low), self.high) + 0.0


def variables(groups: Mapping[str, Mapping[str, Range]]) -> tuple[Variable, ...]:
    """One per range."""
    return tuple(
        Variable(f"{group}.{name}", *ends)
        for group, ranges in groups.items()
        for name, ends in ranges.items()
    )


def text_of(values: Values) -> str:
    """Values as the key of a placement; what does not move is left out."""
    return (
        " ".join(f"{name}={value!r}" for name, value in sorted(values.items()) if value)
        or "as given"
    )


@dataclass(frozen=True)
class Placing:
    """carried: machines that move with the base."""

    carried: tuple[str, ...] = ()

    def cell(self, given: Cell, values: Values, payload: Mapping[str, float] | None = None) -> Cell:
        """The cell with everything moved by the values, and parts of other masses.

        Raises InvalidValueError for a cell without sense: a posture beyond the joints' limits, too
        much load.
        """
        groups: dict[str, dict[str, float]] = {}
        for name, value in values.items():
            owner, _, part = name.rpartition(".")
            groups.setdefault(owner, {})[part] = value
        cell = given
        if "base" in groups:
            cell = self._with_base(cell, groups["base"])
        for machine in given.equipment:
            moved = groups.get(f"equipment.{machine.name}")
            if moved:
                cell = cell.with_equipment(
                    machine.name, standing(cell.machine(machine.name).pose, moved)
                )
        if "park" in groups:
            park = np.array(cell.park)
            for name, value in groups["park"].items():
                park[JOINTS.index(name)] += np.radians(value)
            cell = replace(cell, park=park)
        if "tool" in groups:
            cell = with_tool(cell, groups["tool"])
        return with_masses(cell, payload or {})

    def _with_base(self, cell: Cell, moved: Mapping[str, float]) -> Cell:
        pose = standing(cell.base_pose, moved)
        by = composed(pose, inverse(cell.base_pose))
        for name in self.carried:
            cell = cell.with_equipment(name, composed(by, cell.machine(name).pose))
        return replace(cell, base_pose=pose)


def standing(pose: FloatArray, moved: Mapping[str, float]) -> FloatArray:
    """A pose (4, 4) moved along the world's axes and turned about its own vertical."""
    turn = rotation_from_abc((moved.get("turn_deg", 0.0), 0.0, 0.0))
    shift = np.array([moved.get(axis, 0.0) for axis in "xyz"])
    return pose_of(pose[:3, 3] + shift, turn @ pose[:3, :3])


def with_tool(cell: Cell, moved: Mapping[str, float]) -> Cell:
    """The cell with its tool mounted elsewhere, the tcp with it."""
    turned = rotation_from_abc([moved.get(f"{name}_deg", 0.0) for name in "abc"])
    by = pose_of([moved.get(axis, 0.0) for axis in "xyz"], turned)
    assert cell.tool is not None  # settings ask for it
    return replace(cell, tool=cell.tool.placed(by), tcp=composed(by, cell.tcp))


def with_masses(cell: Cell, payload: Mapping[str, float]) -> Cell:
    """The cell with parts of other masses, as large as before."""
    parts = tuple(
        replace(part, load=of_mass(part.load, payload[part.name])) if part.name in payload else part
        for part in cell.parts
    )
    return replace(cell, parts=parts) if payload else cell


def of_mass(load: Load, mass: float) -> Load:
    """The same body of another density."""
    return replace(load, mass=mass, inertia=load.inertia * (mass / load.mass))
