"""`ir-report FILE [-o out/report.html]`: explains a recording as one HTML page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from ir_recorder.analysis import analyse
from ir_recorder.errors import RecorderError
from ir_recorder.picture import write_picture
from ir_recorder.reader import read_recording
from ir_recorder.report.page import write_report


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns 0 when the page was written, 1 with a sentence when not."""
    parser = argparse.ArgumentParser(prog="ir-report", description="Explains a recording as one HTML page.")
    parser.add_argument("file", help="recording (.mcap)")
    parser.add_argument("-o", "--output", default="out/report.html", help="page to write")
    parser.add_argument("--picture", default="", help="picture to write as well (.png)")
    options = parser.parse_args(arguments)
    try:
        analysis = analyse(read_recording(options.file))
        page = write_report(analysis, options.output)
        sys.stdout.write(f"{page}\n")
        if options.picture:
            sys.stdout.write(f"{write_picture(analysis, options.picture)}\n")
    except RecorderError as error:
        sys.stderr.write(f"ir-report: {error}\n")
        return 1
    for problem in analysis.problems:
        sys.stderr.write(f"ir-report: {problem}\n")
    return 0
