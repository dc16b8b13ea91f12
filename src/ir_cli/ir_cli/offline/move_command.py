"""`ir move`: one movement between two configurations, with what it costs."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.savings import one_sided
from ir_planner import assumed_doors

from .asking import (
    add_cell,
    add_options,
    add_parameters,
    configuration_of,
    failed,
    goal_of,
    options_of,
    planner_of,
    sentences,
)
from .output import Row, add_formats, print_json
from .trace_file import write_trace


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add move."""
    move = commands.add_parser("move", help="plan one movement from START to GOAL; needs no ROS")
    add_cell(move)
    form = 'a posture, a station, "A1 0 A2 -90 ..." in degrees or "X 1.8 Y 0 ..." in m and degrees'
    move.add_argument("start", metavar="START", help=form)
    move.add_argument("goal", metavar="GOAL", help="the same")
    move.add_argument(
        "--duration", type=float, default=0.0, metavar="S", help="s it takes; 0: the best (0)"
    )
    move.add_argument("--trajectory", type=Path, metavar="FILE", help="write its points as CSV")
    add_options(move)
    add_parameters(move)
    add_formats(move, comma=False)
    move.set_defaults(run=run_move)


def run_move(arguments: argparse.Namespace) -> int:
    """Plan and print; exit code 1 where nothing is found."""
    with sentences():
        planner = planner_of(arguments.cell, arguments.power_parameters)
        start = configuration_of(
            arguments.start, planner, arguments.safety_distance, arguments.load
        )
        goal = goal_of(arguments.goal, planner)
        plan = planner.plan_regional(start, goal, options_of(arguments, arguments.duration))
    notes = assumed_doors(planner.cell)
    said = "".join(f"\nnote: {note}" for note in notes)
    if plan.trajectory is None:
        return failed(plan.status.message + said)
    if arguments.trajectory:
        write_trace(arguments.trajectory, plan.trajectory)
    if arguments.json:
        figures = figures_of(plan.report)
        print_json({"trajectory_id": plan.trajectory.trajectory_id, **figures, "notes": notes})
    else:
        sys.stdout.write(f"{sentence_of(plan.report)}{said}\n")
    return 0


def figures_of(report: TrajectoryReport) -> Row:
    """What a trajectory costs and keeps, SI units."""
    closest = report.closest
    return {
        "seconds": report.duration,
        "joules": report.energy,
        "joules_low": report.energy_low,
        "joules_high": report.energy_high,
        "power_parameters": report.power_parameters,
        "torque_reserve": report.torque_reserve,
        "base_joules": report.base_energy,
        "dissipated_joules": report.burnt_energy,
        "joint_joules": report.joint_energy,
        "peak_watts": report.peak_power,
        "clearance": report.min_clearance,
        "closest": None if closest is None else [closest.body_a, closest.body_b],
        "certified": report.certified,
        "velocity_share": report.velocity_ratio,
        "acceleration_share": report.acceleration_ratio,
        "jerk_share": report.jerk_ratio,
        "torque_share": report.torque_ratio,
    }


def predicted(report: TrajectoryReport) -> str:
    """The interval of an energy, and what it follows from."""
    low = report.energy_low
    high = report.energy_high
    within = (
        f"{low:.0f} to {high:.0f} J" if high < 1e5 else f"{low / 1e3:.1f} to {high / 1e3:.1f} kJ"
    )
    why = one_sided(report.energy, low, high)
    return f"90 % interval {within} by {report.power_parameters}{f', {why}' if why else ''}"


def sentence_of(report: TrajectoryReport) -> str:
    """The same for people."""
    near = report.closest
    pair = (
        ""
        if near is None
        else f" between {near.body_a} and {near.body_b} at {report.closest_time:.2f} s"
    )
    used = max(
        float(share.max(initial=0.0))
        for share in (
            report.velocity_ratio,
            report.acceleration_ratio,
            report.jerk_ratio,
            report.torque_ratio,
        )
    )
    return (
        f"{report.duration:.3f} s, {report.energy:.0f} J from the mains, predicted "
        f"({predicted(report)}), "
        f"at most {report.peak_power / 1e3:.1f} kW\n"
        f"clearance {report.min_clearance * 1e3:.1f} mm{pair}; uses {100.0 * used:.0f} % of a "
        "limit; "
        f"{'certified' if report.certified else 'NOT certified'}"
    )
