"""`ir path`: the tool along a path of the cell file, or of a file of its own, with what it
costs.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ir_description import CellPath, UnknownNameError, is_path, load_path
from ir_msgs_py.cartesian import CartesianPath
from ir_planner import CartesianPlan, Planner, assumed_doors

from ..errors import InputError
from ..suggestions import unknown_name
from .asking import (
    add_cell,
    add_options,
    add_parameters,
    configuration_of,
    failed,
    options_of,
    planner_of,
    sentences,
)
from .move_command import figures_of, sentence_of
from .output import add_formats, print_json
from .trace_file import write_trace


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add path."""
    path = commands.add_parser(
        "path", help="drive the tool along a path at a given speed; needs no ROS"
    )
    add_cell(path)
    words = "a path of the cell file by its name, or a file with a path (docs/cartesian.md)"
    path.add_argument("path", metavar="PATH", help=words)
    path.add_argument(
        "--start", default="", metavar="Q", help='"A1 0 A2 -90 ...": begin there (the best)'
    )
    path.add_argument(
        "--t1", action="store_true", help="at most 250 mm/s at the tcp and the flange"
    )
    path.add_argument("--trajectory", type=Path, metavar="FILE", help="write its points as CSV")
    add_options(path)
    add_parameters(path)
    add_formats(path, comma=False)
    path.set_defaults(run=run_path)


def run_path(arguments: argparse.Namespace) -> int:
    """Plan and print; exit code 1 where the path can't be driven so."""
    with sentences():
        planner = planner_of(arguments.cell, arguments.power_parameters)
        path = _path(arguments.path, planner)
        start = None
        if arguments.start:
            start = configuration_of(
                arguments.start, planner, arguments.safety_distance, arguments.load
            )
        plan = planner.plan_cartesian(path, options_of(arguments), start, t1=arguments.t1)
    notes = assumed_doors(planner.cell)
    said = "".join(f"\nnote: {note}" for note in notes)
    if plan.trajectory is None:
        return failed(plan.status.message + said)
    if arguments.trajectory:
        write_trace(arguments.trajectory, plan.trajectory)
    if arguments.json:
        kept = {
            "tool_error": plan.tool_error,
            "rotation_error": plan.rotation_error,
            "speed_deviation": plan.speed_deviation,
            "lengths": plan.lengths,
            "configurations": plan.configurations,
        }
        figures = {**figures_of(plan.report), **kept, "notes": notes}
        print_json({"trajectory_id": plan.trajectory.trajectory_id, **figures})
    else:
        sys.stdout.write(f"{sentence_of(plan.report)}\n{_kept(plan)}{said}\n")
    return 0


def _path(text: str, planner: Planner) -> CartesianPath | CellPath:
    if is_path(text):
        return load_path(text)
    if not planner.cell.paths:
        raise InputError(f"cell {planner.cell.name} has no paths: give a file, as seam.yaml")
    try:
        return planner.cell.own_path(text)
    except UnknownNameError as error:
        listing = f"ir cell check {planner.cell.name}"
        raise InputError(unknown_name("path", text[:80], error.known, listing)) from error


def _kept(plan: CartesianPlan) -> str:
    notes = [f"\n{stage.note}" for stage in plan.info.stages if stage.name in _SHOWN]
    return (
        f"{plan.lengths[-1]:.3f} m; the tool within {plan.tool_error * 1e3:.3f} mm of its path "
        f"and within {100.0 * plan.speed_deviation:.2f} % of its speed; {plan.configurations} "
        "configurations looked at" + "".join(notes)
    )


_SHOWN = ("speed", "t1")  # stages whose remarks matter to whoever drives the path
