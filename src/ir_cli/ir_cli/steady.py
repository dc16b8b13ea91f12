"""`ir plan CELL --parts-per-hour R`: the cheapest steady cycle of a flexible cell."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import asdict, replace
from io import BytesIO
from pathlib import Path

import numpy as np

from ir_cli.errors import CommandError, InputError
from ir_cli.output import Columns, Row, number, print_csv, print_json, print_table, text
from ir_cli.planning import failed, options_of, planner_of, predicted, sentences
from ir_description import Cell, cell_to_yaml
from ir_planner import Planner, ProgramPlan, SteadyPlan
from ir_planner.flexible import (
    SHARES,
    counted_times,
    outage_replay,
    with_counted_times,
)
from ir_recorder.report.files import write_output
from ir_studies.cells import tended_instance, written
from ir_studies.errors import StudyError
from ir_values.errors import unknown_name
from ir_values.files import ANYWHERE

HOUR = 3600.0
PICTURES = (".yaml", ".png", ".xml")
OUTPUTS = (*PICTURES, ".mcap", ".html")
_FRONT = 8  # cycles of a front
_PICTURE = b"\x89PNG"
_CELL = b"format: "
_XML = b"<?xml "
COLUMNS: Columns = {
    "begin": ("begin s", number(2)),
    "seconds": ("s", number(2)),
    "joules": ("J", number(0)),
    "what": ("robot", text),
    "mode": ("mode", text),
    "wait_for": ("waits for", text),
    "set_signals": ("sets", text),
    "load": ("load", text),
}
FRONT_COLUMNS: Columns = {
    "parts_per_hour": ("parts/h", number(2)),
    "period": ("s", number(2)),
    "joules": ("J a part", number(0)),
    "gap": ("gap %", number(2)),
}


def add_steady(plan: argparse.ArgumentParser) -> None:
    """Arguments of `ir plan` for a cell with a route."""
    words = (
        "the cheapest steady cycle of the cell's route that makes at least so many parts an hour; "
        "0: as many as possible; -o FILE.yaml is its program as a cell, FILE.png the chart, "
        "FILE.xml an instance of the public benchmark"
    )
    plan.add_argument("--parts-per-hour", type=float, default=None, metavar="R", help=words)
    plan.add_argument(
        "--front",
        action="store_true",
        help="with --parts-per-hour: also cycles from the fastest to the cheapest",
    )
    words = "with --parts-per-hour: parts a cycle at most, 1 or 2 (1)"
    plan.add_argument("--units", type=int, default=1, metavar="K", help=words)
    words = (
        "with --parts-per-hour: the program fills the line from empty and makes so many whole "
        "cycles (0: it is one cycle)"
    )
    plan.add_argument("--cycles", type=int, default=0, metavar="N", help=words)
    words = (
        "with --cycles: what it costs when a machine is down so many seconds once, by how the "
        "robot waits meanwhile (on the schedule, not driven)"
    )
    plan.add_argument("--outage", default="", metavar="MACHINE=S", help=words)
    words = (
        "with --cycles: with which process times a plan should count where they vary, for least "
        "energy (on the schedule, not driven)"
    )
    plan.add_argument("--vary", action="store_true", help=words)


Report = Callable[[Path, ProgramPlan, Planner], None]
"""Writes the recording (.mcap) or the page (.html) of a program in the cell of a planner."""


def run_steady(arguments: argparse.Namespace, report: Report) -> int:
    """Plan and print; exit code 1 where nothing is found."""
    _check(arguments)
    with sentences():
        planner = planner_of(arguments.cell, arguments.power_parameters)
        given = planner.cell
        _check_surprises(arguments, given)
        plan = planner.plan_steady_cycle(
            parts_per_hour=arguments.parts_per_hour,
            options=options_of(arguments),
            saving=arguments.saving,
            front_points=_FRONT if arguments.front else 0,
            units=arguments.units,
            cycles=arguments.cycles,
        )
    if plan.cycle is None:
        return failed(plan.status.message)
    _write(plan, planner, arguments, report)
    rows = _rows(plan)
    front = [asdict(point) for point in plan.front]
    if arguments.json:
        saving = None if plan.saving is None else asdict(plan.saving)
        print_json({**_totals(plan), "steps": rows, "front": front, "saving": saving})
    elif arguments.csv:
        print_csv(front or rows)
    else:
        print_table(rows, COLUMNS)
        if front:
            print_table(front, FRONT_COLUMNS)
        said = _sentences(plan)
        with sentences():
            said += [_outage(plan, arguments.outage)] if arguments.outage else []
        sys.stdout.write("\n".join(said) + "\n")
        if arguments.vary:
            with sentences():
                print_table(_varied(arguments, planner, given), _COUNTED)
    return 0


def _write(
    plan: SteadyPlan, planner: Planner, arguments: argparse.Namespace, report: Report
) -> None:
    """Write all outputs."""
    for output in arguments.output:
        if output.suffix in PICTURES:
            sys.stderr.write(f"ir: {_write_result(plan, output, front=arguments.front)}\n")
    program = plan.run or plan.program
    cell = plan.run_cell or plan.cell
    if program is None or cell is None:
        return
    planner.set_cell(cell)
    for output in arguments.output:
        if output.suffix not in PICTURES:
            report(output, program, planner)


def _check(arguments: argparse.Namespace) -> None:
    """Raise InputError for what doesn't belong to a steady cycle."""
    if (arguments.outage or arguments.vary) and not arguments.cycles:
        raise InputError("--outage and --vary follow a run: give --cycles as well")
    if (arguments.outage or arguments.vary) and (arguments.json or arguments.csv):
        raise InputError("--outage and --vary are printed as text: leave out --json or --csv")
    if not arguments.cell:
        raise InputError("--parts-per-hour needs a CELL with a route, such as flexible")
    for given, name in (
        (arguments.stations, "--stations"),
        (arguments.cycle_time, "--cycle-time"),
        (arguments.start, "--start"),
    ):
        if given:
            raise InputError(f"{name} doesn't belong to --parts-per-hour: the route says it")


