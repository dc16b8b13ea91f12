"""`ir report`: one HTML page of a recording, or of several side by side."""

from __future__ import annotations

import argparse

from ir_recorder.report_main import add_arguments, run


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add report."""
    report = commands.add_parser(
        "report", help="write the HTML report of a recording, or compare several"
    )
    add_arguments(report)
    report.set_defaults(run=run)
