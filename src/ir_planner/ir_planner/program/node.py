"""A configuration at a stop with its service line: what the layers of the station graph consist
of.
"""

from dataclasses import dataclass

from ir_msgs_py.arrays import FloatArray
from ir_planner.service import ServiceLine
from ir_planner.timing import Movement


@dataclass(frozen=True, eq=False)
class Node:
    """Where the arm works at a stop, and where nothing else may be near it (the outer end of its
    line).

    driven: the movement along a stop that is a path. Its line leads from the path's beginning to
    its end, and the arm leaves from there.
    """

    line: ServiceLine
    driven: Movement | None = None

    @property
    def interaction(self) -> FloatArray:
        """At the stop, at the end of a path (n,)."""
        return self.line.interaction

    @property
    def arrival(self) -> FloatArray:
        """Where a regional movement to the stop ends (n,)."""
        return self.line.outside

    @property
    def departure(self) -> FloatArray:
        """Where a regional movement from the stop starts (n,)."""
        return self.line.outside if self.driven is None else self.line.interaction

    @property
    def enters(self) -> bool:
        """Whether the arm moves from its arrival to where it works."""
        return len(self.line.points) > 1

    @property
    def leaves(self) -> bool:
        """Whether it moves from there to its departure."""
        return self.enters and self.driven is None
