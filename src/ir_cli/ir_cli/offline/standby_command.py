"""`ir standby`: the power mode of least energy for a pause, beside the others."""

from __future__ import annotations

import argparse
import sys

from .asking import add_cell, add_parameters, configuration_of, planner_of, sentences
from .output import Row, add_formats, number, print_csv, print_json, print_table, text

COLUMNS = {
    "mode": ("mode", text),
    "joules": ("J", number(0)),
    "watts": ("W", number(0)),
    "shortest_pause": ("shortest pause s", number(1)),
    "break_even": ("saves from s", number(1)),
}


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add standby."""
    standby = commands.add_parser(
        "standby", help="the power mode of least energy for a pause; needs no ROS"
    )
    add_cell(standby)
    standby.add_argument(
        "--pause", type=float, required=True, metavar="S", help="s from stop to next start"
    )
    standby.add_argument("--state", default="home", help="where the robot stands (home)")
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
        q = configuration_of(arguments.state, planner, 0.0, arguments.load)
        found = planner.standby(arguments.pause, q, arguments.load)
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
        print_table(rows, COLUMNS)
        sys.stdout.write(f"{found.sentence}; wake it after {found.wake_at:.1f} s\n")
    return 0
