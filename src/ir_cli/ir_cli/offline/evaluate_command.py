"""`ir evaluate`: what a measured or planned trace costs, and the first limit that it violates."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from .asking import FAILED, add_cell, add_margin, add_parameters, planner_of, sentences
from .measured_options import add_measured, measured_figures, motion_of
from .move_command import figures_of, sentence_of
from .output import ProgressLine, add_formats, print_json


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add evaluate."""
    evaluate = commands.add_parser(
        "evaluate", help="joules, limits and clearance of a trajectory in a file; needs no ROS"
    )
    add_cell(evaluate)
    evaluate.add_argument(
        "trace",
        type=Path,
        metavar="TRACE",
        help="CSV with time and joints, Parquet, or a recording",
    )
    add_measured(evaluate)
    evaluate.add_argument("--station", default="", help="whose allowed contacts hold in its zone")
    add_margin(evaluate)
    add_parameters(evaluate)
    add_formats(evaluate, comma=False)
    evaluate.set_defaults(run=run_evaluate)


def run_evaluate(arguments: argparse.Namespace) -> int:
    """Evaluate and print; exit code 1 where a limit or the clearance is violated."""
    with sentences(), ProgressLine() as line:
        planner = planner_of(arguments.cell, arguments.power_parameters)
        margin = arguments.safety_distance
        load = arguments.load
        station = arguments.station
        known, trajectory = motion_of(arguments, planner, line.show)
        line.show("evaluate", 0, 1, 0.0)
        found = planner.evaluate(trajectory, margin, load, station)
    verification = found.verification
    if arguments.json:
        violations = [v for v in (verification.violation, *verification.others) if v is not None]
        listed = [{"what": v.what, "seconds": v.time, "sentence": v.sentence} for v in violations]
        print_json({**figures_of(found.report), **measured_figures(known), "violations": listed})
    else:
        sys.stdout.write(sentence_of(found.report) + "\n")
        if known is not None:
            sys.stdout.write("\n".join(known.sentences) + "\n")
        if verification.violation is not None:
            sys.stdout.write(f"violated: {verification.status.message}\n")
    return 0 if verification.certified else FAILED
