"""Where the parts of the cell are: held by the robot, lying where they were put down, or not
there.
"""

from __future__ import annotations

from ir_description import Body, Cell
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.plant import Carried


class Parts:
    """Parts of `cell`; a part lies as it was held when the tcp stood at its place (4, 4)."""

    def __init__(self, cell: Cell, load: Carried) -> None:
        self.stand_in(cell, load)

    def stand_in(self, cell: Cell, load: Carried) -> None:
        """Parts of another cell lie where that says, but for those that are held."""
        self.cell = cell
        self._held = _parts_of(load)
        self._places = {
            part.name: cell.station(part.station).pose
            for part in cell.parts
            if part.station and part.name not in self._held
        }

    def carry(self, load: Carried, tcp: FloatArray) -> None:
        """Hold the parts of this load from now on; what is let go stays where the tcp (4, 4) is."""
        held = _parts_of(load)
        known = {part.name for part in self.cell.parts}
        for name in self._held - held:
            if name in known:
                self._places[name] = tcp
        for name in held:
            self._places.pop(name, None)
        self._held = held

    def bodies(self) -> tuple[Body, ...]:
        """What lies there, in the world."""
        return tuple(
            body for name, pose in self._places.items() for body in self.cell.part(name).lying(pose)
        )


def _parts_of(load: Carried) -> set[str]:
    return {each.name for each in load.loads if each.kind == "part"}
