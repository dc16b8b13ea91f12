"""What a request for a path asks for."""

from dataclasses import dataclass

from ir_msgs_py.cartesian import CartesianPath
from ir_planner.cartesian.tool_path import ToolPath
from ir_planner.checks import FreeSpace
from ir_planner.request import Context


@dataclass(frozen=True, eq=False)
class Asked:
    """The path, as it is drawn, whether its first configuration is given, and T1."""

    path: CartesianPath
    whole: ToolPath
    fixed: bool
    t1: bool
    context: Context

    @property
    def space(self) -> FreeSpace:
        """Where configurations may be."""
        context = self.context
        return FreeSpace.of(context.scene, context.safety_distance, context.work, context.station)
