"""`ir ik` and `ir check`: configurations that reach a pose, and whether one of them is free."""

from __future__ import annotations

import argparse
import sys

import numpy as np

from ir_msgs_py.report import DistancePair

from .asking import (
    FAILED,
    add_cell,
    add_margin,
    configuration_of,
    failed,
    goal_of,
    planner_of,
    sentences,
)
from .output import Row, add_formats, number, print_csv, print_json, print_table, text

PAIRS = {
    "body_a": ("pair", text),
    "body_b": ("", text),
    "kind": ("kind", text),
    "distance": ("distance mm", number(1, 1e3)),
    "allowed_contact": ("allowed", lambda value: "yes" if value else ""),
}


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add ik and check."""
    ik = commands.add_parser(
        "ik", help="all configurations that reach a pose or a station; needs no ROS"
    )
    add_cell(ik)
    ik.add_argument(
        "goal", metavar="GOAL", help='a station, or "X 1.8 Y 0 Z 1.2 A 0 B 90 C 0" (m, degrees)'
    )
    ik.add_argument(
        "--near", default="home", metavar="STATE", help="where their cost counts from (home)"
    )
    ik.add_argument("--method", choices=("analytic", "ccd"), default="analytic")
    add_margin(ik)
    add_formats(ik)
    ik.set_defaults(run=run_ik)

    check = commands.add_parser(
        "check", help="whether a configuration is free, and its nearest pairs; needs no ROS"
    )
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
        near = configuration_of(arguments.near, planner, margin, load)
        answer = planner.compute_ik(
            goal_of(arguments.goal, planner), arguments.method, margin, near, load
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
        joints = planner.cell.robot.joint_names
        titles = {
            name: (f"A{k} deg", number(1, 180.0 / np.pi)) for k, name in enumerate(joints, start=1)
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
        q = configuration_of(arguments.state, planner, margin, load)
        found = planner.check_state(q, margin, arguments.pairs, load, arguments.station)
    rows = [_row(pair) for pair in found.pairs]
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


def _row(pair: DistancePair) -> Row:
    return {
        "body_a": pair.body_a,
        "body_b": pair.body_b,
        "kind": str(pair.kind),
        "distance": pair.distance,
        "allowed_contact": pair.allowed_contact,
    }
