"""`ir plan`: a cell's program as a table of seconds, joules and clearance."""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

from ir_cli.errors import InputError
from ir_cli.output import (
    Columns,
    ProgressLine,
    Row,
    add_formats,
    add_renamed,
    kilowatt_hours,
    number,
    print_csv,
    print_json,
    print_table,
    text,
)
from ir_cli.planning import (
    add_blend,
    add_cell,
    add_options,
    add_parameters,
    add_start,
    clock,
    failed,
    options_of,
    planned_program,
    planner_of,
    predicted,
    sentences,
    supply,
)
from ir_cli.robots_plan import robots_of, run_robots
from ir_cli.steady import OUTPUTS, add_steady, run_steady
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlannedMovement
from ir_planner import Planner, PlannerSettings, ProgramPlan
from ir_planner.before_after import assumed_doors
from ir_values.files import ANYWHERE

J_PER_KWH = 3.6e6
HOW_TO_SAVE = (
    "--saving holds it against a common program in equal time, which takes some seconds more"
)
COLUMNS: Columns = {
    "step": ("step", text),
    "kind": ("kind", text),
    "from": ("from", text),
    "to": ("to", text),
    "seconds": ("s", number(2)),
    "joules": ("J", number(0)),
    "joules_low": ("from", number(0)),
    "joules_high": ("to", number(0)),
    "clearance": ("clearance mm", number(1, 1e3)),
    "load": ("load", text),
    "power_mode": ("mode", text),
}


def add_plan(plan: argparse.ArgumentParser) -> None:
    """Arguments of `ir plan`."""
    add_cell(plan, optional=True)
    words = "a first movement of a robot on an empty floor, instead of a cell: a robot file"
    plan.add_argument("--robot", default="", metavar="ROBOT", help=words)
    plan.add_argument(
        "--stations", nargs="+", default=[], metavar="NAME", help="visit these instead"
    )
    plan.add_argument(
        "--cycle-time", type=float, default=0.0, metavar="S", help="for the cycle; 0: free (0)"
    )
    add_blend(plan)
    words = "of several robots: all together never need more; 0: no limit (0)"
    plan.add_argument("--peak-power", type=float, default=0.0, metavar="KW", help=words)
    add_start(plan)
    words = "hold it against a common program in equal time as well, as every -o .mcap and .html is"
    plan.add_argument("--saving", action="store_true", help=words)
    words = (
        "also write the plan, repeatable: .mcap a recording for ir report and ir ros replan, .html "
        "its report, also where it failed (needs ROS's Python packages)"
    )
    output = plan.add_argument(
        "-o", "--output", type=_output, action="append", default=[], metavar="FILE", help=words
    )
    add_renamed(plan, "--record", output)
    add_renamed(plan, "--html", output)
    add_steady(plan)
    add_options(plan)
    add_parameters(plan)
    add_formats(plan)
    plan.set_defaults(run=run_plan)


def _output(text: str) -> Path:
    """A file whose ending says what is written."""
    path = Path(text)
    if path.suffix not in OUTPUTS:
        raise argparse.ArgumentTypeError(f"{text[:60]!r} must end in one of {', '.join(OUTPUTS)}")
    return path


def run_plan(arguments: argparse.Namespace) -> int:
    """Plan and print; exit code 1 where nothing is found."""
    several = robots_of(arguments.cell or "")
    if several is not None:
        return run_robots(arguments, several)
    if arguments.peak_power:
        raise InputError("--peak-power needs a CELL with several robots, such as two_robots")
    # a year counts as many cycles as the common program makes
    arguments.saving |= any(each.suffix in (".html", ".mcap") for each in arguments.output)
    if arguments.parts_per_hour is not None:
        return run_steady(arguments, lambda *what: _report(arguments, *what))
    _check_steady_options(arguments)
    with sentences(), ProgressLine() as line:
        planner = _planner(arguments)
        options = options_of(arguments)
        plan = planned_program(arguments, planner, options, line.show, savings=arguments.saving)
    for page in (each for each in arguments.output if each.suffix == ".html"):
        _page(page, arguments, plan, planner, options)
    notes = (*assumed_doors(planner.cell), *_near_by_construction(planner))
    said = "".join(f"\nnote: {note}" for note in notes)
    if not plan.status.ok:
        return failed(plan.status.message + said)
    for file in (each for each in arguments.output if each.suffix == ".mcap"):
        sys.stderr.write(f"ir: {_record(str(file), arguments, plan, planner, options)}\n")
    rows = rows_of(plan.movements)
    if arguments.json:
        saving = asdict(plan.savings) if plan.savings.available else None
        print_json({**totals_of(plan), "steps": rows, "saving": saving, "notes": notes})
    elif arguments.csv:
        print_csv(rows)
    else:
        print_table(rows, COLUMNS)
        sys.stdout.write("\n".join(sentences_of(plan, planner)) + f"{said}\n")
    return 0


def _report(
    arguments: argparse.Namespace, output: Path, plan: ProgramPlan, planner: Planner
) -> None:
    """Write the recording or the page of a steady cycle."""
    options = options_of(arguments)
    if output.suffix == ".html":
        _page(output, arguments, plan, planner, options)
    else:
        sys.stderr.write(f"ir: {_record(str(output), arguments, plan, planner, options)}\n")


def _check_steady_options(arguments: argparse.Namespace) -> None:
    """Raise InputError for what belongs to a steady cycle alone."""
    files = [str(each) for each in arguments.output if each.suffix not in (".mcap", ".html")]
    for given in (["--front"] if arguments.front else []) + files:
        raise InputError(f"{given} belongs to a steady cycle: give --parts-per-hour as well")


