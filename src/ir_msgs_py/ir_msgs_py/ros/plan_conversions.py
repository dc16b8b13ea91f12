"""Conversions of what a planner says to and from messages: options, reports, movements of a
program, contacts, savings, configurations and service movements. Each pair is a round trip.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

from ir_msgs.msg import Contact as ContactMsg
from ir_msgs.msg import DistancePair as DistancePairMsg
from ir_msgs.msg import IkSolution as IkSolutionMsg
from ir_msgs.msg import MachineStates as MachineStatesMsg
from ir_msgs.msg import PlannedMovement as PlannedMovementMsg
from ir_msgs.msg import PlanningInfo as PlanningInfoMsg
from ir_msgs.msg import PlanningStage as PlanningStageMsg
from ir_msgs.msg import PlanOptions as PlanOptionsMsg
from ir_msgs.msg import ProgramPoint as ProgramPointMsg
from ir_msgs.msg import ProgramSavings as ProgramSavingsMsg
from ir_msgs.msg import Rejection as RejectionMsg
from ir_msgs.msg import Saving as SavingMsg
from ir_msgs.msg import ServiceCandidate as ServiceCandidateMsg
from ir_msgs.msg import TrajectoryReport as TrajectoryReportMsg
from ir_msgs_py.announcements import Contact, MachineState
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import (
    DistancePair,
    IkSolution,
    PlannedMovement,
    PlanningInfo,
    PlanningStage,
    Rejection,
    ServiceCandidate,
    TrajectoryReport,
)
from ir_msgs_py.ros.conversions import (
    configuration_from_msg,
    configuration_to_msg,
    float_array,
    point_from_msg,
    point_to_msg,
    time_from_msg,
    time_to_msg,
    trajectory_from_msg,
    trajectory_given,
    trajectory_to_msg,
)
from ir_msgs_py.savings import ProgramPoint, ProgramSavings, Saving
from ir_values.errors import InvalidValueError

_REPORT_NUMBERS = (
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
    "largest_tilt",
    "tool_speed",
    "tool_acceleration",
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
    "since",
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
        **{name: float(getattr(report, name)) for name in _REPORT_NUMBERS},
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
        **{name: getattr(msg, name) for name in (*_REPORT_NUMBERS, *_PER_JOINT)},
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
        passes=list(movement.passes),
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
        passes=tuple(msg.passes),
    )


_CONTACT_NUMBERS = ("depth", "speed", "force", "stopped_after", "path_time")


def contact_to_msg(contact: Contact) -> ContactMsg:
    """A contact."""
    message = ContactMsg(
        pair=distance_pair_to_msg(contact.pair),
        trajectory_id=contact.trajectory_id,
        **{name: float(getattr(contact, name)) for name in _CONTACT_NUMBERS},
    )
    message.header.stamp = time_to_msg(contact.stamp_ns)
    return message


def contact_from_msg(msg: ContactMsg) -> Contact:
    """A contact. Raises InvalidValueError without a pair."""
    pair = distance_pair_from_msg(msg.pair)
    if pair is None:
        raise InvalidValueError("the contact has no pair")
    return Contact(
        pair=pair,
        stamp_ns=time_from_msg(msg.header.stamp),
        trajectory_id=msg.trajectory_id,
        **{name: getattr(msg, name) for name in _CONTACT_NUMBERS},
    )


def machine_states_to_msg(states: Sequence[MachineState]) -> MachineStatesMsg:
    """The states of all machines."""
    return MachineStatesMsg(
        equipment=[each.equipment for each in states],
        states=[each.state for each in states],
        next=[each.next for each in states],
        remaining=[each.remaining for each in states],
    )


def machine_states_from_msg(msg: MachineStatesMsg) -> tuple[MachineState, ...]:
    """The states of all machines. Raises InvalidValueError for lists of different lengths."""
    rows = msg.equipment, msg.states, msg.next, msg.remaining
    if len({len(row) for row in rows}) != 1:
        lengths = ", ".join(str(len(row)) for row in rows)
        raise InvalidValueError(f"equipment, states, next and remaining have {lengths} entries")
    return tuple(MachineState(*row) for row in zip(*rows, strict=True))


def saving_to_msg(saving: Saving) -> SavingMsg:
    """Common and planned joules with their share."""
    return SavingMsg(
        common=saving.common,
        planned=saving.planned,
        seconds=saving.seconds,
        share=saving.share,
        saved_low=saving.saved_low,
        saved_high=saving.saved_high,
    )


def program_savings_to_msg(savings: ProgramSavings) -> ProgramSavingsMsg:
    """The three figures."""
    return ProgramSavingsMsg(
        available=savings.available,
        movements=saving_to_msg(savings.movements),
        pauses=saving_to_msg(savings.pauses),
        total=saving_to_msg(savings.total),
        across=savings.across,
        around=savings.around,
        program_id=savings.program_id,
        sentence=savings.sentence,
    )


def program_savings_from_msg(msg: ProgramSavingsMsg) -> ProgramSavings:
    """The three figures."""
    return ProgramSavings(
        available=msg.available,
        movements=saving_from_msg(msg.movements),
        pauses=saving_from_msg(msg.pauses),
        across=msg.across,
        around=msg.around,
        program_id=msg.program_id,
        sentence=msg.sentence,
    )


def program_point_to_msg(point: ProgramPoint) -> ProgramPointMsg:
    """A point of a front."""
    return ProgramPointMsg(
        cycle_time=point.cycle_time, energy=point.energy, program_id=point.program_id
    )


def program_point_from_msg(msg: ProgramPointMsg) -> ProgramPoint:
    """A point of a front."""
    return ProgramPoint(msg.cycle_time, msg.energy, msg.program_id)


def saving_from_msg(msg: SavingMsg) -> Saving:
    """One row of the savings."""
    return Saving(msg.common, msg.planned, msg.seconds, msg.saved_low, msg.saved_high)


_OPTIONS = tuple(field.name for field in fields(PlanOptions))
_IK_NUMBERS = ("position_error", "rotation_error", "clearance", "movement_cost")


def plan_options_to_msg(options: PlanOptions) -> PlanOptionsMsg:
    """Choices of a request."""
    return PlanOptionsMsg(**{name: getattr(options, name) for name in _OPTIONS})


def plan_options_from_msg(msg: PlanOptionsMsg) -> PlanOptions:
    """Choices of a request, checked."""
    return PlanOptions(**{name: getattr(msg, name) for name in _OPTIONS})


def ik_solution_to_msg(solution: IkSolution) -> IkSolutionMsg:
    """Configuration that reaches a pose."""
    return IkSolutionMsg(
        state=configuration_to_msg(solution.joint_names, solution.q),
        branch=solution.branch,
        turns=list(solution.turns),
        closest=distance_pair_to_msg(solution.closest),
        **{name: getattr(solution, name) for name in _IK_NUMBERS},
    )


def ik_solution_from_msg(msg: IkSolutionMsg) -> IkSolution:
    """Configuration that reaches a pose."""
    return IkSolution(
        joint_names=tuple(msg.state.name),
        q=msg.state.position,
        branch=msg.branch,
        turns=tuple(msg.turns),
        closest=distance_pair_from_msg(msg.closest),
        **{name: getattr(msg, name) for name in _IK_NUMBERS},
    )


def service_candidate_to_msg(
    candidate: ServiceCandidate, include_points: bool = True
) -> ServiceCandidateMsg:
    """Withdrawal or entry; without points only the id of the trajectory."""
    points = candidate.trajectory if include_points else None
    return ServiceCandidateMsg(
        method=candidate.method,
        work_configuration=configuration_to_msg(candidate.joint_names, candidate.work),
        outside_configuration=configuration_to_msg(candidate.joint_names, candidate.outside),
        trajectory_id=candidate.trajectory_id,
        trajectory=JointTrajectoryMsg() if points is None else trajectory_to_msg(points),
        report=report_to_msg(candidate.report),
    )


def service_candidate_from_msg(msg: ServiceCandidateMsg) -> ServiceCandidate:
    """Withdrawal or entry; trajectory None where the message carries no points."""
    names = tuple(msg.work_configuration.name)
    return ServiceCandidate(
        method=msg.method,
        joint_names=names,
        work=configuration_from_msg(msg.work_configuration, names),
        outside=configuration_from_msg(msg.outside_configuration, names),
        trajectory_id=msg.trajectory_id,
        trajectory=trajectory_from_msg(msg.trajectory)
        if trajectory_given(msg.trajectory)
        else None,
        report=report_from_msg(msg.report),
    )
