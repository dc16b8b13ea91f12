"""`ir compare`: today's program against the planner's, as a table and a page."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from ir_cli.errors import InputError
from ir_cli.krl import UR, add_followed, followed, is_project, plc_pauses
from ir_cli.output import (
    Columns,
    ProgressLine,
    Row,
    add_formats,
    kilowatt_hours,
    number,
    print_csv,
    print_json,
    print_table,
    text,
)
from ir_cli.planning import (
    add_cell,
    add_options,
    add_parameters,
    add_start,
    asked_program,
    mains_counted,
    options_of,
    planner_of,
    sentences,
    supply,
)
from ir_cli.trace_programs import today_of_trace
from ir_cli.traces import add_measured
from ir_msgs_py.savings import BeforeAfter, Side
from ir_planner import Planner
from ir_planner.before_after import before_after, before_after_common, today_of_krl
from ir_planner.krl import evaluate_krl

KRL = (".src", ".dat", ".sub", UR)
TRACES = (".csv", ".txt", ".parquet", ".mcap", ".db3", ".xml")
RECORDINGS = (".mcap", ".db3")
COLUMNS: Columns = {
    "program": ("program", text),
    "seconds": ("s", number(2)),
    "joules": ("J", number(0)),
    "joules_low": ("from", number(0)),
    "joules_high": ("to", number(0)),
    "kwh": ("mains", kilowatt_hours),
    "saved_share": ("saved %", number(1, 100.0)),
    "saved_joules": ("J", number(0)),
    "saved_low": ("from", number(0)),
    "saved_high": ("to", number(0)),
    "peak_watts": ("peak kW", number(1, 1e-3)),
    "peak_low": ("from", number(1, 1e-3)),
    "peak_high": ("to", number(1, 1e-3)),
    "clearance": ("clearance mm", number(1, 1e3)),
    "note": ("", text),
}


def add_compare(compare: argparse.ArgumentParser) -> None:
    """Arguments of `ir compare`."""
    from ir_recorder.report.number_text import add_locale

    add_cell(compare)
    words = (
        "a KRL program (.src, then .dat; a folder or .zip), or a trace (.csv, .parquet, .mcap, "
        ".db3, .xml); "
        "none: PTP at 100 %%"
    )
    compare.add_argument("today", nargs="*", type=Path, metavar="TODAY", help=words)
    compare.add_argument(
        "--stations", nargs="+", default=[], metavar="NAME", help="of PTP at 100 %%"
    )
    add_start(compare, "of PTP at 100 %%: ")
    compare.add_argument(
        "--cycle-time",
        type=float,
        default=0.0,
        metavar="S",
        help="what the line needs; 0: nobody said (0)",
    )
    compare.add_argument(
        "--costs", default="", metavar="FILE", help="prices, shifts and CO2 (YAML)"
    )
    page = "page to write, with both motions side by side (out/compare.html)"
    compare.add_argument(
        "-o", "--output", default="out/compare.html", metavar="FILE.html", help=page
    )
    compare.add_argument(
        "--table", default="", metavar="FILE", help="figures as .csv, .xlsx or .parquet as well"
    )
    add_locale(compare)
    add_followed(compare)
    words = (
        "of KRL: lines (5-9) whose motions are a process, that every program drives, repeatable; "
        "none: no motion is (those between an output's on and off)"
    )
    compare.add_argument("--process", action="append", default=[], metavar="LINES", help=words)
    add_measured(compare)
    add_options(compare)
    add_parameters(compare)
    add_formats(compare)
    compare.set_defaults(run=run_compare)


def run_compare(arguments: argparse.Namespace) -> int:
    """Compare, write the page, print the figures."""
    from ir_recorder.report.before_after import write_before_after, write_before_after_table
    from ir_recorder.report.prices import Costs, read_costs
    from ir_recorder.report.whole_line import of_saving

    files = [Path(arguments.cell), *arguments.today]
    if files[0].suffix.lower() in RECORDINGS:
        names = " ".join(map(str, files))
        raise InputError(f"{files[0]}: a recording, not a cell: use ir report {names}")
    costs = read_costs(arguments.costs) if arguments.costs else Costs()
    with sentences(), ProgressLine() as line:
        planner = planner_of(arguments.cell, arguments.power_parameters)
        found = _found(arguments, planner, line)
    page = write_before_after(found, planner.cell, arguments.output, costs)
    table = None
    if arguments.table:
        locale = arguments.locale
        table = write_before_after_table(found, arguments.table, costs, locale=locale)
    counted = mains_counted(planner)
    whole = of_saving(found.planned.saving, costs) if counted else None
    rows = [row_of(side) for side in (found.today, *found.sides)]
    if arguments.json:
        shares = {"whole_line": asdict(whole) if whole is not None else None}
        print_json(
            {"today": found.name, "kind": found.kind, "programs": rows, **_rest(found), **shares}
        )
    elif arguments.csv:
        print_csv(rows)
    else:
        print_table(rows, COLUMNS)
        apart = [] if counted else [f"all energies: {supply(planner)}"]
        said = [*_sentences(found), *apart, *([whole.sentence] if whole is not None else [])]
        sys.stdout.write("\n".join(said) + "\n")
        sys.stdout.write("".join(f"{path}\n" for path in (page, table) if path is not None))
    return 0


def _found(arguments: argparse.Namespace, planner: Planner, line: ProgressLine) -> BeforeAfter:
    """The comparison that the arguments ask for: today's stations, trace or KRL program against a
    plan of the same.
    """
    options = options_of(arguments)
    process = _process(arguments.process)
    endings = {KRL[0] if is_project(path) else path.suffix.lower() for path in arguments.today}
    if not endings:
        stations, start = asked_program(arguments, planner)
        return before_after_common(
            planner, stations, start, arguments.cycle_time, options, line.show
        )
    if arguments.process and not endings <= set(KRL):
        raise InputError("--process names lines of a KRL program: a trace has none")
    if arguments.stations:
        raise InputError("--stations are of PTP at 100 %: a program of yours has its own")
    if len(arguments.today) == 1 and endings <= set(TRACES):
        today = today_of_trace(arguments, planner, arguments.today[0], line.show)
        return before_after(planner, today, arguments.cycle_time, options, line.show)
    if not endings <= set(KRL):
        named = next(str(path) for path in arguments.today if path.suffix.lower() not in KRL)
        known = f"{', '.join(KRL)}, or one trace: {', '.join(TRACES)}"
        raise InputError(f"{named}: today's program is read from {known}")
    program = followed(arguments.today, planner, arguments)
    pauses = plc_pauses(program, arguments)
    evaluated = evaluate_krl(
        planner, program, arguments.safety_distance, arguments.load, plc=pauses
    )
    today = today_of_krl(evaluated, process)
    return before_after(planner, today, arguments.cycle_time, options, line.show)


def _process(words: Sequence[str]) -> tuple[tuple[int, int], ...] | None:
    """Lines (first, last) that are a process; None: nobody said."""
    if not words:
        return None
    if list(words) == ["none"]:
        return ()
    found = []
    for word in words:
        first, to, last = word.partition("-")
        if not first.isdecimal() or not (last if to else first).isdecimal():
            raise InputError(f"--process {word}: it must be lines as 5-9 or 5, or none")
        found.append((int(first), int(last or first)))
    return tuple(found)


def row_of(side: Side) -> Row:
    """Figures of one program, SI units but for kWh."""
    report = side.report
    saving = side.saving
    there = side.found
    own = side.name == "today"
    saved = (saving.share, saving.saved, saving.saved_low, saving.saved_high)
    share, joules, low, high = saved if there and not own else (None, None, None, None)
    return {
        "program": side.name,
        "seconds": report.duration if there else None,
        "joules": report.energy if there else None,
        "joules_low": report.energy_low if there else None,
        "joules_high": report.energy_high if there else None,
        "kwh": report.energy / 3.6e6 if there else None,
        "saved_share": share,
        "saved_joules": joules,
        "saved_low": low,
        "saved_high": high,
        "peak_watts": report.peak_power if there else None,
        "peak_low": side.peak[0] if there else None,
        "peak_high": side.peak[1] if there else None,
        "clearance": report.min_clearance if there else None,
        "certified": side.certified if there else None,
        "note": side.problem or _note(side),
    }


def _note(side: Side) -> str:
    if not side.certified:
        return "NOT certified"
    if side.name == "today" or side.saving.certain:
        return ""
    return "zero lies in the interval: open whether anything is saved"


def _sentences(found: BeforeAfter) -> list[str]:
    changes = [
        f"{change.name}: {change.words}: {change.saving.saved:.0f} J less "
        f"({change.saving.saved_low:.0f} to {change.saving.saved_high:.0f})"
        for change in found.changes
    ]
    head = [
        f"today: {found.name} ({found.kind}); changes towards: {found.towards}, the least work "
        "first"
    ]
    return [*head, *changes, *(f"note: {note}" for note in found.notes)]


def _rest(found: BeforeAfter) -> Row:
    changes = [
        {
            "name": change.name,
            "work": change.work,
            "words": change.words,
            "seconds": list(change.seconds),
            "saved_joules": change.saving.saved,
            "saved_low": change.saving.saved_low,
            "saved_high": change.saving.saved_high,
        }
        for change in found.changes
    ]
    return {"towards": found.towards, "changes": changes, "notes": list(found.notes)}
