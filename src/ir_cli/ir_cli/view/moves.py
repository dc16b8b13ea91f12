"""Machines and stations moved by hand: the moved cell, and the edited text of its file.

Only the numbers of the poses are replaced in the text: comments, order and layout stay. The result
is read again and compared with the picture before it is kept.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import yaml

from ir_description import Cell
from ir_description.poses import abc_from_rotation, composed, inverse, pose_of, rotation_from_abc
from ir_planner.curves import turn_of
from ir_values.arrays import FloatArray

# Poses of a hand on the grid of millimetres and tenths of a degree.

MILLIMETRE = 3  # digits of m
TENTH = 1  # digits of deg
_SAME_PLACE = 2e-6  # m: a browser's numbers have 24 bits
_SAME_TURN = 1e-5  # rad
FARTHEST = 100.0
"""m: beyond, nothing of a cell stands."""


def numbers_of(pose: FloatArray) -> list[float]:
    """x, y, z [m], A, B, C [deg] of a pose (4, 4)."""
    abc = abc_from_rotation(pose[:3, :3])
    return [round(float(value), 6) for value in (*pose[:3, 3], *abc)]


def pose_of_numbers(values: Sequence[float]) -> FloatArray:
    """The pose (4, 4) of x, y, z [m], A, B, C [deg]. Raises ValueError for numbers that are
    none.
    """
    numbers = np.array(values, dtype=float)
    if numbers.shape != (6,) or not np.isfinite(numbers).all():
        raise ValueError("a pose must be six finite numbers: x, y, z in m, A, B, C in degrees")
    if np.abs(numbers[:3]).max() > FARTHEST:
        raise ValueError(f"a pose must be within {FARTHEST:g} m of the world's origin")
    return pose_of(numbers[:3], rotation_from_abc(numbers[3:]))


def meant(dragged: FloatArray, before: FloatArray) -> FloatArray:
    """A dragged pose (4, 4) on the grid of what is written; what did not move stays as it was
    before.
    """
    moved = np.abs(dragged[:3, 3] - before[:3, 3]) > _SAME_PLACE
    xyz = np.where(moved, np.round(dragged[:3, 3], MILLIMETRE), before[:3, 3])
    turned = turn_of(dragged[:3, :3] @ before[:3, :3].T) > _SAME_TURN
    if not turned:
        return pose_of(xyz, before[:3, :3])
    return pose_of(xyz, rotation_from_abc(np.round(abc_from_rotation(dragged[:3, :3]), TENTH)))


# The moved cell, and the text of its file.

Kind = str
"""equipment or station."""
_TURNS = ("abc_deg", "quaternion", "rotation")
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True)
class DragTarget:
    """What is dragged: a machine, or a station within its machine."""

    kind: Kind
    name: str

    @property
    def text(self) -> str:
        """As it stands in a list."""
        return f"{'machine' if self.kind == 'equipment' else self.kind} {self.name}"


Moves = Mapping[DragTarget, FloatArray]
"""New poses (4, 4): of machines in the world, of stations in their machine."""


def targets(cell: Cell) -> list[DragTarget]:
    """Everything in a cell that can be dragged."""
    machines = [
        DragTarget("equipment", machine.name) for machine in cell.equipment if machine.enabled
    ]
    return [*machines, *(DragTarget("station", station.name) for station in cell.stations)]


def pose_in(cell: Cell, target: DragTarget) -> FloatArray:
    """The pose (4, 4) of a target, as a move gives it."""
    if target.kind == "equipment":
        return cell.machine(target.name).pose
    return cell.station(target.name).pose_in_equipment


def cell_with(cell: Cell, moves: Moves) -> Cell:
    """The cell after all moves; raises what a cell raises for places that it can't have."""
    for target, pose in moves.items():
        if target.kind == "equipment":
            cell = cell.with_equipment(target.name, pose=pose)
        else:
            cell = cell.with_station(target.name, pose)
    return cell


def snippet(moves: Moves) -> str:
    """The moved poses as lines of YAML to paste."""
    lines = []
    for target, pose in moves.items():
        lines += [f"# {target.text}", f"pose: {{{_pose_text(pose)}}}"]
    return "\n".join(lines)


