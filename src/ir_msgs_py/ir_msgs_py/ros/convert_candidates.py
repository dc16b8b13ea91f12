"""Plan options, configurations that reach a pose and service movements, to and from messages."""

from __future__ import annotations

from dataclasses import fields

from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg

from ir_msgs.msg import IkSolution as IkSolutionMsg
from ir_msgs.msg import PlanOptions as PlanOptionsMsg
from ir_msgs.msg import ServiceCandidate as ServiceCandidateMsg
from ir_msgs_py.candidates import IkSolution, ServiceCandidate
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.convert_basics import configuration_from_msg, configuration_to_msg
from ir_msgs_py.ros.convert_report import (
    distance_pair_from_msg,
    distance_pair_to_msg,
    report_from_msg,
    report_to_msg,
)
from ir_msgs_py.ros.convert_trajectory import (
    trajectory_from_msg,
    trajectory_given,
    trajectory_to_msg,
)

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
