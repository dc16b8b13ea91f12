"""A path of the tool that a cell has a name for: a seam, an edge, a bead."""

from dataclasses import dataclass

from ir_msgs_py.cartesian import CartesianPath


@dataclass(frozen=True, eq=False)
class CellPath:
    """path: its poses are poses of the tcp in the cell."""

    name: str
    path: CartesianPath
