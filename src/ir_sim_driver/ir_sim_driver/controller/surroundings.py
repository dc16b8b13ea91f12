"""The cell that the driver takes itself to stand in: its own at the start, then the one that the
planner publishes.

What was planned in another cell, or with another load, is refused with both named.
"""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import NamedTuple

import numpy as np

from ir_description import Cell, cell_hash
from ir_msgs_py.names import LOAD_SEPARATOR
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.motion import TrajectoryGoal
from ir_sim_driver.plant import CUSTOM, Carried, carried

PATIENCE = 1.0  # s: a trajectory may be faster than the cell that it was planned in
_LENGTH = 16  # digits of a hash
_SAME = 1e-9  # of a rotation's entries


class PlannedCell(NamedTuple):
    """A cell and its hash."""

    cell: Cell
    hash: str


def digest(value: object) -> str:
    """Hash of all that a description holds, by content."""
    text = hashlib.sha256()
    for part in _content(value):
        text.update(part)
    return text.hexdigest()[:_LENGTH]


def _content(value: object) -> Iterator[bytes]:
    """Everything in a value of dataclasses, arrays, collections and plain values, in order."""
    if isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}".encode()
        yield np.ascontiguousarray(value).tobytes()
    elif is_dataclass(value) and not isinstance(value, type):
        yield type(value).__name__.encode()
        for each in fields(value):
            yield each.name.encode()
            yield from _content(getattr(value, each.name))
    elif isinstance(value, Mapping):
        for key in sorted(value, key=str):
            yield repr(key).encode()
            yield from _content(value[key])
    elif isinstance(value, (tuple, list)):
        yield str(len(value)).encode()
        for item in value:
            yield from _content(item)
    else:
        yield repr(value).encode()


class MovedSurroundings:
    """cell: the one that counts. `offered`: one that counts as soon as the robot stands."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self._robot = digest(cell.robot)
        self._hash = ""
        self.offered: PlannedCell | None = None
        self._changed = threading.Condition()

    @property
    def hash(self) -> str:
        """Content hash of the cell; made when it is first asked for."""
        self._hash = self._hash or cell_hash(self.cell)
        return self._hash

    def offer(self, planned: PlannedCell) -> str:
        """Take a cell as soon as the robot stands; why not, "" when it will be taken."""
        reason = self.refusal_of(planned.cell)
        if not reason:
            self.offered = planned
        return reason

    def take(self) -> PlannedCell | None:
        """What is offered where it is another cell; it counts from `settle` on."""
        planned = self.offered
        self.offered = None
        return None if planned is None or planned.hash == self.hash else planned

    def settle(self, planned: PlannedCell) -> None:
        """Stand in this cell, with all that depends on it; who waits for it goes on."""
        with self._changed:
            self.cell, self._hash = planned
            self._changed.notify_all()

    def wait_for(self, expected: str) -> None:
        """Give the cell of this hash the time to come; must not be called by who steps the
        simulation.
        """
        if expected and expected != self.hash:
            with self._changed:
                self._changed.wait_for(lambda: expected == self.hash, PATIENCE)

    def refusal(self, goal: TrajectoryGoal, load: Carried) -> str:
        """Why a trajectory that was planned elsewhere is not executed here, "" when it may be."""
        if goal.cell_hash and goal.cell_hash != self.hash:
            return (
                f"the trajectory was planned in a cell with hash {goal.cell_hash[:32]!a}, the "
                f"robot stands in cell {self.cell.name!r} with hash {self.hash!r}: plan it again"
            )
        if goal.load and _names(goal.load) != _names(load.text):
            return (
                f"the trajectory was planned with load {goal.load[:80]!a}, the robot carries "
                f"{load.text!r}"
            )
        return ""

    def load_in(self, cell: Cell, load: Carried) -> tuple[Carried, str]:
        """What is carried as another cell describes it, and a warning: unknown there, it stays as
        it is.

        The tool of this cell becomes the tool of that one.
        """
        if load.text == CUSTOM:
            return load, ""
        tool = cell.tool
        old = self.cell.tool
        names = load.text.split(LOAD_SEPARATOR)
        if tool is not None and old is not None:
            names = [tool.name if name == old.name else name for name in names]
        try:
            return carried(cell, LOAD_SEPARATOR.join(names)), ""
        except RequestRefusedError as error:
            return load, f"load {load.text!r} is kept as it is in cell {cell.name!r}: {error}"

    def refusal_of(self, cell: Cell) -> str:
        """Why a cell can't be this robot's, "" when it can."""
        if cell.robot.name != self.cell.robot.name:
            return f"its robot is {cell.robot.name!r}, the driver's is {self.cell.robot.name!r}"
        if cell.robot is not self.cell.robot and digest(cell.robot) != self._robot:
            return (
                f"its robot is called {cell.robot.name!r} as the driver's, but its data differ: "
                f"hash {digest(cell.robot)}, the driver's is {self._robot}"
            )
        turned = np.abs(cell.base_pose[:3, :3] - self.cell.base_pose[:3, :3]).max()
        return "" if turned < _SAME else "its robot stands at another inclination or heading"


def _names(load: str) -> set[str]:
    return set(load.split(LOAD_SEPARATOR))
