"""A configuration at a stop with its service line: what the layers of the station graph consist of."""

from dataclasses import dataclass

from ir_msgs_py.arrays import FloatArray
from ir_planner.service import ServiceLine


@dataclass(frozen=True, eq=False)
class Node:
    """Where the arm works at a stop, and where nothing else may be near it (`outside`)."""

    line: ServiceLine

    @property
    def interaction(self) -> FloatArray:
        """At the stop (n,)."""
        return self.line.interaction

    @property
    def outside(self) -> FloatArray:
        """Where regional movements start and end (n,)."""
        return self.line.outside
