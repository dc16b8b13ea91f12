"""The report of a trajectory: what it costs, how near it comes to its limits, and whether all that
is proved.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ir_kernels import portable
from ir_msgs_py.options import NO_TILT
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import Status
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.distances import ClearanceProfile, clearance_profile
from ir_planner.checks.energy import MovementEnergy, movement_energy, peak_power
from ir_planner.checks.verification import TILT, AtRest, Verification, verify
from ir_planner.presentation import plot_profiles, report_text, status_text
from ir_planner.scene import (
    PROOF_TOLERANCE,
    TILT_TOLERANCE,
    PlanningScene,
    Stops,
    ToolBounds,
    ToolCone,
)
from ir_values.arrays import FloatArray


class Consumption(NamedTuple):
    """What objectives count of a movement, named as in its report; known before distances and peaks
    are.
    """

    duration: float
    movement_cost: float
    energy: float
    base_energy: float


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Everything that is known about a trajectory. advice: where a violation may come from, else
    "".
    """

    report: TrajectoryReport
    verification: Verification
    clearance: ClearanceProfile
    energy: MovementEnergy
    advice: str = ""

    def __repr__(self) -> str:
        return f"Evaluation({report_text(self.report)}, {status_text(self.status)})"

    def plot(self) -> Any:
        """Clearance and power over time; a matplotlib figure."""
        clearance = self.clearance
        energy = self.energy
        return plot_profiles(
            clearance.times, clearance.distances, energy.times, energy.watts, repr(self)
        )

    @property
    def status(self) -> Status:
        """That of the verification, a violation with the advice."""
        status = self.verification.status
        if status.ok or not self.advice:
            return status
        return replace(status, message=f"{status.message}; {self.advice}")


def evaluate_trajectory(
    trajectory: JointTrajectory,
    scene: PlanningScene,
    safety_distance: float,
    station: Stops = "",
    at_rest: AtRest = (True, True),
    cone: ToolCone | None = None,
    tool: ToolBounds | None = None,
) -> Evaluation:
    """Verify and measure a trajectory with the loads of the scene. station: whose contacts are
    allowed; of a hop between two stations both, each in its own zone. cone: in which the tool has
    to stay. tool: how fast it may be, None: what the loads let it do.
    """
    verification = verify(trajectory, scene, safety_distance, station, at_rest, cone, tool)
    energy = movement_energy(trajectory, scene)
    return measured(trajectory, scene, safety_distance, station, verification, energy, cone)


def measured(
    trajectory: JointTrajectory,
    scene: PlanningScene,
    safety_distance: float,
    station: Stops,
    verification: Verification,
    energy: MovementEnergy,
    cone: ToolCone | None = None,
) -> Evaluation:
    """The evaluation of a trajectory that has been verified, and whose energy is known."""
    clearance = clearance_profile(trajectory, scene, station)
    tool_speed, tool_acceleration = verification.tool_motion
    report = TrajectoryReport(
        duration=trajectory.duration,
        movement_cost=float(portable.matmul(verification.travel, scene.weights)),
        energy=energy.total,
        joint_energy=energy.joints,
        base_energy=energy.base,
        burnt_energy=energy.dissipated,
        peak_power=peak_power(trajectory, scene),
        min_clearance=_least_clearance(clearance, verification, safety_distance),
        closest=clearance.smallest,
        closest_time=clearance.smallest_time,
        safety_distance=safety_distance,
        velocity_ratio=verification.velocity,
        acceleration_ratio=verification.acceleration,
        jerk_ratio=verification.jerk,
        torque_ratio=verification.torque,
        path_length=clearance.path_length,
        certified=verification.certified,
        contacts=clearance.contacts,
        torque_reserve=_reserve(verification.torque, scene),
        largest_tilt=_largest_tilt(trajectory, cone, verification),
        tool_speed=tool_speed,
        tool_acceleration=tool_acceleration,
    )
    return Evaluation(report, verification, clearance, energy)


def _reserve(torque: FloatArray, scene: PlanningScene) -> float:
    """What a trajectory that needs the shares (n,) of the torque leaves of the reserve that plans
    keep.
    """
    return min(scene.drives.torque_reserve, max(1.0 - float(torque.max(initial=0.0)), 0.0))


def _largest_tilt(
    trajectory: JointTrajectory, cone: ToolCone | None, verification: Verification
) -> float:
    """What is proved of the largest tilt [rad]; where the cone's is, that too. NO_TILT: no cone."""
    if cone is None:
        return NO_TILT
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        return float(cone.tilts(trajectory.positions).max())
    proved = np.inf if verification.breaks(TILT) else cone.most + TILT_TOLERANCE
    return min(cone.largest(coefficients, durations), proved)


def _least_clearance(
    clearance: ClearanceProfile, verification: Verification, safety_distance: float
) -> float:
    """What is proved of the smallest distance [m]; where S_m is proved, that too. inf: no pair."""
    if clearance.smallest is None:
        return np.inf
    proved = safety_distance - PROOF_TOLERANCE if verification.keeps_clear else -np.inf
    return max(clearance.bound, proved)


def total_report(
    reports: tuple[TrajectoryReport, ...], elapsed: tuple[float, ...]
) -> TrajectoryReport:
    """Report of steps one after the other; `elapsed` (N,) s: when each starts. Pauses have a report
    as well.
    """
    moving = [report for report in reports if len(report.velocity_ratio)]
    if not reports:
        return TrajectoryReport()
    if not moving:
        return TrajectoryReport(
            duration=sum(report.duration for report in reports),
            energy=sum(report.energy for report in reports),
            base_energy=sum(report.base_energy for report in reports),
            peak_power=max(report.peak_power for report in reports),
            certified=all(report.certified for report in reports),
        )
    tightest = min(range(len(reports)), key=lambda k: reports[k].min_clearance)
    ratios = {
        name: np.max([getattr(report, name) for report in moving], axis=0)
        for name in ("velocity_ratio", "acceleration_ratio", "jerk_ratio", "torque_ratio")
    }
    n = len(moving[0].velocity_ratio)
    return replace(
        reports[tightest],
        duration=sum(report.duration for report in reports),
        movement_cost=sum(report.movement_cost for report in reports),
        energy=sum(report.energy for report in reports),
        joint_energy=np.sum(
            [r.joint_energy if len(r.joint_energy) else np.zeros(n) for r in reports], axis=0
        ),
        base_energy=sum(report.base_energy for report in reports),
        burnt_energy=sum(report.burnt_energy for report in reports),
        peak_power=max(report.peak_power for report in reports),
        closest_time=elapsed[tightest] + reports[tightest].closest_time,
        safety_distance=min(report.safety_distance for report in moving),
        path_length=sum(report.path_length for report in reports),
        certified=all(report.certified for report in moving),
        contacts=tuple(pair for report in reports for pair in report.contacts),
        torque_reserve=min(report.torque_reserve for report in moving),
        largest_tilt=max(report.largest_tilt for report in moving),
        tool_speed=max(report.tool_speed for report in moving),
        tool_acceleration=max(report.tool_acceleration for report in moving),
        velocity_ratio=ratios["velocity_ratio"],
        acceleration_ratio=ratios["acceleration_ratio"],
        jerk_ratio=ratios["jerk_ratio"],
        torque_ratio=ratios["torque_ratio"],
    )