def _write_result(plan: SteadyPlan, path: Path, *, front: bool) -> Path:
    """Write the cell with the program of the cycle, or the chart (front: of the front)."""
    try:
        if path.suffix == ".yaml":
            cell = plan.run_cell or plan.cell
            assert cell is not None
            return write_output(path, cell_to_yaml(cell).encode(), _CELL, ANYWHERE)
        if path.suffix == ".xml":
            return write_output(path, written([tended_instance(plan)]).encode(), _XML, ANYWHERE)
        picture = BytesIO()
        figure = plan.plot_front() if front else plan.plot()
        figure.savefig(picture, format="png")
        return write_output(path, picture.getvalue(), _PICTURE, ANYWHERE)
    except (ImportError, StudyError) as error:
        raise CommandError(str(error)) from error


def _rows(plan: SteadyPlan) -> list[Row]:
    """One row per step of the cycle, SI units."""
    assert plan.program is not None
    rows: list[Row] = []
    begin = 0.0
    for step in plan.program.movements:
        to = "" if step.is_pause else f" {step.to_station}"
        rows.append(
            {
                "begin": begin,
                "seconds": step.duration,
                "joules": step.report.energy,
                "what": f"{step.kind}{to}",
                "mode": (step.power_mode or "STAND_ON_MOTORS") if step.is_pause else "",
                "wait_for": " ".join(step.wait_for),
                "set_signals": " ".join(step.set_signals),
                "load": step.load,
            }
        )
        begin += step.duration
    return rows


def _totals(plan: SteadyPlan) -> Row:
    """Figures of the cycle."""
    assert plan.cycle is not None
    assert plan.program is not None
    report = plan.program.report
    units = plan.cycle.units
    return {
        "program_id": plan.program.program_id,
        "parts_per_hour": HOUR / plan.cycle.seconds_per_part,
        "period": plan.cycle.period,
        "units": plan.cycle.units,
        "fastest_period": plan.fastest,
        "order": [plan.machines[visit.activity] for visit in plan.cycle.visits],
        "joules": plan.joules,
        "joules_low": report.energy_low / units,
        "joules_high": report.energy_high / units,
        "gap": plan.gap,
        "certified": report.certified,
        "planning_seconds": plan.info.planning_time,
        "truncated": plan.info.truncated,
    }


