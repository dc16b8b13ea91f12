"""Single questions to the planner: a movement, a path, configurations, a state, a pause."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from ir_cli.errors import InputError, unknown_name
from ir_cli.output import (
    Row,
    add_formats,
    add_renamed,
    number,
    print_csv,
    print_json,
    print_table,
    text,
)
from ir_cli.planning import (
    FAILED,
    add_cell,
    add_margin,
    add_options,
    add_parameters,
    configuration_of,
    failed,
    figures_of,
    goal_of,
    options_of,
    planner_of,
    sentence_of,
    sentences,
)
from ir_cli.traces import write_trace
from ir_description import UnknownNameError, is_path
from ir_description.cell import CellPath
from ir_description.library import load_path
from ir_msgs_py.cartesian import CartesianPath
from ir_msgs_py.report import DistancePair
from ir_planner import CartesianPlan, Planner
from ir_planner.before_after import assumed_doors
from ir_planner.search import SEARCHES


def add_move(move: argparse.ArgumentParser) -> None:
    """Arguments of `ir ask move`."""
    add_cell(move)
    form = 'a posture, a station, "A1 0 A2 -90 ..." in degrees or "X 1.8 Y 0 ..." in m and degrees'
    move.add_argument("start", metavar="START", help=form)
    move.add_argument("goal", metavar="GOAL", help="the same")
    move.add_argument(
        "--duration", type=float, default=0.0, metavar="S", help="s it takes; 0: the best (0)"
    )
    output = move.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="write its points as CSV"
    )
    add_renamed(move, "--trajectory", output)
    words = "the search to ask alone, one of an installed package too (several in turn)"
    move.add_argument("--planner", default="", metavar="NAME", help=words)
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
        options = replace(options_of(arguments, arguments.duration), planner_id=arguments.planner)
        plan = planner.plan_regional(start=start, goal=goal, options=options)
    notes = assumed_doors(planner.cell)
    if origin := SEARCHES.origin(plan.info.planner_id):
        notes = (*notes, f"planner {plan.info.planner_id} is of the package {origin}")
    said = "".join(f"\nnote: {note}" for note in notes)
    if plan.trajectory is None:
        return failed(plan.status.message + said)
    if arguments.output:
        write_trace(arguments.output, plan.trajectory)
    if arguments.json:
        figures = figures_of(plan.report)
        print_json({"trajectory_id": plan.trajectory.trajectory_id, **figures, "notes": notes})
    else:
        sys.stdout.write(f"{sentence_of(plan.report, planner)}{said}\n")
    return 0


def add_escape(escape: argparse.ArgumentParser) -> None:
    """Arguments of `ir ask escape`."""
    add_cell(escape)
    words = 'where the robot stands: "A1 0 A2 -90 ..." in degrees, also beyond a limit'
    escape.add_argument("start", metavar="START", help=words)
    escape.add_argument("--station", default="", help="whose allowed contacts hold")
    escape.add_argument("-o", "--output", type=Path, metavar="FILE", help="write its points as CSV")
    add_options(escape)
    add_parameters(escape)
    add_formats(escape, comma=False)
    escape.set_defaults(run=run_escape)


def run_escape(arguments: argparse.Namespace) -> int:
    """Plan and print; exit code 1 where there is no way out on which nothing gets worse."""
    with sentences():
        planner = planner_of(arguments.cell, arguments.power_parameters)
        plan = planner.plan_escape(
            arguments.start, station=arguments.station, options=options_of(arguments)
        )
    if not plan.status.ok:
        return failed(plan.status.message)
    if plan.trajectory is None or plan.waypoints is None:
        sys.stdout.write(f"{plan.status.message}\n")
        return 0
    if arguments.output:
        write_trace(arguments.output, plan.trajectory)
    if arguments.json:
        gained = [
            {**_pair_row(pair), "left": left}
            for pair, left in zip(plan.pairs, plan.left, strict=True)
        ]
        figures = {**figures_of(plan.report), "waypoints": plan.waypoints, "pairs": gained}
        print_json({"trajectory_id": plan.trajectory.trajectory_id, **figures})
        return 0
    steps = len(plan.waypoints) - 1
    sys.stdout.write(
        f"{plan.report.duration:.2f} s, {plan.report.energy:.0f} J, {steps} "
        f"step{'' if steps == 1 else 's'}, proved: nothing gets nearer or farther beyond a limit\n"
    )
    for pair, left in zip(plan.pairs, plan.left, strict=True):
        sys.stdout.write(
            f"{pair.body_a} and {pair.body_b} ({pair.kind}): {1e3 * pair.distance:.1f} mm, "
            f"{1e3 * left:.1f} mm at the end\n"
        )
    robot = planner.cell.robot
    last = robot.in_people_units(plan.waypoints[-1])
    end = " ".join(f"{robot.axis_label(k)} {value:.2f}" for k, value in enumerate(last))
    sys.stdout.write(f"it ends at {end}\n")
    return 0


def add_path(path: argparse.ArgumentParser) -> None:
    """Arguments of `ir ask path`."""
    add_cell(path)
    words = "a path of the cell file by its name, or a file with a path (docs/cartesian.md)"
    path.add_argument("path", metavar="PATH", help=words)
    path.add_argument(
        "--start", default="", metavar="Q", help='"A1 0 A2 -90 ...": begin there (the best)'
    )
    path.add_argument(
        "--t1", action="store_true", help="at most 250 mm/s at the tcp and the flange"
    )
    output = path.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="write its points as CSV"
    )
    add_renamed(path, "--trajectory", output)
    add_options(path)
    add_parameters(path)
    add_formats(path, comma=False)
    path.set_defaults(run=run_path)


def run_path(arguments: argparse.Namespace) -> int:
    """Plan and print; exit code 1 where the path can't be driven so."""
    with sentences():
        planner = planner_of(arguments.cell, arguments.power_parameters)
        path = _asked_path(arguments.path, planner)
        start = None
        if arguments.start:
            start = configuration_of(
                arguments.start, planner, arguments.safety_distance, arguments.load
            )
        plan = planner.plan_cartesian(
            path, options=options_of(arguments), start=start, t1=arguments.t1
        )
    notes = assumed_doors(planner.cell)
    said = "".join(f"\nnote: {note}" for note in notes)
    if plan.trajectory is None:
        return failed(plan.status.message + said)
    if arguments.output:
        write_trace(arguments.output, plan.trajectory)
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
        sys.stdout.write(f"{sentence_of(plan.report, planner)}\n{_kept(plan)}{said}\n")
    return 0


