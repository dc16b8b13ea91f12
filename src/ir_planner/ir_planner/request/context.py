"""What every stage of one request needs to know, as one value."""

from dataclasses import dataclass, replace

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_planner.request.journal import Journal
from ir_planner.request.work import Work
from ir_planner.scene import MotionLimits, PlanningScene


@dataclass(frozen=True, eq=False)
class Context:
    """scene: where the robot moves. options: as they were checked. journal: what happened so far;
    it counts the work. station: whose allowed contacts hold in its zone; "": nobody's.
    """

    scene: PlanningScene
    options: PlanOptions
    journal: Journal
    station: str = ""

    @staticmethod
    def of(scene: PlanningScene, options: PlanOptions, work: Work, station: str = "") -> "Context":
        """The context of a new request, with a journal of its own."""
        return Context(scene, options, Journal(work, options.seed), station)

    @property
    def work(self) -> Work:
        """What the request may still cost."""
        return self.journal.work

    @property
    def safety_distance(self) -> float:
        """S_m [m]."""
        return self.options.safety_distance

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the robot's order."""
        return self.scene.cell.robot.joint_names

    @property
    def limits(self) -> MotionLimits:
        """The robot's bounds times the request's scalings."""
        return self.scene.limits.scaled(
            self.options.velocity_scaling, self.options.acceleration_scaling
        )

    def thresholds(self) -> FloatArray:
        """Distance (Z,) m that each pair must exceed."""
        return self.scene.thresholds(self.safety_distance, self.station)

    def asking(self, objective: str, duration: float = 0.0) -> "Context":
        """The same with another objective and requested duration [s], 0: free."""
        return replace(self, options=replace(self.options, objective=objective, duration=duration))

    def planned_by(self, planner_id: str) -> "Context":
        """The same asking for another search."""
        return replace(self, options=replace(self.options, planner_id=planner_id))

    def with_timing(self, timing: str) -> "Context":
        """The same with "synchronous" or "asynchronous" joints."""
        return replace(self, options=replace(self.options, timing=timing))

    def at(self, station: str) -> "Context":
        """The same with the allowed contacts of a station."""
        return replace(self, station=station)

    def inside(self, scene: PlanningScene) -> "Context":
        """The same in another scene of the request: other loads, other places of the parts."""
        return replace(self, scene=scene)
