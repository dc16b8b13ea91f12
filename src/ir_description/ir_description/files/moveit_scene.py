"""Scenes as MoveIt's text files hold them (.scene): objects with boxes, spheres, cylinders, meshes.

Their poses are in the planning frame, which is taken for the world of the cell.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ir_description.poses import pose_of, rotation_from_quaternion
from ir_values.arrays import FloatArray, number_of
from ir_values.errors import InvalidValueError, shown

_COUNT = 200_000  # lines of a mesh, and shapes of an object
_LENGTHS = {"box": 3, "sphere": 1, "cylinder": 2, "cone": 2, "plane": 4}


@dataclass(frozen=True, eq=False)
class SceneShape:
    """kind: "box", "sphere", "cylinder", "mesh", "cone" or "plane"; size: its lengths [m]; pose (4,
    4) in its object; triangles (T, 3, 3) [m] of a mesh, (0, 3, 3) for others.
    """

    kind: str
    size: FloatArray
    pose: FloatArray
    triangles: FloatArray


@dataclass(frozen=True, eq=False)
class SceneObject:
    """An object, its pose (4, 4) in the planning frame, and its shapes."""

    name: str
    pose: FloatArray
    shapes: tuple[SceneShape, ...]


def scene_objects(text: str) -> tuple[str, tuple[SceneObject, ...]]:
    """Name and objects of a scene. Raises InvalidValueError with the line of what is wrong."""
    lines = _Lines(text)
    first = text.partition("\n")[0].strip()  # the name may be empty
    name = lines.take("the name of the scene") if first else ""
    objects = []
    while (start := lines.take("'* NAME' or '.'")) != ".":
        if not start.startswith("*"):
            lines.fail(f"is {shown(start)}, must be '* NAME' of an object or '.'")
        objects.append(_object(lines, start[1:].strip() or "object"))
    lines.end()
    return name, tuple(objects)


class _Lines:
    """Lines of the text that are not empty, taken one after the other."""

    def __init__(self, text: str) -> None:
        numbered = enumerate(text.splitlines(), start=1)
        self._left: Iterator[tuple[int, str]] = (
            (k, line.strip()) for k, line in numbered if line.strip()
        )
        self._number = 0

    def take(self, what: str) -> str:
        line = next(self._left, None)
        if line is None:
            raise InvalidValueError(f"the scene ends after line {self._number}, must have {what}")
        self._number, text = line
        return text

    def numbers(self, count: int, what: str, text: str | None = None) -> FloatArray:
        text = self.take(what) if text is None else text
        try:
            values = np.array([number_of(word) for word in text.split()])
        except ValueError:
            values = np.zeros(0)
        if len(values) != count or not np.isfinite(values).all():
            self.fail(f"is {shown(text)}, must be {count} finite numbers: {what}")
        return values

    def count(self, what: str, text: str | None = None) -> int:
        value = float(self.numbers(1, what, text)[0])
        if not (0.0 <= value <= _COUNT and value == int(value)):
            self.fail(f"is {value:g}, must be a whole number up to {_COUNT}: {what}")
        return int(value)

    def end(self) -> None:
        """Raise InvalidValueError where more follows."""
        left = next(self._left, None)
        if left is not None:
            self._number, text = left
            self.fail(f"is {shown(text)}, after the '.' that ends the scene")

    def fail(self, sentence: str) -> None:
        raise InvalidValueError(f"line {self._number} of the scene {sentence}")


def _object(lines: _Lines, name: str) -> SceneObject:
    first = lines.take("a pose or a number of shapes")
    pose = np.eye(4)
    poses_subframes = len(first.split()) == 3  # scenes of MoveIt 1.0 have neither
    if poses_subframes:
        pose = _pose(lines, lines.numbers(3, "position", first))
        count = lines.count("number of shapes")
    else:
        count = lines.count("number of shapes", first)
    shapes = tuple(_shape(lines) for _ in range(count))
    if poses_subframes:
        for _ in range(lines.count("number of subframes")):
            lines.take("name of a subframe")
            _pose(lines, lines.numbers(3, "position"))
    return SceneObject(name, pose, shapes)


def _shape(lines: _Lines) -> SceneShape:
    kind = lines.take("a kind of shape")
    size = np.zeros(0)
    triangles = np.zeros((0, 3, 3))
    if kind == "mesh":
        counts = lines.numbers(2, "numbers of corners and triangles").astype(int)
        if counts.min() < 1 or counts.max() > _COUNT:
            lines.fail(f"has counts of a mesh that are not 1 to {_COUNT}")
        corners = np.array([lines.numbers(3, "a corner") for _ in range(counts[0])])
        rows = np.array([lines.numbers(3, "a triangle") for _ in range(counts[1])])
        if rows.min() < 0 or rows.max() >= counts[0] or (rows != np.floor(rows)).any():
            lines.fail(f"ends a mesh that names corners beyond its {counts[0]}")
        triangles = corners[rows.astype(int)]
    elif kind in _LENGTHS:
        size = lines.numbers(_LENGTHS[kind], f"lengths of a {kind}")
    else:
        lines.fail(f"is {shown(kind)}: {', '.join(_LENGTHS)} and mesh are known")
    pose = _pose(lines, lines.numbers(3, "position of a shape"))
    lines.numbers(4, "colour of a shape")
    return SceneShape(kind, size, pose, triangles)


def _pose(lines: _Lines, position: FloatArray) -> FloatArray:
    quaternion = lines.numbers(4, "quaternion x y z w")
    if abs(float(np.linalg.norm(quaternion)) - 1.0) > 1e-3:  # of printed digits
        lines.fail(f"is no quaternion of length 1: {quaternion.tolist()}")
    turn = rotation_from_quaternion(quaternion / np.linalg.norm(quaternion))
    return pose_of(position, turn)
