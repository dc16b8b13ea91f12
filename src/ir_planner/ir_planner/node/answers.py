"""Answers of the core as responses: every field of the message from the value that holds it."""

from typing import Any

import numpy as np

from ir_description import Cell, Station, cell_to_yaml
from ir_msgs.msg import AllowedContact as AllowedContactMsg
from ir_msgs.msg import CyclePoint as CyclePointMsg
from ir_msgs.msg import CycleStep as CycleStepMsg
from ir_msgs.msg import RobotProgram as RobotProgramMsg
from ir_msgs.msg import SharedZone as SharedZoneMsg
from ir_msgs.msg import Station as StationMsg
from ir_msgs_py.ros.conversions import (
    float_array,
    stamped_pose_to_msg,
    status_to_msg,
    trajectory_to_msg,
)
from ir_msgs_py.ros.plan_conversions import (
    distance_pair_to_msg,
    ik_solution_to_msg,
    planned_movement_to_msg,
    planning_info_to_msg,
    program_point_to_msg,
    program_savings_to_msg,
    report_to_msg,
    saving_to_msg,
    service_candidate_to_msg,
)
from ir_msgs_py.ros.power_conversions import power_mode_to_msg
from ir_msgs_py.ros.search_conversions import searches_to_msg
from ir_msgs_py.savings import ProgramPoint, Saving
from ir_msgs_py.status import Status
from ir_planner.cartesian import CartesianPlan
from ir_planner.checks import Evaluation, StateCheck
from ir_planner.configurations import IkAnswer
from ir_planner.flexible import SteadyPlan, timed_steps
from ir_planner.krl import KrlExport
from ir_planner.program import ProgramPlan, Standby
from ir_planner.regional import EscapePlan, MovementPlan
from ir_planner.robots import RobotsPlan
from ir_planner.service import ServicePlan
from ir_planner.state_queries import StatesCheck
from ir_planner.store import StoredProgram
from ir_planner.trajectories import OptimizationPlan


def station_to_msg(station: Station) -> StationMsg:
    """A station of the cell."""
    return StationMsg(
        name=station.name,
        equipment=station.equipment,
        pose=stamped_pose_to_msg(station.pose),
        zone=station.zone.lower(),
        allowed_contacts=[
            AllowedContactMsg(body_a=c.body_a, body_b=c.body_b, safety_distance=c.safety_distance)
            for c in station.allowed_contacts
        ],
    )


def stations_to_msg(cell: Cell) -> list[Any]:
    """All stations of the cell."""
    return [station_to_msg(station) for station in cell.stations]


def fill_status(response: Any, status: Status, source: str) -> Any:
    """Put the status into a response, with the node's name."""
    response.status = status_to_msg(Status(status.code, status.message, source))
    return response


def fill_state_check(response: Any, check: StateCheck) -> None:
    """check_state."""
    response.valid = check.valid
    response.min_distance = check.min_distance
    response.pairs = [distance_pair_to_msg(pair) for pair in check.pairs]


def fill_states_check(response: Any, check: StatesCheck) -> None:
    """check_states."""
    response.valid = check.valid.tolist()
    response.min_distances = float_array(check.distances)
    response.closest = [distance_pair_to_msg(pair) for pair in check.closest]


def fill_ik(response: Any, answer: IkAnswer) -> None:
    """compute_ik."""
    response.solutions = [ik_solution_to_msg(solution) for solution in answer.solutions]
    response.info = planning_info_to_msg(answer.info)


def fill_movement(
    response: Any, plan: MovementPlan | CartesianPlan | EscapePlan, include_points: bool
) -> None:
    """plan_regional_movement and plan_trajectory; points only where they were asked for."""
    response.report = report_to_msg(plan.report)
    response.info = planning_info_to_msg(plan.info)
    if plan.trajectory is not None:
        response.trajectory_id = plan.trajectory.trajectory_id
        if include_points:
            response.trajectory = trajectory_to_msg(plan.trajectory)


def fill_escape(response: Any, plan: EscapePlan, include_points: bool) -> None:
    """plan_escape."""
    fill_movement(response, plan, include_points)
    response.pairs = [distance_pair_to_msg(pair) for pair in plan.pairs]
    response.left = list(plan.left)


def fill_cartesian(response: Any, plan: CartesianPlan, include_points: bool) -> None:
    """plan_cartesian_movement."""
    fill_movement(response, plan, include_points)
    response.tool_error = plan.tool_error
    response.rotation_error = plan.rotation_error
    response.speed_deviation = plan.speed_deviation
    response.lengths = float_array(plan.lengths)
    response.configurations = plan.configurations


def fill_optimization(response: Any, plan: OptimizationPlan, include_points: bool) -> None:
    """optimize_trajectory: the front's movements are stored."""
    response.before = report_to_msg(plan.before)
    response.after = report_to_msg(plan.after)
    response.pareto_durations = [float(point.report.duration) for point in plan.front]
    response.pareto_energies = [float(point.report.energy) for point in plan.front]
    response.pareto_ids = [point.trajectory.trajectory_id for point in plan.front]
    response.info = planning_info_to_msg(plan.info)
    if plan.trajectory is not None:
        response.trajectory_id = plan.trajectory.trajectory_id
        if include_points:
            response.trajectory = trajectory_to_msg(plan.trajectory)


def fill_service(response: Any, plan: ServicePlan, include_points: bool) -> None:
    """plan_service_movement."""
    response.candidates = [
        service_candidate_to_msg(candidate, include_points) for candidate in plan.candidates
    ]
    response.info = planning_info_to_msg(plan.info)