def edited(text: str, cell: Cell, moves: Moves) -> str:
    """The text of the file of `cell` with the moves. ValueError where a pose can't be found in
    it.
    """
    changes: list[tuple[int, int, str]] = []
    places = dict(_places(yaml.compose(text, Loader=_LOADER)))
    for target, pose in moves.items():
        if target not in places:
            raise ValueError(f"{target.text} was not found in the file")
        changes += _changes(places[target], pose_in(cell, target), pose)
    for start, end, new in sorted(changes, reverse=True):
        text = text[:start] + new + text[end:]
    return text


def _places(root: yaml.Node | None) -> Iterator[tuple[DragTarget, yaml.MappingNode]]:
    """Every machine and station of a document with its mapping."""
    for machine in _items(_value(root, "equipment")):
        yield DragTarget("equipment", _scalar(_value(machine, "name"))), machine
        for station in _items(_value(machine, "stations")):
            yield DragTarget("station", _scalar(_value(station, "name"))), station


def _changes(
    place: yaml.MappingNode, before: FloatArray, after: FloatArray
) -> Iterator[tuple[int, int, str]]:
    pose = _value(place, "pose")
    if not isinstance(pose, yaml.MappingNode) or not pose.value:
        if pose is not None:
            yield pose.start_mark.index, pose.end_mark.index, f"{{{_pose_text(after)}}}"
        else:
            yield _after(place, f"pose: {{{_pose_text(after)}}}", 0)
        return
    if not np.array_equal(before[:3, 3], after[:3, 3]):
        xyz = _value(pose, "xyz")
        if isinstance(xyz, yaml.SequenceNode):
            for item, value in zip(xyz.value, after[:3, 3], strict=True):
                yield _start(item), _end(item), _number(float(value))
        else:
            yield _after(pose, f"xyz: {_list_text(after[:3, 3], None)}", -1)
    if not np.array_equal(before[:3, :3], after[:3, :3]):
        turn = f"abc_deg: {_list_text(abc_from_rotation(after[:3, :3]), TENTH)}"
        for key, value in pose.value:
            if key.value in _TURNS:
                yield _start(key), _end(value), turn
                return
        yield _after(pose, turn, -1)


def _after(mapping: yaml.MappingNode, entry: str, which: int) -> tuple[int, int, str]:
    """A further entry of a mapping, after its first or last one."""
    key, value = mapping.value[which]
    end = _end(value)
    if mapping.flow_style:
        return end, end, f", {entry}"
    return end, end, f"\n{' ' * key.start_mark.column}{entry}"


def _start(node: yaml.Node) -> int:
    return int(node.start_mark.index)


def _end(node: yaml.Node) -> int:
    """Where a value ends; a block's own mark stands behind the comments that follow it."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(last[1] if isinstance(last, tuple) else last)
    return int(node.end_mark.index)


def _value(node: yaml.Node | None, key: str) -> yaml.Node | None:
    if not isinstance(node, yaml.MappingNode):
        return None
    return next((value for name, value in node.value if name.value == key), None)


def _items(node: yaml.Node | None) -> list[yaml.MappingNode]:
    values = node.value if isinstance(node, yaml.SequenceNode) else []
    return [each for each in values if isinstance(each, yaml.MappingNode)]


def _scalar(node: yaml.Node | None) -> str:
    return str(node.value) if isinstance(node, yaml.ScalarNode) else ""


def _pose_text(pose: FloatArray) -> str:
    xyz = f"xyz: {_list_text(pose[:3, 3], None)}"
    if np.array_equal(pose[:3, :3], np.eye(3)):
        return xyz
    return f"{xyz}, abc_deg: {_list_text(abc_from_rotation(pose[:3, :3]), TENTH)}"


def _list_text(values: FloatArray, digits: int | None) -> str:
    """Numbers as people write them; without digits the shortest that give the same."""
    rounded = [float(value) if digits is None else round(float(value), digits) for value in values]
    return f"[{', '.join(map(_number, rounded))}]"


def _number(value: float) -> str:
    return repr(value + 0.0).removesuffix(".0")


def moved_pose(target: DragTarget, pose: FloatArray, cell: Cell, file: Cell) -> FloatArray:
    """The pose (4, 4) of a move that puts a target at `pose` in the world, on the grid of what is
    written; file: as it was.
    """
    if target.kind != "equipment":
        machine = cell.machine(cell.station(target.name).equipment)
        pose = composed(inverse(machine.pose), pose)
    return meant(pose, pose_in(file, target))
