"""`ir-report FILE [-o out/report.html]`: explains a recording as one HTML page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from ir_msgs_py.errors import MsgsError
from ir_msgs_py.file_roots import FileRoots
from ir_recorder.analysis import analyse, findings
from ir_recorder.arguments import add_roots
from ir_recorder.errors import RecorderError
from ir_recorder.read.reader import read_recording
from ir_recorder.report import write_report
from ir_recorder.report.costs import read_costs
from ir_recorder.report.picture import write_picture


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds what `run` reads."""
    parser.add_argument("file", help="recording (.mcap)")
    parser.add_argument("-o", "--output", default="out/report.html", help="page to write (out/report.html)")
    parser.add_argument("--namespace", help="of the cell, where the recording holds several")
    add_roots(parser)
    parser.add_argument("--costs", default="", help="prices, shifts and CO2 (YAML); else as assumed")
    parser.add_argument("--picture", default="", help="picture to write as well (.png)")


def run(options: argparse.Namespace) -> int:
    """Writes the page and prints its path; RecorderError when the file can't be read or the page not be
    written.
    """
    roots = FileRoots.of(options.roots)
    analysis = analyse(read_recording(options.file, roots, namespace=options.namespace))
    for problem in analysis.problems:
        sys.stderr.write(f"{options.file}: {problem}\n")
    costs = read_costs(options.costs, roots) if options.costs else None
    page = write_report(analysis, findings(analysis), options.output, roots=roots, costs=costs)
    sys.stdout.write(f"{page}\n")
    if options.picture:
        sys.stdout.write(f"{write_picture(analysis, options.picture, roots)}\n")
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns 0 when the page was written, 1 with a sentence when not."""
    parser = argparse.ArgumentParser(prog="ir-report", description="Explains a recording as one HTML page.")
    add_arguments(parser)
    try:
        return run(parser.parse_args(arguments))
    except (RecorderError, MsgsError) as error:
        sys.stderr.write(f"ir-report: {error}\n")
        return 1
