"""A movement of a request: its trajectory, and what is known about it as soon as somebody asks.

Proofs, report and cost are computed once, when they are first asked for: candidates that are only
compared stay cheap.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

from ir_kernels import portable
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import (
    Consumption,
    Evaluation,
    MovementEnergy,
    TorqueProof,
    Verification,
    Violation,
    clearance_violation,
    measured,
    movement_energy,
    tilt_violation,
    torque_proof,
    verified,
)
from ir_planner.request import Context
from ir_planner.scene import MotionLimits
from ir_planner.timing.blended_steps import stretched
from ir_planner.timing.objective import coarse_cost, coarse_energy_cost, request_cost
from ir_values.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Movement:
    """path (M, n): the waypoints that it passes or came from. context: what it must keep and is
    judged by. note: where it differs from what was asked. timing: "asynchronous" where joints have
    laws of their own. fixed_time: its duration follows from a tool's speed along a path, and isn't
    to be changed.
    """

    path: FloatArray
    trajectory: JointTrajectory
    context: Context
    note: str = ""
    timing: str = "synchronous"
    fixed_time: bool = False

    @cached_property
    def clearance(self) -> Violation | None:
        """Where a pair is too near; None: proved."""
        context = self.context
        return clearance_violation(
            self.trajectory, context.scene, context.safety_distance, context.station
        )

    @cached_property
    def tilt(self) -> Violation | None:
        """Where the tool leans too far; None: proved, or nothing is asked."""
        return tilt_violation(self.trajectory, self.context.cone)

    @property
    def astray(self) -> Violation | None:
        """Where its path can't be driven, however slowly: too near to something, or leaning."""
        return self.clearance or self.tilt

    @cached_property
    def torque(self) -> TorqueProof:
        """Bounds of the torque that it needs, which has to leave the reserve."""
        scene = self.context.scene
        return torque_proof(self.trajectory, scene, 1.0 - scene.drives.torque_reserve)

    @cached_property
    def verification(self) -> Verification:
        """What holds at every instant of it, as it is sent."""
        context = self.context
        found = (self.clearance, self.torque, context.at_rest)
        return verified(
            self.trajectory, context.scene, *found, tilt=self.tilt, tool=context.tool_bounds
        )

    @property
    def violation(self) -> Violation | None:
        """The first one; None: certified."""
        return self.verification.violation

    @property
    def certified(self) -> bool:
        """Clearance and limits proved for every instant."""
        return self.verification.certified

    @cached_property
    def energy(self) -> MovementEnergy:
        """What it takes from the mains, begun with an empty capacitor."""
        return movement_energy(self.trajectory, self.context.scene)

    @property
    def consumption(self) -> Consumption:
        """What objectives count of it: a fraction of the work of a report."""
        cost = float(portable.matmul(self.verification.travel, self.context.scene.weights))
        return Consumption(self.trajectory.duration, cost, self.energy.total, self.energy.base)

    @cached_property
    def evaluation(self) -> Evaluation:
        """Everything that is known about it."""
        context = self.context
        known = (self.verification, self.energy)
        return measured(
            self.trajectory,
            context.scene,
            context.safety_distance,
            context.station,
            *known,
            context.cone,
        )

    @property
    def report(self) -> TrajectoryReport:
        """What it costs."""
        return self.evaluation.report

    @property
    def cost(self) -> float:
        """What the request minimises."""
        return request_cost(self.consumption, self.context.options)

    @cached_property
    def coarse_cost(self) -> float:
        """The objective, energies and path lengths sampled coarsely: for comparisons."""
        return coarse_cost(self.trajectory, self.context)

    @cached_property
    def coarse_energy_cost(self) -> float:
        """J, or joules where the objective is not J, sampled coarsely: for comparisons on one
        path.
        """
        return coarse_energy_cost(self.trajectory, self.context)

    def passing(self, path: FloatArray) -> "Movement":
        """The same trajectory with other waypoints (M, n); what is known about it stays known."""
        other = replace(self, path=path)
        other.__dict__.update({**self.__dict__, "path": path})
        return other

    def asked_by(self, context: Context) -> "Movement":
        """The same for a request with another objective in the same scene; proofs and report stay
        known.
        """
        other = replace(self, context=context.at(self.context.station))
        known = ("clearance", "tilt", "torque", "verification", "energy", "evaluation")
        other.__dict__.update(
            {name: self.__dict__[name] for name in known if name in self.__dict__}
        )
        return other

    def stretched_by(self, factor: float) -> "Movement":
        """The same path, slower by `factor` >= 1."""
        return replace(self, trajectory=stretched(self.trajectory, factor))


# Torque is sampled while a motion is timed and bounded when it is proved. Nearly always 2 % cover
# the difference; a motion that needs more has few samples where its torque is highest. These are
# the shares of the torque that the reserve leaves, tried until the guaranteed bounds hold.

TORQUE_SHARES = (0.98, 0.95, 0.9, 0.8)


def within_torque(
    make: Callable[[MotionLimits], Movement | None], context: Context
) -> Movement | None:
    """The movement made for the largest share of the torque with which its guaranteed bounds hold.

    Ends with what `make` returns where that is None, goes astray, or uses the smallest share.
    Raises CancelledError when asked to stop.
    """
    for share in TORQUE_SHARES:
        context.work.check()
        movement = make(context.limits.with_torque_share(share))
        if movement is None or movement.astray is not None or movement.torque.violation is None:
            break
    return movement