def _planner(arguments: argparse.Namespace) -> Planner:
    """A planner of the cell, or of a first cell of the robot."""
    if bool(arguments.cell) == bool(arguments.robot):
        raise InputError("give a CELL, or --robot ROBOT for a first movement without one")
    if arguments.cell:
        return planner_of(arguments.cell, arguments.power_parameters)
    from ir_cli.first_cell import first_cell

    settings = PlannerSettings(power_parameters=arguments.power_parameters)
    planner = Planner(clock=clock, settings=settings)
    planner.set_cell(first_cell(arguments.robot))
    return planner


def _near_by_construction(planner: Planner) -> tuple[str, ...]:
    """That pairs of the robot keep less than the safety distance, where some do."""
    reduced = planner.cell.robot.reduced_distances
    if not reduced:
        return ()
    least = 1e3 * min(each.distance for each in reduced)
    return (
        f"{len(reduced)} pairs of the robot that are near by construction keep distances of their "
        f"own, {least:.0f} mm at least (below 0: capsules overlap): ir robot check lists them",
    )


def _record(
    file: str,
    arguments: argparse.Namespace,
    plan: ProgramPlan,
    planner: Planner,
    options: PlanOptions,
) -> Path:
    """Write the recording; only here ROS is imported."""
    from ir_cli.ros.plan_recording import RecordedRequest, write_plan

    stations = tuple(arguments.stations)
    request = RecordedRequest(stations, arguments.cycle_time, options, arguments.saving)
    return write_plan(file, plan, request, planner, ANYWHERE)


def _page(
    page: Path,
    arguments: argparse.Namespace,
    plan: ProgramPlan,
    planner: Planner,
    options: PlanOptions,
) -> None:
    """Write the report of the plan; of one that failed with the sentence that says why."""
    from ir_recorder.analysis import analyse, findings
    from ir_recorder.reading import read_recording
    from ir_recorder.report import write_report

    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder) / "plan.mcap")
        recording = _record(file, arguments, plan, planner, options)
        analysis = analyse(read_recording(recording))
    # the file has no trajectories by step
    moved = replace(analysis.recording, planned=tuple(plan.movements))
    problems = analysis.problems if plan.status.ok else (plan.status.message,)
    analysis = replace(analysis, recording=moved, problems=problems)
    sys.stderr.write(f"ir: {write_report(analysis, findings(analysis), page)}\n")


def rows_of(movements: Sequence[PlannedMovement]) -> list[Row]:
    """One row per step, SI units."""
    return [
        {
            "step": k,
            "kind": str(step.kind),
            "from": step.from_station,
            "to": step.to_station,
            "seconds": step.duration,
            "joules": step.report.energy,
            "joules_low": step.report.energy_low,
            "joules_high": step.report.energy_high,
            "clearance": None if step.is_pause else step.report.min_clearance,
            "certified": None if step.is_pause else step.report.certified,
            "load": step.load,
            "power_mode": (step.power_mode or "STAND_ON_MOTORS") if step.is_pause else "",
        }
        for k, step in enumerate(movements, start=1)
    ]


def totals_of(plan: ProgramPlan) -> Row:
    """Figures of the whole program."""
    pauses = [step for step in plan.movements if step.is_pause]
    standing = sum(step.duration for step in pauses), sum(step.report.energy for step in pauses)
    return {
        "program_id": plan.program_id,
        "seconds": plan.report.duration,
        "joules": plan.report.energy,
        "joules_low": plan.report.energy_low,
        "joules_high": plan.report.energy_high,
        "power_parameters": plan.report.power_parameters,
        "torque_reserve": plan.report.torque_reserve,
        "moving_seconds": plan.report.duration - standing[0],
        "moving_joules": plan.report.energy - standing[1],
        "clearance": plan.report.min_clearance,
        "certified": plan.report.certified,
        "planning_seconds": plan.info.planning_time,
        "truncated": plan.info.truncated,
    }


def sentences_of(plan: ProgramPlan, planner: Planner) -> list[str]:
    """The totals for people, and what is saved."""
    totals = totals_of(plan)
    standing = totals["seconds"] - totals["moving_seconds"]
    waiting = totals["joules"] - totals["moving_joules"]
    paid = kilowatt_hours(totals["joules"] / J_PER_KWH)
    joules = totals["joules"]
    shown = f"{joules:.0f} J" if plan.report.energy_high < 1e5 else f"{joules / 1e3:.1f} kJ"
    energy = f"{shown} ({paid})"
    proof = "free of collision and within all limits at every instant, proved"
    if all(step.is_pause for step in plan.movements):
        proof = "nothing moves"
    lines = [
        f"movements {totals['moving_seconds']:.2f} s {totals['moving_joules'] / 1e3:.2f} kJ, "
        f"pauses {standing:.2f} s {waiting / 1e3:.2f} kJ",
        f"cycle {totals['seconds']:.2f} s, {energy} {supply(planner)}, predicted: "
        f"{predicted(plan.report)}; {proof if totals['certified'] else 'NOT certified'}",
    ]
    if plan.status.message:
        lines.append(plan.status.message)
    if totals["truncated"]:
        lines.append("cut by --planning-time: more time may give a better program")
    lines.append(f"saving: {plan.savings.sentence if plan.savings.available else HOW_TO_SAVE}")
    return lines
