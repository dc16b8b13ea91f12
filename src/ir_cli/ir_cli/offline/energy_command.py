"""`ir energy`: direct against indirect measurement, parameters fitted to a meter, movements that identify
them.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ir_recorder import analyse, read_recording
from ir_recorder.analysis.agreement import agreement

from .output import Columns, Row, add_formats, number, print_csv, print_json, print_table, text

COMPARED: Columns = {
    "movement": ("movement", text),
    "seconds": ("s", number(2)),
    "direct": ("meter J", number(0)),
    "indirect": ("from positions J", number(0)),
    "difference": ("difference %", number(1, 100.0)),
    "from_torques": ("from torques J", number(0)),
    "second_opinion": ("by Pinocchio J", number(0)),
}


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add energy compare."""
    energy = commands.add_parser(
        "energy",
        help="compare measurements, fit power parameters, plan what identifies them; needs no ROS",
    )
    verbs = energy.add_subparsers(dest="verb", required=True)
    compare = verbs.add_parser("compare", help="the meter beside the energy from positions, by movement")
    compare.add_argument("recording", type=Path, metavar="RECORDING", help="a recording (.mcap)")
    add_formats(compare)
    compare.set_defaults(run=run_compare)


def run_compare(arguments: argparse.Namespace) -> int:
    """Print both measurements of every movement; exit code 1 where there is nothing to compare."""
    analysis = analyse(read_recording(arguments.recording))
    both = agreement(analysis)
    rows: list[Row] = [
        {
            "movement": row.label,
            "seconds": row.seconds,
            "direct": row.direct,
            "indirect": row.indirect,
            "difference": row.difference,
            "from_torques": row.from_torques,
            "second_opinion": row.second_opinion,
        }
        for row in both.movements
    ]
    if arguments.json:
        mean = both.difference
        interval = {"mean": mean.value, "low": mean.low, "high": mean.high, "spread": both.spread}
        source = analysis.recording.hardware
        print_json({"source": source, "movements": rows, "difference": interval, "sentence": both.sentence})
    elif arguments.csv:
        print_csv(rows)
    else:
        sys.stdout.write(f"{analysis.recording.hardware or 'measured on an unknown robot'}\n")
        print_table(rows, COMPARED)
        sys.stdout.write(f"{both.sentence}\n")
    return 0 if rows else 1
