"""Which states of machines a movement relies on: those without which its clearance would be
violated.
"""

from dataclasses import dataclass, field, replace

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import clearance_violation
from ir_planner.scene import PlanningScene


@dataclass
class Reliance:
    """Of movements that keep `safety_distance` [m]; each is checked once, in every other state of
    every machine.
    """

    safety_distance: float
    _scenes: dict[int, tuple[PlanningScene, tuple[tuple[str, PlanningScene], ...]]] = field(
        default_factory=dict
    )
    _found: dict[tuple[int, str, str], tuple[str, ...]] = field(default_factory=dict)

    def of(
        self, trajectory: JointTrajectory, scene: PlanningScene, station: str
    ) -> tuple[str, ...]:
        """States that a movement in a scene relies on, such as "lathe=door_open"."""
        key = id(scene), trajectory.trajectory_id, station
        if key not in self._found:
            relied = (
                text
                for text, other in self._otherwise(scene)
                if clearance_violation(trajectory, other, self.safety_distance, station) is not None
            )
            self._found[key] = tuple(dict.fromkeys(relied))
        return self._found[key]

    def _otherwise(self, scene: PlanningScene) -> tuple[tuple[str, PlanningScene], ...]:
        """The scene in every other state of its machines, with the state that it is in; it is kept,
        so that nobody else gets its id.
        """
        if id(scene) not in self._scenes:
            others = tuple(
                (
                    f"{machine.name}={machine.state}",
                    replace(scene, cell=scene.cell.with_equipment(machine.name, state=state.name)),
                )
                for machine in scene.cell.equipment
                if machine.enabled
                for state in machine.states
                if state.name != machine.state
            )
            self._scenes[id(scene)] = scene, others
        return self._scenes[id(scene)][1]
