"""Reports, planning information and steps of a program, to and from messages."""

from __future__ import annotations

from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

from ir_msgs.msg import DistancePair as DistancePairMsg
from ir_msgs.msg import PlannedMovement as PlannedMovementMsg
from ir_msgs.msg import PlanningInfo as PlanningInfoMsg
from ir_msgs.msg import PlanningStage as PlanningStageMsg
from ir_msgs.msg import Rejection as RejectionMsg
from ir_msgs.msg import TrajectoryReport as TrajectoryReportMsg
from ir_msgs_py.report import (
    DistancePair,
    PlannedMovement,
    PlanningInfo,
    PlanningStage,
    Rejection,
    TrajectoryReport,
)
from ir_msgs_py.ros.convert_basics import (
    configuration_to_msg,
    float_array,
    point_from_msg,
    point_to_msg,
)
from ir_msgs_py.ros.convert_trajectory import (
    trajectory_from_msg,
    trajectory_given,
    trajectory_to_msg,
)

_NUMBERS = (
    "duration",
    "movement_cost",
    "energy",
    "energy_low",
    "energy_high",
    "base_energy",
    "burnt_energy",
    "peak_power",
    "min_clearance",
    "closest_time",
    "safety_distance",
    "path_length",
    "torque_reserve",
)
_PER_JOINT = ("joint_energy", "velocity_ratio", "acceleration_ratio", "jerk_ratio", "torque_ratio")
_TEXTS = (
    "kind",
    "from_station",
    "to_station",
    "trajectory_id",
    "power_mode",
    "attach",
    "detach",
    "load",
)


def distance_pair_to_msg(pair: DistancePair | None) -> DistancePairMsg:
    """Pair with its closest points; None (there is no pair) is a message with an empty kind."""
    if pair is None:
        return DistancePairMsg()
    return DistancePairMsg(
        kind=str(pair.kind),
        body_a=pair.body_a,
        body_b=pair.body_b,
        distance=pair.distance,
        point_a=point_to_msg(pair.point_a),
        point_b=point_to_msg(pair.point_b),
        allowed_contact=pair.allowed_contact,
    )


def distance_pair_from_msg(msg: DistancePairMsg) -> DistancePair | None:
    """Pair with its closest points, or None where there is none."""
    if not msg.kind:
        return None
    return DistancePair(
        msg.kind,
        msg.body_a,
        msg.body_b,
        msg.distance,
        point_from_msg(msg.point_a),
        point_from_msg(msg.point_b),
        msg.allowed_contact,
    )


def report_to_msg(report: TrajectoryReport) -> TrajectoryReportMsg:
    """Report of a trajectory."""
    return TrajectoryReportMsg(
        **{name: float(getattr(report, name)) for name in _NUMBERS},
        **{name: float_array(getattr(report, name)) for name in _PER_JOINT},
        closest=distance_pair_to_msg(report.closest),
        certified=report.certified,
        cell_hash=report.cell_hash,
        load=report.load,
        power_parameters=report.power_parameters,
        contacts=[distance_pair_to_msg(pair) for pair in report.contacts],
    )


def report_from_msg(msg: TrajectoryReportMsg) -> TrajectoryReport:
    """Report of a trajectory."""
    contacts = (distance_pair_from_msg(pair) for pair in msg.contacts)
    return TrajectoryReport(
        **{name: getattr(msg, name) for name in (*_NUMBERS, *_PER_JOINT)},
        closest=distance_pair_from_msg(msg.closest),
        certified=msg.certified,
        cell_hash=msg.cell_hash,
        load=msg.load,
        power_parameters=msg.power_parameters,
        contacts=tuple(pair for pair in contacts if pair is not None),
    )


def planning_info_to_msg(info: PlanningInfo) -> PlanningInfoMsg:
    """How an answer came about."""
    return PlanningInfoMsg(
        planner_id=info.planner_id,
        seed=info.seed,
        start=configuration_to_msg(info.start_names, info.start),
        iterations=info.iterations,
        truncated=info.truncated,
        planning_time=info.planning_time,
        timing=info.timing,
        stages=[PlanningStageMsg(name=s.name, seconds=s.seconds, note=s.note) for s in info.stages],
        rejected=[RejectionMsg(reason=r.reason, count=r.count) for r in info.rejected],
    )


def planning_info_from_msg(msg: PlanningInfoMsg) -> PlanningInfo:
    """How an answer came about."""
    return PlanningInfo(
        planner_id=msg.planner_id,
        seed=msg.seed,
        start=msg.start.position,
        start_names=tuple(msg.start.name),
        iterations=msg.iterations,
        truncated=msg.truncated,
        planning_time=msg.planning_time,
        stages=tuple(PlanningStage(s.name, s.seconds, s.note) for s in msg.stages),
        rejected=tuple(Rejection(r.reason, r.count) for r in msg.rejected),
        timing=msg.timing,
    )


def planned_movement_to_msg(
    movement: PlannedMovement, include_points: bool = True
) -> PlannedMovementMsg:
    """Step of a program; without points only the id of the trajectory."""
    points = movement.trajectory if include_points else None
    return PlannedMovementMsg(
        **{name: str(getattr(movement, name)) for name in _TEXTS},
        trajectory=JointTrajectoryMsg() if points is None else trajectory_to_msg(points),
        report=report_to_msg(movement.report),
        duration=movement.duration,
        wait_for=list(movement.wait_for),
        set_signals=list(movement.set_signals),
        states=list(movement.states),
    )


def planned_movement_from_msg(msg: PlannedMovementMsg) -> PlannedMovement:
    """Step of a program; trajectory None where the message carries no points."""
    return PlannedMovement(
        **{name: getattr(msg, name) for name in _TEXTS},
        trajectory=trajectory_from_msg(msg.trajectory)
        if trajectory_given(msg.trajectory)
        else None,
        report=report_from_msg(msg.report),
        duration=msg.duration,
        wait_for=tuple(msg.wait_for),
        set_signals=tuple(msg.set_signals),
        states=tuple(msg.states),
    )
