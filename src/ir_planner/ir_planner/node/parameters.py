"""The planner's settings as ROS parameters; a change counts from the next request on."""

from collections.abc import Callable

from ir_msgs_py.ros.parameters import Parameters
from ir_msgs_py.transitions import PREFIX, TransitionTimes
from rclpy.node import Node

from ir_planner.configurations import InteractionSettings
from ir_planner.search import GeneticSettings
from ir_planner.service import ModifiedGa
from ir_planner.settings import PlannerSettings


class PlannerParameters:
    """Declared on the node: the planner's own, the times of the power modes under "transitions.", the two
    stages of service movements under "interaction." and "withdrawal.", and the genetic correction of regional
    movements under "genetic.".
    """

    def __init__(
        self,
        node: Node,
        on_planner: Callable[[PlannerSettings], None],
        on_pauses: Callable[[TransitionTimes], None],
        on_interaction: Callable[[InteractionSettings], None],
        on_withdrawal: Callable[[ModifiedGa], None],
        on_genetic: Callable[[GeneticSettings], None],
    ) -> None:
        self._planner = Parameters(node, PlannerSettings, on_change=on_planner)
        self._pauses = Parameters(node, TransitionTimes, prefix=PREFIX, on_change=on_pauses)
        self._interaction = Parameters(
            node, InteractionSettings, prefix="interaction.", on_change=on_interaction
        )
        self._withdrawal = Parameters(node, ModifiedGa, prefix="withdrawal.", on_change=on_withdrawal)
        self._genetic = Parameters(node, GeneticSettings, prefix="genetic.", on_change=on_genetic)

    @property
    def planner(self) -> PlannerSettings:
        """In force now."""
        return self._planner.value

    @property
    def pauses(self) -> TransitionTimes:
        """In force now."""
        return self._pauses.value

    @property
    def interaction(self) -> InteractionSettings:
        """In force now."""
        return self._interaction.value

    @property
    def withdrawal(self) -> ModifiedGa:
        """In force now."""
        return self._withdrawal.value

    @property
    def genetic(self) -> GeneticSettings:
        """In force now."""
        return self._genetic.value
