"""What the helpers of `Client` give back: values, not messages."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import PlannedMovement, PlanningInfo, TrajectoryReport
from ir_msgs_py.ros.convert_report import (
    planned_movement_from_msg,
    planning_info_from_msg,
    report_from_msg,
)
from ir_msgs_py.ros.convert_savings import program_point_from_msg, program_savings_from_msg
from ir_msgs_py.ros.convert_trajectory import trajectory_from_msg, trajectory_given
from ir_msgs_py.savings import ProgramPoint, ProgramSavings
from ir_msgs_py.trajectory import JointTrajectory


@dataclass(frozen=True, eq=False)
class MovementPlan:
    """A planned movement; trajectory is None unless the options asked for points."""

    trajectory_id: str
    trajectory: JointTrajectory | None
    report: TrajectoryReport
    info: PlanningInfo

    @classmethod
    def from_msg(cls, response: Any) -> MovementPlan:
        """From the response of plan_regional_movement or plan_trajectory."""
        points = response.trajectory
        return cls(
            response.trajectory_id,
            trajectory_from_msg(points) if trajectory_given(points) else None,
            report_from_msg(response.report),
            planning_info_from_msg(response.info),
        )


@dataclass(frozen=True, eq=False)
class OptimizedTrajectory:
    """A trajectory made cheaper; trajectory is None unless the options asked for points. durations
    [s] and energies [J], each (P,): the trade of time for energy, the fastest first.
    """

    trajectory_id: str
    trajectory: JointTrajectory | None
    before: TrajectoryReport
    after: TrajectoryReport
    durations: FloatArray
    energies: FloatArray
    info: PlanningInfo

    @classmethod
    def from_msg(cls, response: Any) -> OptimizedTrajectory:
        """From the response of optimize_trajectory."""
        points = response.trajectory
        return cls(
            response.trajectory_id,
            trajectory_from_msg(points) if trajectory_given(points) else None,
            report_from_msg(response.before),
            report_from_msg(response.after),
            np.array(response.pareto_durations),
            np.array(response.pareto_energies),
            planning_info_from_msg(response.info),
        )


@dataclass(frozen=True, eq=False)
class ProgramPlan:
    """A planned program: its steps, the report of the whole, and what it saves; gap [%]: how far
    above the best chain of configurations it can be. front: programs by cycle time, where they were
    asked for.
    """

    program_id: str
    movements: tuple[PlannedMovement, ...]
    report: TrajectoryReport
    info: PlanningInfo
    gap: float
    savings: ProgramSavings
    front: tuple[ProgramPoint, ...]

    @classmethod
    def from_msg(cls, result: Any) -> ProgramPlan:
        """From the result of the plan action or the response of plan_program."""
        return cls(
            result.program_id,
            tuple(planned_movement_from_msg(movement) for movement in result.movements),
            report_from_msg(result.report),
            planning_info_from_msg(result.info),
            result.gap,
            program_savings_from_msg(result.savings),
            tuple(program_point_from_msg(point) for point in result.front),
        )


@dataclass(frozen=True)
class ProgramRun:
    """A program that was run: steps that ended well, duration [s], energy at the mains [J]."""

    executed: int
    duration: float
    energy: float


@dataclass(frozen=True)
class Execution:
    """A trajectory that was driven: largest deviation of the tool [m], energy at the mains [J]."""

    max_tool_deviation: float
    energy: float
