"""What a planner assumes of the drives: braking energy, the torque left to the feedback, what
joules follow from.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from ir_description import Load, PowerData, PowerParameters, RobotModel
from ir_kernels.power import Regeneration
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError


@dataclass(frozen=True)
class Drives:
    """regeneration: what the bus does with braking energy. torque_reserve: share of the torque
    envelope that plans leave to the feedback. parameters: None, as the data have them.
    """

    regeneration: Regeneration = "shared"
    torque_reserve: float = 0.0
    parameters: PowerParameters | None = None

    @property
    def rectifier_efficiency(self) -> float:
        """Share of the mains power that reaches the bus."""
        return 1.0 if self.parameters is None else self.parameters.value("rectifier_efficiency")

    def robot(self, robot: RobotModel) -> RobotModel:
        """The robot with the friction, losses and masses of the parameters. Raises RequestError for
        those of another robot.
        """
        own = self.parameters
        if own is None:
            return robot
        if (own.robot, own.joints) != (robot.name, robot.joint_names):
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"power parameters {own.name!r} are of robot {own.robot!r}: the cell has "
                f"{robot.name!r}",
            )
        return own.robot_with(robot)

    def loads(self, loads: Iterable[Load]) -> tuple[Load, ...]:
        """Loads with the masses and watts of the parameters."""
        return tuple(loads) if self.parameters is None else self.parameters.loads_with(loads)

    def power(self, power: PowerData) -> PowerData:
        """The controller with the watts of the parameters."""
        return power if self.parameters is None else self.parameters.power_with(power)
