"""`ir-report FILE [-o out/report.html]`: explains a recording as one HTML page, compares several on
one.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from ir_description import DescriptionError, PowerParameters, cell_from_yaml
from ir_description.library import load_power_parameters
from ir_recorder.analysis import Analysis, analyse, findings
from ir_recorder.analysis.meter import with_meter
from ir_recorder.arguments import add_roots, roots_of
from ir_recorder.errors import ReadError, RecorderError
from ir_recorder.format import contents
from ir_recorder.format.contents import is_further_part
from ir_recorder.reading.planner_answers import recorded_front
from ir_recorder.reading.reader import read_recording
from ir_recorder.reading.recording import Recording
from ir_recorder.report import write_report
from ir_recorder.report.number_text import add_locale
from ir_recorder.report.picture import write_picture
from ir_recorder.report.prices import read_costs
from ir_recorder.report.side_by_side import MOST, write_comparison
from ir_recorder.report.step_table import write_table
from ir_recorder.traces import read_mapping
from ir_values.errors import IrError
from ir_values.files import FileRoots


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds what `run` reads."""
    parser.add_argument(
        "files", nargs="+", help="recordings (.mcap), or folders of them; several are compared"
    )
    parser.add_argument(
        "-o", "--output", default="out/report.html", help="page to write (out/report.html)"
    )
    parser.add_argument("--namespace", help="of the cell, where the recording holds several")
    words = (
        "what joules are predicted and rebuilt by, as a fit writes it (the plan's, and the "
        "data sheet)"
    )
    parser.add_argument("--power-parameters", default="", metavar="FILE", help=words)
    add_roots(parser)
    parser.add_argument(
        "--costs", default="", help="prices, shifts and CO2 (YAML); else as assumed"
    )
    meter = "a power meter's file (.csv, .parquet) in place of the recorded watts, of one recording"
    parser.add_argument("--meter", default="", metavar="FILE", help=meter)
    parser.add_argument(
        "--meter-mapping", default="", metavar="FILE", help="what its columns are (.yaml)"
    )
    parser.add_argument(
        "--table", default="", help="steps as a table to write as well (.csv, .xlsx or .parquet)"
    )
    add_locale(parser)
    parser.add_argument(
        "--picture", default="", help="picture to write as well (.png), of one recording"
    )


def run(options: argparse.Namespace) -> int:
    """Writes the page and prints its path; RecorderError when nothing can be read or written."""
    roots = roots_of(options.roots)
    costs = read_costs(options.costs, roots) if options.costs else None
    analyses = _analyses(options, roots)
    compared = [(analysis, findings(analysis)) for analysis in analyses]
    if len(compared) > 1:
        page = write_comparison(compared, options.output, roots, costs)
    else:
        front = recorded_front(analyses[0].recording.path, roots, options.namespace)
        page = write_report(*compared[0], options.output, roots=roots, costs=costs, front=front)
    sys.stdout.write(f"{page}\n")
    if options.table:
        sys.stdout.write(f"{write_table(analyses, options.table, roots, options.locale)}\n")
    if options.picture:
        sys.stdout.write(f"{write_picture(analyses[0], options.picture, roots)}\n")
    return 0


def _analyses(options: argparse.Namespace, roots: FileRoots) -> list[Analysis]:
    """The recordings asked for; one of a folder that can't be read is named and left out."""
    analyses = []
    for path, named in _paths(options.files, roots):
        try:
            recording = read_recording(path, roots, namespace=options.namespace)
            if not named and is_further_part(path, recording.fact(contents.PART)):
                continue  # its first file has given all
            parameters = _parameters(options.power_parameters, recording)
            analysis = analyse(_metered(recording, options, roots), parameters)
        except ReadError as error:
            if named:
                raise
            sys.stderr.write(f"{path}: left out: {error}\n")
            continue
        analyses.append(analysis)
        for problem in analysis.problems:
            sys.stderr.write(f"{path}: {problem}\n")
    if not analyses:
        raise ReadError(f"no recording could be read below {', '.join(map(str, options.files))}")
    return analyses


def _metered(recording: Recording, options: argparse.Namespace, roots: FileRoots) -> Recording:
    """The recording, with the readings of a meter's file where one is named."""
    if not options.meter:
        return recording
    mapping = read_mapping(roots.inside(options.meter_mapping)) if options.meter_mapping else None
    return with_meter(recording, roots.inside(options.meter), mapping)


def _paths(files: Sequence[str], roots: FileRoots) -> list[tuple[Path, bool]]:
    """Files to read, and whether each was named itself; a folder stands for its recordings, by
    name.
    """
    paths: list[tuple[Path, bool]] = []
    for name in files:
        if Path(name).is_dir():
            inner = roots.inside(name)
            paths += [
                (path, False) for path in sorted([*inner.glob("*.mcap"), *inner.glob("*.db3")])
            ]
        else:
            paths.append((Path(name), True))
    if len(paths) > MOST:
        raise ReadError(f"{len(paths)} recordings are too many to compare: at most {MOST}")
    return paths


def _parameters(path: str, recording: Recording) -> PowerParameters | None:
    """Those of a file, of the robot of the recording's cell where it carries one."""
    if not path:
        return None
    try:
        carried = recording.cell_yaml
        robot = cell_from_yaml(carried, "the attached cell").robot if carried else None
        return load_power_parameters(path, robot)
    except DescriptionError as error:
        raise RecorderError(str(error)) from error


def main(arguments: Sequence[str] | None = None) -> int:
    """Returns 0 when the page was written, 1 with a sentence when not."""
    parser = argparse.ArgumentParser(
        prog="ir-report", description="Explains a recording as one HTML page, compares several."
    )
    add_arguments(parser)
    try:
        return run(parser.parse_args(arguments))
    except (RecorderError, IrError) as error:
        sys.stderr.write(f"ir-report: {error}\n")
        return 1