def _asked_path(text: str, planner: Planner) -> CartesianPath | CellPath:
    if is_path(text):
        return load_path(text)
    if not planner.cell.paths:
        raise InputError(f"cell {planner.cell.name} has no paths: give a file, as seam.yaml")
    try:
        return planner.cell.own_path(text)
    except UnknownNameError as error:
        listing = f"ir check {planner.cell.name}"
        raise InputError(unknown_name("path", text[:80], error.known, listing)) from error


def _kept(plan: CartesianPlan) -> str:
    notes = [f"\n{stage.note}" for stage in plan.info.stages if stage.name in _SHOWN]
    return (
        f"{plan.lengths[-1]:.3f} m; the tool within {plan.tool_error * 1e3:.3f} mm of its path "
        f"and within {100.0 * plan.speed_deviation:.2f} % of its speed; {plan.configurations} "
        "configurations looked at" + "".join(notes)
    )


_SHOWN = ("speed", "t1")  # stages whose remarks matter to whoever drives the path


PAIRS = {
    "body_a": ("pair", text),
    "body_b": ("", text),
    "kind": ("kind", text),
    "distance": ("distance mm", number(1, 1e3)),
    "allowed_contact": ("allowed", lambda value: "yes" if value else ""),
}


def add_ik(ik: argparse.ArgumentParser) -> None:
    """Arguments of `ir ask ik`."""
    add_cell(ik)
    ik.add_argument(
        "goal", metavar="GOAL", help='a station, or "X 1.8 Y 0 Z 1.2 A 0 B 90 C 0" (m, degrees)'
    )
    start = ik.add_argument(
        "--start", default="home", metavar="STATE", help="where their cost counts from (home)"
    )
    add_renamed(ik, "--near", start)
    ik.add_argument("--method", choices=("analytic", "ccd"), default="analytic")
    add_margin(ik)
    add_formats(ik)
    ik.set_defaults(run=run_ik)


def add_check(check: argparse.ArgumentParser) -> None:
    """Arguments of `ir ask state`."""
    add_cell(check)
    check.add_argument("state", metavar="STATE", help='a posture, or "A1 0 A2 -90 ..." in degrees')
    check.add_argument("--station", default="", help="whose allowed contacts hold")
    check.add_argument("--pairs", type=int, default=5, help="nearest pairs to print (5)")
    add_margin(check)
    add_formats(check)
    check.set_defaults(run=run_check)


