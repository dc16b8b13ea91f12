"""The planner's settings as ROS parameters; a change counts from the next request on."""

from collections.abc import Callable

from ir_msgs_py.ros.parameters import Parameters
from rclpy.node import Node

from ir_planner.settings import PauseSettings, PlannerSettings


class PlannerParameters:
    """Declared on the node: the planner's own, and the times of the power modes under "transitions."."""

    def __init__(
        self,
        node: Node,
        on_planner: Callable[[PlannerSettings], None],
        on_pauses: Callable[[PauseSettings], None],
    ) -> None:
        self._planner = Parameters(node, PlannerSettings, on_change=on_planner)
        self._pauses = Parameters(node, PauseSettings, prefix="transitions.", on_change=on_pauses)

    @property
    def planner(self) -> PlannerSettings:
        """In force now."""
        return self._planner.value

    @property
    def pauses(self) -> PauseSettings:
        """In force now."""
        return self._pauses.value
