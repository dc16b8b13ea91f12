"""What stands in the picture: the cell, the robot with what it holds, and in red what is wrong."""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any

import numpy as np

from ir_description import Cell, PartPlaces
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import PlannedMovement

from ..deep.stations import MARGIN
from .drawing import Drawing
from .judged import Judged
from .named import names_in
from .near import Nearest, NearestPairs
from .panel import bad, box, plain


class Stage:
    """A cell as it is shown, its robot at q (n,).

    found, failure and errors say what is wrong with it, note what happened last.
    """

    def __init__(self, server: Any, cell: Cell, source: str, q: FloatArray) -> None:
        self._server = server
        self._source = source
        self._pairs = NearestPairs()
        self.cell = cell
        self._now = cell
        self.q = q
        self.held = cell.tool.name if cell.tool is not None else ""
        self.places = cell.parts_at_start()
        self.near: Nearest | None = None
        self.found: tuple[Judged, ...] = ()
        self.errors: tuple[str, ...] = ()
        self.failure = self.note = ""
        self.drawing = Drawing(server.scene, cell)
        self.drawing.lie(self.places, self.held)

    def together(self) -> AbstractContextManager[None]:
        """What is changed inside the block is seen at once."""
        context: AbstractContextManager[None] = self._server.atomic()
        return context

    def move(self, cell: Cell) -> None:
        """Another version of the same cell: machines and stations stand elsewhere."""
        self.cell = self._now = cell
        self.drawing.move(cell)
        self.drawing.states(cell)
        self.drawing.lie(self.places, self.held)
        self.drawing.path(None)

    def hold(self, load: str, places: PartPlaces, cell: Cell | None = None) -> None:
        """What the robot holds, where the parts lie, and the cell with its machines in other
        states.
        """
        now = cell or self.cell
        if now is not self._now:
            self._now = now
            self.drawing.states(now)
        if (load, places) != (self.held, self.places):
            self.held = load
            self.places = places
            self.drawing.lie(places, load)

    def stand(self, q: FloatArray, movement: PlannedMovement | None = None) -> None:
        """Put the robot at q (n,), on its course in a movement or by hand."""
        self.q = q
        self.drawing.stand(q)
        self.near = near = self._pairs.at(self._now, q, self.held, self.places, movement)
        if near is not None:
            self.drawing.nearest(near.point_a, near.point_b, near.text, near.distance < MARGIN)
        self.blame()

    def blame(self) -> None:
        """Show in red what is too near or obstructs."""
        names = set(names_in(f"{self.failure} {' '.join(self.errors)}", self.cell))
        names.update(name for each in self.found if not each.free for name in each.pair)
        if self.near is not None and self.near.distance < MARGIN:
            names.update(self.near.names)
        self.drawing.highlight(names)

    def lines(self) -> str:
        """The state of the file, the nearest pair, and what happened last, as HTML."""
        lines = [f"{plain(self.cell.name)}, {plain(self._source)}"]
        if self.errors:
            lines.append(bad("the file can't be read; the last cell that could be read is shown:"))
            lines += map(plain, self.errors)
        if self.near is not None:
            words = bad if self.near.distance < MARGIN else plain
            lines.append(words(f"nearest {self.near.text}"))
        if self.note:
            lines.append(plain(self.note))
        return box(lines)

    def configuration(self, name: str) -> FloatArray | None:
        """Joint values (n,) of a posture, or of the best configuration at a station with what is
        held there; None, and a note, where there is none.
        """
        if name in ("home", "park"):
            return np.array(self.cell.posture(name))
        found = [each for each in self.found if each.station == name]
        chosen = next((each for each in found if each.free), found[0] if found else None)
        if chosen is None or chosen.q is None:
            self.note = chosen.sentence if chosen is not None else f"{name} is being checked"
            return None
        self.hold(chosen.load, self.places)
        return chosen.q
