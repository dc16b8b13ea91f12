"""Motions of a program as commands: targets, speeds and approximation as the system variables
stand.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import get_args

from ir_krl.errors import KrlRunError, Place
from ir_krl.language import Tree, place_of
from ir_krl.run.commands import Blend, Kind, Motion, Speeds, Target
from ir_krl.run.expressions import Expressions
from ir_krl.run.frames import (
    AXIS_NAMES,
    EXTERNAL_NAMES,
    FRAME_NAMES,
    axes,
    components,
    is_axis_value,
    pose,
)
from ir_krl.run.memory import Memory
from ir_krl.run.system import AXES, FULL, STANDING
from ir_krl.run.values import Structure, Symbol, integer, kind_of, number

_COMPONENTS = frozenset((*FRAME_NAMES, *AXIS_NAMES, *EXTERNAL_NAMES, "S", "T"))
_STANDS = 1e-3  # mm or deg: an external axis that moves by less stands
_KINDS: dict[str, Kind] = {kind: kind for kind in get_args(Kind)}
_MM = 1e-3  # m
_BLEND_WORDS = {"C_PTP": "CPTP", "C_DIS": "CDIS", "C_ORI": "CORI", "C_VEL": "CVEL", "C_SPL": "CDIS"}


class Motions:
    """Builds motions from trees; `expressions` evaluates what stands in them, `noted` hears
    assumptions.
    """

    def __init__(
        self, expressions: Expressions, memory: Memory, noted: Callable[[Place, str], None]
    ) -> None:
        self._expressions = expressions
        self._memory = memory
        self._noted = noted
        self._external: dict[str, float] = {}  # where the external axes stand, as the program says

    def motion(self, tree: Tree) -> Motion:
        """One of PTP, LIN, CIRC and their relatives, SPL. Raises KrlRunError."""
        kind: Kind = _KINDS[tree.data]
        word = str(tree.children[0]) if kind != "spl" else "SPL"
        place = place_of(tree, self._expressions.file)
        relative = word.endswith("_REL")
        frames = [
            child
            for child in tree.children
            if isinstance(child, Tree) and child.data not in _OTHERS
        ]
        in_tool = str(tree.children[-1]) == "#TOOL" if word in ("LIN_REL", "SLIN_REL") else False
        if kind == "circ":
            via = self.target(frames[0], relative, in_tool)
            end = self.target(frames[1], relative, in_tool)
            angle = (
                math.radians(self._expressions.number(frames[2], "CA")) if len(frames) > 2 else None
            )
        else:
            via = None
            end = self.target(frames[0], relative, in_tool)
            angle = None
        if kind in ("lin", "circ", "spl") and end.axes is not None:
            raise KrlRunError(f"{word} goes to a frame, not to axis angles", place)
        blend = next(
            (self.blend(child) for child in tree.children if _is(child, "approximation")), None
        )
        return Motion(
            kind, end, self.speeds(place), place, blend, via, angle, self._keeps_orientation()
        )

    def target(self, tree: Tree, relative: bool, in_tool: bool) -> Target:
        """Where an expression leads to."""
        place = place_of(tree, self._expressions.file)
        if tree.data == "access" and str(tree.children[0]) in STANDING:
            return self._here(str(tree.children[0]), place)
        value = self._expressions.value(tree)
        if not isinstance(value, Structure):
            raise KrlRunError(f"a motion can't go to {kind_of(value)}", place)
        self._check_components(value, relative, place)
        base, tool = (
            pose(self._memory.get(((name, None),), place), name, place)
            for name in ("$BASE", "$TOOL")
        )
        name = str(tree.children[0]) if tree.data == "access" else ""
        if is_axis_value(value):
            return Target(axes(value, place), None, None, None, relative, in_tool, base, tool, name)
        frame = components(value, FRAME_NAMES, place)
        if not frame:
            raise KrlRunError(f"a motion can't go to {kind_of(value)}", place)
        status, turn = (
            integer(value.fields[part], part, place) if part in value.fields else None
            for part in ("S", "T")
        )
        return Target(None, frame, status, turn, relative, in_tool, base, tool, name)

    def _check_components(self, value: Structure, relative: bool, place: Place) -> None:
        """Raise KrlRunError for a component that no position has, and for an external axis that
        moves.
        """
        unknown = next((name for name in value.fields if name not in _COMPONENTS), None)
        if unknown is not None:
            raise KrlRunError(f"{unknown} is no component of a position", place)
        for name, at in components(value, EXTERNAL_NAMES, place).items():
            before = self._external.setdefault(name, 0.0 if relative else at)
            if abs(at if relative else at - before) > _STANDS:
                raise KrlRunError(
                    f"{name} moves from {before:g} to {at:g}: external axes aren't read", place
                )
            if before != 0.0:
                self._noted(
                    place,
                    f"{name} stays at {before:g}: external axes are taken as part of the cell",
                )

    def _here(self, name: str, place: Place) -> Target:
        """Where the robot stands: PTP $AXIS_ACT, as programs begin."""
        if name.startswith("$AXIS"):
            axis: dict[str, float] | None = {"A1": 0.0}
            frame = None
        else:
            axis = None
            frame = dict.fromkeys(FRAME_NAMES[:3], 0.0)
        base, tool = (
            pose(self._memory.get(((n, None),), place), n, place) for n in ("$BASE", "$TOOL")
        )
        return Target(axis, frame, None, None, True, False, base, tool, name)

    def speeds(self, place: Place) -> Speeds:
        """How fast the system variables say; each bounded by what a controller takes."""
        velocity, acceleration = (
            tuple(self._share(name, (j,), place) for j in range(1, AXES + 1))
            for name in ("$VEL_AXIS", "$ACC_AXIS")
        )
        return Speeds(
            velocity,
            acceleration,
            self._positive("$VEL", "CP", place),
            self._positive("$ACC", "CP", place),
            math.radians(self._positive("$VEL", "ORI1", place)),
            math.radians(self._positive("$ACC", "ORI1", place)),
            self._share("$OV_PRO", None, place),
        )

    def blend(self, tree: Tree) -> Blend | None:
        """Approximate positioning as the words of `tree` ask for it; None without a word."""
        words = [str(word) for word in tree.children]
        if not words:
            return None
        place = place_of(tree, self._expressions.file)
        how = words[-1]  # C_PTP C_DIS: the second is how a CP motion follows
        amount = self._number("$APO", _BLEND_WORDS[how], place)
        if how in ("C_PTP", "C_VEL"):
            return Blend(how, 0.0, min(max(amount, 0.0), FULL) / FULL)
        return Blend(how, max(amount, 0.0) * _MM, 1.0)

    def _keeps_orientation(self) -> bool:
        return self._memory.shared.get("$ORI_TYPE") == Symbol("CONSTANT")

    def _number(self, variable: str, component: str, place: Place) -> float:
        value = self._memory.get(((variable, None), (component, None)), place)
        return number(value, f"{variable}.{component}", place)

    def _positive(self, variable: str, component: str, place: Place) -> float:
        value = self._number(variable, component, place)
        if value <= 0.0:
            raise KrlRunError(f"{variable}.{component} is {value:g}; it must be above 0", place)
        return value

    def _share(self, name: str, index: tuple[int, ...] | None, place: Place) -> float:
        value = number(self._memory.get(((name, index),), place), name, place)
        if not 0.0 < value <= FULL:
            raise KrlRunError(f"{name} is {value:g} %; it must be above 0 and at most 100 %", place)
        return value / FULL


_OTHERS = ("settings", "approximation")


def _is(child: object, data: str) -> bool:
    return isinstance(child, Tree) and child.data == data