def run_ik(arguments: argparse.Namespace) -> int:
    """Print the free configurations, cheapest first; exit code 1 where there is none."""
    margin = arguments.safety_distance
    load = arguments.load
    with sentences():
        planner = planner_of(arguments.cell)
        near = configuration_of(arguments.start, planner, margin, load)
        answer = planner.compute_ik(
            goal_of(arguments.goal, planner),
            method=arguments.method,
            safety_distance=margin,
            near=near,
            load=load,
        )
    if not answer.solutions:
        return failed(answer.status.message)
    rows: list[Row] = [
        {
            **dict(zip(found.joint_names, found.q.tolist(), strict=True)),
            "clearance": found.clearance,
            "movement_cost": found.movement_cost,
            "branch": found.branch,
            "pair": ""
            if found.closest is None
            else f"{found.closest.body_a} - {found.closest.body_b}",
        }
        for found in answer.solutions
    ]
    if arguments.json:
        print_json({"configurations": rows})
    elif arguments.csv:
        print_csv(rows)
    else:
        robot = planner.cell.robot
        titles = {
            name: (
                f"{robot.axis_label(k)} {robot.unit(k)}",
                number(1, 180.0 / np.pi) if k >= robot.base else number(3),
            )
            for k, name in enumerate(robot.joint_names)
        }
        ends = {
            "clearance": ("clearance mm", number(1, 1e3)),
            "movement_cost": ("W", number(0)),
            "branch": ("branch", text),
            "pair": ("nearest pair", text),
        }
        print_table(rows, titles | ends)
    return 0


def run_check(arguments: argparse.Namespace) -> int:
    """Print the nearest pairs; exit code 1 where one is too near."""
    margin = arguments.safety_distance
    load = arguments.load
    with sentences():
        planner = planner_of(arguments.cell)
        q = configuration_of(arguments.state, planner, margin, load, "state")
        found = planner.check_state(
            q,
            safety_distance=margin,
            max_pairs=arguments.pairs,
            load=load,
            station=arguments.station,
        )
    rows = [_pair_row(pair) for pair in found.pairs]
    if arguments.json:
        print_json({"valid": found.valid, "min_distance": found.min_distance, "pairs": rows})
    elif arguments.csv:
        print_csv(rows)
    else:
        verdict = (
            f"free: every pair keeps {margin * 1e3:g} mm" if found.valid else found.status.message
        )
        sys.stdout.write(verdict + "\n")
        print_table(rows, PAIRS)
    return 0 if found.valid else FAILED


def _pair_row(pair: DistancePair) -> Row:
    """A pair as a row of the answer."""
    return {
        "body_a": pair.body_a,
        "body_b": pair.body_b,
        "kind": str(pair.kind),
        "distance": pair.distance,
        "allowed_contact": pair.allowed_contact,
    }


MODES = {
    "mode": ("mode", text),
    "joules": ("J", number(0)),
    "watts": ("W", number(0)),
    "shortest_pause": ("shortest pause s", number(1)),
    "break_even": ("saves from s", number(1)),
}


def add_standby(standby: argparse.ArgumentParser) -> None:
    """Arguments of `ir ask standby`."""
    add_cell(standby)
    standby.add_argument(
        "--pause", type=float, required=True, metavar="S", help="s from stop to next start"
    )
    start = standby.add_argument(
        "--start", default="home", metavar="STATE", help="where the robot stands (home)"
    )
    add_renamed(standby, "--state", start)
    standby.add_argument(
        "--load", default="", help='what is held: "gripper+part", "none" (the tool)'
    )
    add_parameters(standby)
    add_formats(standby)
    standby.set_defaults(run=run_standby)


def run_standby(arguments: argparse.Namespace) -> int:
    """Print the modes, shallow to deep, and the one to choose."""
    with sentences():
        planner = planner_of(arguments.cell, arguments.power_parameters)
        q = configuration_of(arguments.start, planner, 0.0, arguments.load)
        found = planner.standby(arguments.pause, q=q, load=arguments.load)
    rows: list[Row] = [
        {
            "mode": mode.name,
            "joules": joules,
            "watts": mode.power,
            "shortest_pause": mode.time_min_pause,
            "break_even": mode.break_even,
        }
        for mode, joules in zip(found.alternatives, found.energies, strict=True)
    ]
    if arguments.json:
        chosen = {"chosen": found.chosen.name, "wake_at": found.wake_at, "joules": found.energy}
        asked = zip(found.modes, found.switch_times, strict=True)
        within = {"saving_low": found.saving_low, "saving_high": found.saving_high}
        modes = [{"mode": mode, "seconds": seconds} for mode, seconds in asked]
        print_json(
            {**chosen, "modes": modes, "saving": found.saving, **within, "alternatives": rows}
        )
    elif arguments.csv:
        print_csv(rows)
    else:
        print_table(rows, MODES)
        sys.stdout.write(f"{found.sentence}; wake it after {found.wake_at:.1f} s\n")
    return 0
