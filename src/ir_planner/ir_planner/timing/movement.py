"""A movement of a request: its trajectory, and its proofs in the scene of that request.

Nothing is proved before a method is called that says so: candidates that are only compared stay
cheap. A proof holds for one trajectory under the premises that it was made with, and is handed on
to no other.
"""

from collections.abc import Callable
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

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
from ir_planner.scene import MotionLimits, PlanningScene
from ir_planner.timing.blended_steps import stretched
from ir_planner.timing.objective import coarse_cost, coarse_energy_cost, request_cost
from ir_values.arrays import FloatArray


class Premises(NamedTuple):
    """What a proof is made with. safety_distance: S_m [m]. station: whose contacts are allowed.
    at_rest: at the start and at the goal. tilt: largest [rad], axis and direction of the tool.
    tool: largest speed [m/s], acceleration [m/s^2], and whether of the whole tool.

    Scenes are the same where they are one object: equal ones are proved again.
    """

    scene: PlanningScene
    safety_distance: float
    station: str
    at_rest: tuple[bool, bool]
    tilt: tuple[float, tuple[float, ...], tuple[float, ...]]
    tool: tuple[float, float, bool]

    @staticmethod
    def of(context: Context) -> "Premises":
        """Those of a request."""
        options = context.options
        return Premises(
            context.scene,
            context.safety_distance,
            context.station,
            context.at_rest,
            (options.tilt_max, tuple(options.tilt_axis), tuple(options.tilt_direction)),
            (options.tool_speed, options.tool_acceleration, options.whole_tool),
        )


class Proofs:
    """Proofs and measurements of one trajectory in a context, each made once, when it is first
    asked for.
    """

    def __init__(self, trajectory: JointTrajectory, context: Context) -> None:
        self._trajectory = trajectory
        self._context = context
        self._premises = Premises.of(context)

    def hold_for(self, trajectory: JointTrajectory, context: Context) -> bool:
        """Whether they say the same of that trajectory in that context."""
        return trajectory is self._trajectory and Premises.of(context) == self._premises

    @cached_property
    def clearance(self) -> Violation | None:
        """Where a pair is too near; None: proved."""
        context = self._context
        return clearance_violation(
            self._trajectory, context.scene, context.safety_distance, context.station
        )

    @cached_property
    def tilt(self) -> Violation | None:
        """Where the tool leans too far; None: proved, or nothing is asked."""
        return tilt_violation(self._trajectory, self._context.cone)

    @cached_property
    def torque(self) -> TorqueProof:
        """Bounds of the torque that it needs, which has to leave the reserve."""
        scene = self._context.scene
        return torque_proof(self._trajectory, scene, 1.0 - scene.drives.torque_reserve)

    @cached_property
    def verification(self) -> Verification:
        """What holds at every instant of it, as it is sent."""
        context = self._context
        return verified(
            self._trajectory,
            context.scene,
            self.clearance,
            self.torque,
            context.at_rest,
            self.tilt,
            context.tool_bounds,
        )

    @cached_property
    def energy(self) -> MovementEnergy:
        """What it takes from the mains, begun with an empty capacitor."""
        return movement_energy(self._trajectory, self._context.scene)

    @cached_property
    def evaluation(self) -> Evaluation:
        """The verification, and everything that is measured."""
        context = self._context
        return measured(
            self._trajectory,
            context.scene,
            context.safety_distance,
            context.station,
            self.verification,
            self.energy,
            context.cone,
        )


@dataclass(frozen=True, eq=False)
class Movement:
    """path (M, n): the waypoints that it passes or came from. context: what it must keep and is
    judged by. note: where it differs from what was asked. timing: "asynchronous" where joints have
    laws of their own. fixed_time: its duration follows from a tool's speed along a path, and isn't
    to be changed. known: proofs of a movement before, used where they hold for this one.
    """

    path: FloatArray
    trajectory: JointTrajectory
    context: Context
    note: str = ""
    timing: str = "synchronous"
    fixed_time: bool = False
    known: InitVar[Proofs | None] = None
    proofs: Proofs = field(init=False, repr=False)

    def __post_init__(self, known: Proofs | None) -> None:
        if known is None or not known.hold_for(self.trajectory, self.context):
            known = Proofs(self.trajectory, self.context)
        object.__setattr__(self, "proofs", known)

    def prove(self) -> Verification:
        """Prove clearance, tilt and limits for every instant of it, as it is sent."""
        return self.proofs.verification

    def prove_path(self) -> Violation | None:
        """Prove clearance and tilt; where it can't be driven, however slowly."""
        return self.proofs.clearance or self.proofs.tilt

    def prove_torque(self) -> TorqueProof:
        """Prove that the torque that it needs leaves the reserve."""
        return self.proofs.torque

    def evaluate(self) -> Evaluation:
        """Prove and measure all that a report says of it."""
        return self.proofs.evaluation

    @property
    def report(self) -> TrajectoryReport:
        """That of `evaluate`."""
        return self.evaluate().report

    @property
    def energy(self) -> MovementEnergy:
        """What it takes from the mains, begun with an empty capacitor."""
        return self.proofs.energy

    @property
    def consumption(self) -> Consumption:
        """What objectives count of it: a fraction of the work of a report. Its W is of the travel
        that `prove` finds.
        """
        cost = float(portable.matmul(self.prove().travel, self.context.scene.weights))
        return Consumption(self.trajectory.duration, cost, self.energy.total, self.energy.base)

    @property
    def cost(self) -> float:
        """What the request minimises, of the consumption."""
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
        """The movement with other waypoints (M, n) [rad], its trajectory as it is."""
        return replace(self, path=path, known=self.proofs)

    def asked_by(self, context: Context) -> "Movement":
        """The movement at its station for another request."""
        return replace(self, context=context.at(self.context.station), known=self.proofs)

    def stretched_by(self, factor: float) -> "Movement":
        """The movement along its path, slower by `factor` >= 1."""
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
        if movement is None or movement.prove_path() is not None:
            break
        if movement.prove_torque().violation is None:
            break
    return movement
