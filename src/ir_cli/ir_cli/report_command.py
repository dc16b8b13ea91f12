"""`ir report`: one HTML page of a recording."""

from __future__ import annotations

import argparse

from ir_recorder import report_main


def add_commands(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add report."""
    report = commands.add_parser("report", help="write the HTML report of a recording")
    report_main.add_arguments(report)
    report.set_defaults(run=report_main.run)
