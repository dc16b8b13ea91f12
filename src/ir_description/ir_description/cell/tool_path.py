"""A path of the tool that a cell has a name for: a seam, an edge, a bead."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ir_description.cell.equipment import AllowedContact
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import CartesianPath
from ir_msgs_py.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class CellPath:
    """path: its poses are poses of the tcp in the cell. equipment: the machine that it belongs to
    and moves with, "": none. The allowed contacts hold inside that machine's zone, as a station's
    do.
    """

    name: str
    path: CartesianPath
    equipment: str = ""
    allowed_contacts: tuple[AllowedContact, ...] = ()

    def __post_init__(self) -> None:
        if self.allowed_contacts and not self.equipment:
            raise InvalidValueError(
                f"path {self.name} allows contacts but names no equipment: they hold in a "
                "machine's zone"
            )

    def moved(self, by: FloatArray) -> CellPath:
        """The path where its machine has been moved by a transform (4, 4) of the world."""
        segments = tuple(
            replace(segment, poses=tuple(by @ pose for pose in segment.poses))
            for segment in self.path.segments
        )
        return replace(self, path=replace(self.path, start=by @ self.path.start, segments=segments))