def _sentences(plan: SteadyPlan) -> list[str]:
    """The totals for people."""
    totals = _totals(plan)
    lines = [
        f"order: a part from {', '.join(totals['order'])}, each to the next station of the route",
        f"{totals['parts_per_hour']:.2f} parts an hour, a cycle of {totals['period']:.2f} s for "
        f"{_parts_text(totals['units'])} (the shortest: {totals['fastest_period']:.2f} s a part)",
        f"{totals['joules'] / 1e3:.2f} kJ a part from the mains, {_proved(plan, totals)}",
        f"at most {totals['gap']:.2f} % above the cheapest cycle of these configurations, without "
        "what the capacitor carries from one movement to the next",
    ]
    if plan.run is not None:
        run = plan.run.report
        lines.append(
            f"run from an empty line: {len(plan.run.movements)} steps, {run.duration:.1f} s, "
            f"{run.energy / 1e3:.1f} kJ"
        )
    if totals["truncated"]:
        lines.append("cut by --planning-time: more time may give a better cycle")
    if plan.saving is not None:
        lines.append(f"saving: {plan.saving.sentence}")
    return lines


def _parts_text(count: int) -> str:
    return "a part" if count == 1 else f"{count} parts"


def _proved(plan: SteadyPlan, totals: Row) -> str:
    """How sure the joules are, and what is proved of the movements."""
    assert plan.program is not None
    report = replace(
        plan.program.report,
        energy=totals["joules"],
        energy_low=totals["joules_low"],
        energy_high=totals["joules_high"],
    )
    proof = "free of collision and within all limits at every instant, proved"
    return f"predicted: {predicted(report)}; {proof if totals['certified'] else 'NOT certified'}"


# Surprises, on the schedule alone.

_OUTAGES = np.geomspace(10.0, 3600.0, 200)  # s: as long as one may be, when nobody knows
_LONGEST_OUTAGE = 86_400.0  # s
_WAITED = (
    ("by itself", "as the controller waits by itself"),
    ("timeouts", "by the policy for waits of 10 s to an hour"),
    ("known", "for who knows how long"),
)
_COUNTED: Columns = {
    "share": ("done within", text),
    "joules": ("J a part", number(0)),
    "seconds": ("s a part", number(2)),
    "known": ("J, who knows", number(0)),
}


def _check_surprises(arguments: argparse.Namespace, cell: Cell) -> None:
    """Raise InputError for surprises that the cell can't have."""
    if arguments.outage:
        machine, _ = _outage_asked(arguments.outage)
        working = [each.name for each in cell.equipment if each.process > 0.0]
        if machine not in working:
            raise InputError(unknown_name("machine with a process", machine, working))
    if arguments.vary and all(machine.process_times is None for machine in cell.equipment):
        raise InputError("--vary needs a machine whose process has between or samples")


def _outage_asked(asked: str) -> tuple[str, float]:
    """The machine that is down, and for how long [s]."""
    machine, _, value = asked.partition("=")
    try:
        seconds = float(value)
    except ValueError:
        seconds = -1.0
    if not 0.0 < seconds <= _LONGEST_OUTAGE:
        raise InputError(
            f"--outage is {asked[:60]!r}: it must be MACHINE=S with S in (0, {_LONGEST_OUTAGE:g}]"
        )
    return machine, seconds


def _outage(plan: SteadyPlan, asked: str) -> str:
    """What an outage costs by each policy."""
    machine, seconds = _outage_asked(asked)
    middle = len(plan.process)
    replay = outage_replay(plan, machine, seconds, middle, _OUTAGES)
    said = ", ".join(f"{replay.joules(name) / 1e3:.1f} kJ {words}" for name, words in _WAITED)
    return (
        f"{machine} down for {seconds:g} s once: {said}; in step again {replay.back} parts after "
        "(on the schedule, not driven)"
    )


def _varied(arguments: argparse.Namespace, planner: Planner, cell: Cell) -> list[Row]:
    """Plans that count with different times."""
    rows: list[Row] = []
    for share in (0.0, *SHARES):
        planner.set_cell(with_counted_times(cell, share))
        plan = planner.plan_steady_cycle(
            parts_per_hour=arguments.parts_per_hour,
            options=options_of(arguments),
            units=arguments.units,
            cycles=arguments.cycles,
        )
        if plan.run is None:
            continue
        counted = counted_times(plan, share, arguments.seed)
        said = f"{100.0 * share:g} %" if share else "mean"
        rows.append({**asdict(counted), "share": said})
    return rows