def fill_program(response: Any, plan: ProgramPlan, include_points: bool) -> None:
    """plan_program and the result of the plan action."""
    response.program_id = plan.program_id
    response.movements = [
        planned_movement_to_msg(movement, include_points) for movement in plan.movements
    ]
    response.report = report_to_msg(plan.report)
    response.info = planning_info_to_msg(plan.info)
    response.gap = plan.gap
    response.savings = program_savings_to_msg(plan.savings)
    response.front = [program_point_to_msg(_point(program)) for program in plan.front]
    response.searches = searches_to_msg(plan.info.searches)


def fill_steady_cycle(response: Any, plan: SteadyPlan, include_points: bool) -> None:
    """plan_steady_cycle: the program is that of the run where one was asked for."""
    response.info = planning_info_to_msg(plan.info)
    program = plan.run or plan.program
    cell = plan.run_cell or plan.cell
    if plan.cycle is None or program is None or cell is None:
        return
    response.program_id = program.program_id
    response.movements = [
        planned_movement_to_msg(movement, include_points) for movement in program.movements
    ]
    response.report = report_to_msg(program.report)
    response.cell = cell_to_yaml(cell)
    response.steps = [
        CycleStepMsg(
            kind=step.kind,
            from_station=step.from_station,
            to_station=step.to_station,
            unit=step.unit,
            start=step.start,
            duration=step.seconds,
            power_mode=step.power_mode,
        )
        for step in timed_steps(plan)
    ]
    response.period = plan.cycle.period
    response.units = plan.cycle.units
    response.energy = plan.joules
    response.gap = plan.gap
    response.shortest_period = plan.fastest
    if plan.saving is not None:
        saved = plan.saving
        saving = Saving(saved.common, saved.joules, saved.period, saved.low, saved.high)
        response.saving = saving_to_msg(saving)
        response.common_period = saved.common_period
        response.on_motors = saved.on_motors
    response.front = [
        CyclePointMsg(
            parts_per_hour=point.parts_per_hour,
            period=point.period,
            energy=point.joules,
            gap=point.gap,
        )
        for point in plan.front
    ]


def fill_robots(response: Any, plan: RobotsPlan, include_points: bool) -> None:
    """plan_robots: a program for each robot."""
    rows = zip(plan.robots, plan.programs, plan.leads, plan.begins, strict=False)
    response.robots = [
        RobotProgramMsg(
            robot=robot,
            program_id=program.program_id,
            lead=[planned_movement_to_msg(lead, include_points)] if lead.duration > 0.0 else [],
            movements=[
                planned_movement_to_msg(movement, include_points) for movement in program.movements
            ],
            report=report_to_msg(program.report),
            begin=begin,
        )
        for robot, program, lead, begin in rows
    ]
    response.zones = [
        SharedZoneMsg(
            signal=zone.signal,
            turn=zone.turn,
            first=zone.first,
            robots=list(zone.robots),
            from_movement=[first for first, _ in zone.movements],
            to_movement=[last for _, last in zone.movements],
            enter=list(zone.enter),
            leave=list(zone.leave),
        )
        for zone in plan.zones
    ]
    response.period = plan.period
    response.shortest_period = plan.fastest
    response.energy = float(plan.joules)
    response.full_speed = plan.full_speed
    response.gap = plan.gap
    response.peak_power = float(plan.peak_power)
    response.proved = plan.proved
    response.certified = plan.certified


def _point(program: ProgramPlan) -> ProgramPoint:
    report = program.report
    return ProgramPoint(report.duration, report.energy, program.program_id)


def fill_stored_program(response: Any, program: StoredProgram, include_points: bool) -> None:
    """get_program."""
    response.movements = [
        planned_movement_to_msg(movement, include_points) for movement in program.movements
    ]
    response.report = report_to_msg(program.report)


def fill_export(response: Any, export: KrlExport) -> None:
    """export_program."""
    response.text = export.source
    response.data = export.data
    response.plc_table = export.plc_table
    response.plc_text = export.plc_text
    response.deviation = export.deviation
    response.planned = report_to_msg(export.planned)
    response.exported = report_to_msg(export.exported)


def fill_evaluation(response: Any, evaluation: Evaluation) -> None:
    """evaluate_trajectory: report and both profiles on the times of the clearance profile."""
    response.report = report_to_msg(evaluation.report)
    clearance = evaluation.clearance
    energy = evaluation.energy
    response.times = float_array(clearance.times)
    response.distances = float_array(clearance.distances)
    watts = np.zeros(len(clearance.times))
    if len(energy.times):
        watts = np.interp(clearance.times, energy.times, energy.watts)
    response.watts = float_array(watts)


def fill_standby(response: Any, standby: Standby, timers: str) -> None:
    """plan_standby; timers: where the controller's timers are from."""
    response.timers = timers
    response.controller_timer = standby.timer
    response.saving_on_motors = standby.saving_on_motors
    response.chosen = power_mode_to_msg(standby.chosen)
    response.wake_at = standby.wake_at
    response.energy = standby.energy
    response.modes = list(standby.modes)
    response.switch_times = list(standby.switch_times)
    response.expected = standby.expected
    response.worst = standby.worst
    response.clairvoyant = standby.clairvoyant
    response.posture = standby.posture
    response.posture_energies = list(standby.posture_energies)
    response.saving = standby.saving
    response.saving_low = standby.saving_low
    response.saving_high = standby.saving_high
    response.alternatives = [power_mode_to_msg(mode) for mode in standby.alternatives]
    response.alternative_energies = [float(energy) for energy in standby.energies]
