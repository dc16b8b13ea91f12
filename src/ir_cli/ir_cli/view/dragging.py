"""The handle by which a machine or a station is dragged."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ir_description import Cell
from ir_description.poses import composed, inverse
from ir_msgs_py.arrays import FloatArray

from .moved import Target, pose_in
from .poses import meant, placed, pose_of_handle

SIZE = 0.6  # m


class Dragging:
    """At most one handle; `dragged` is called by any thread, with whether it was let go."""

    def __init__(self, scene: Any, dragged: Callable[[bool], None]) -> None:
        self._scene = scene
        self._dragged = dragged
        self.target: Target | None = None
        self._handle: Any = None

    def choose(self, target: Target | None, cell: Cell) -> None:
        """Show the handle at a target, None: nowhere."""
        if self._handle is not None:
            self._handle.remove()
        self.target = target
        self._handle = None
        if target is not None:
            self._handle = self._scene.add_transform_controls("/drag", scale=SIZE, depth_test=False)
            self.settle(cell)
            self._handle.on_update(lambda event: self._dragged(event.phase == "end"))

    def settle(self, cell: Cell) -> None:
        """Put the handle where its target stands."""
        if self.target is not None:
            kind = self.target.kind
            name = self.target.name
            placed(
                self._handle,
                cell.machine(name).pose if kind == "equipment" else cell.station(name).pose,
            )

    def pose(self, cell: Cell, file: Cell) -> FloatArray:
        """The target's pose (4, 4) where the handle is, on the grid of what is written; file: as it
        was.

        Raises ValueError or InvalidValueError for a pose that is none.
        """
        assert self.target is not None
        pose = pose_of_handle(self._handle)
        if self.target.kind != "equipment":
            machine = cell.machine(cell.station(self.target.name).equipment)
            pose = composed(inverse(machine.pose), pose)
        return meant(pose, pose_in(file, self.target))
