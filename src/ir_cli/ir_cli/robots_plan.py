"""`ir plan CELL` of a cell with several robots: their joint cycle."""

from __future__ import annotations

import argparse
import sys
from contextlib import suppress
from io import BytesIO
from pathlib import Path

from ir_cli.errors import CommandError, InputError
from ir_cli.output import Columns, Row, number, print_csv, print_json, print_table, text
from ir_cli.planning import failed, options_of, sentences
from ir_description import RobotCells, load_robot_cells
from ir_description.library import robot_in
from ir_planner import PlannerSettings
from ir_planner.robots import RobotsPlan, plan_robots
from ir_recorder.report.files import write_output
from ir_values.errors import DescriptionError
from ir_values.files import ANYWHERE

COLUMNS: Columns = {
    "robot": ("robot", text),
    "begin": ("begin s", number(2)),
    "seconds": ("s", number(2)),
    "joules": ("J", number(0)),
    "what": ("what", text),
    "mode": ("mode", text),
    "wait_for": ("waits for", text),
    "set_signals": ("sets", text),
    "load": ("load", text),
}
ZONES: Columns = {
    "signal": ("zone", text),
    "robot": ("robot", text),
    "order": ("order", text),
    "enter": ("enters s", number(2)),
    "leave": ("leaves s", number(2)),
    "from": ("from", text),
    "to": ("to", text),
}
_PICTURE = b"\x89PNG"


def robots_of(cell: str) -> RobotCells | None:
    """The cells of all robots of a cell that is named without one of them; None: it has one, or
    can't be read, which others say.
    """
    if not cell or robot_in(cell)[1]:
        return None
    with suppress(DescriptionError):
        return load_robot_cells(cell)
    return None


def run_robots(arguments: argparse.Namespace, cells: RobotCells) -> int:
    """Plan and print; exit code 1 where nothing is found."""
    _check(arguments)
    settings = PlannerSettings(power_parameters=arguments.power_parameters)
    with sentences():
        plan = plan_robots(
            cells,
            cycle_time=arguments.cycle_time,
            peak_power=1e3 * arguments.peak_power,
            options=options_of(arguments),
            settings=settings,
        )
    if not plan.programs:
        return failed(plan.status.message)
    for output in arguments.output:
        sys.stderr.write(f"ir: {_picture(plan, output)}\n")
    rows = _rows(plan)
    zones = _zones(plan)
    if arguments.json:
        print_json({**_totals(plan), "steps": rows, "zones": zones})
    elif arguments.csv:
        print_csv(rows)
    else:
        print_table(rows, COLUMNS)
        if zones:
            print_table(zones, ZONES)
        sys.stdout.write("\n".join(_sentences(plan)) + "\n")
    return 0


def _check(arguments: argparse.Namespace) -> None:
    """Raise InputError for what belongs to one robot."""
    for given, name in (
        (arguments.stations, "--stations"),
        (arguments.start, "--start"),
        (arguments.parts_per_hour is not None, "--parts-per-hour"),
        (arguments.front, "--front"),
        *((each.suffix != ".png", str(each)) for each in arguments.output),
    ):
        if given:
            raise InputError(
                f"{name} belongs to one robot, the cell has several: name one, as "
                f"{arguments.cell}@NAME"
            )


def _picture(plan: RobotsPlan, path: Path) -> Path:
    picture = BytesIO()
    try:
        plan.plot().savefig(picture, format="png")
    except ImportError as error:
        raise CommandError(str(error)) from error
    return write_output(path, picture.getvalue(), _PICTURE, ANYWHERE)


def _rows(plan: RobotsPlan) -> list[Row]:
    """One row per step of each robot, SI units."""
    rows: list[Row] = []
    for robot, begin, program in zip(plan.robots, plan.begins, plan.programs, strict=True):
        for step in program.movements:
            place = f" {step.to_station}" if step.to_station else ""
            rows.append(
                {
                    "robot": robot,
                    "begin": begin,
                    "seconds": step.duration,
                    "joules": step.report.energy,
                    "what": f"{step.kind}{place}",
                    "mode": (step.power_mode or "STAND_ON_MOTORS") if step.is_pause else "",
                    "wait_for": " ".join(step.wait_for),
                    "set_signals": " ".join(step.set_signals),
                    "load": step.load,
                }
            )
            begin += step.duration
    return rows


def _zones(plan: RobotsPlan) -> list[Row]:
    """Two rows per zone: one for each robot, the one that passes it first before the other."""
    rows: list[Row] = []
    for zone in plan.zones:
        sides = sorted((0, 1), key=lambda side: zone.robots[side] != zone.first)
        for order, side in enumerate(sides, start=1):
            rows.append(
                {
                    "signal": zone.signal,
                    "robot": zone.robots[side],
                    "order": str(order),
                    "enter": zone.enter[side],
                    "leave": zone.leave[side],
                    "from": zone.movements[side][0],
                    "to": zone.movements[side][1],
                }
            )
    return rows


def _totals(plan: RobotsPlan) -> Row:
    """Figures of the joint cycle."""
    return {
        "period": plan.period,
        "fastest_period": plan.fastest,
        "joules": plan.joules,
        "robots": {
            robot: {
                "program_id": program.program_id,
                "joules": program.report.energy,
                "joules_low": program.report.energy_low,
                "joules_high": program.report.energy_high,
                "peak_power": program.report.peak_power,
            }
            for robot, program in zip(plan.robots, plan.programs, strict=True)
        },
        "full_speed": plan.full_speed,
        "gap": plan.gap,
        "peak_power": plan.peak_power,
        "proved_pairs": plan.proved,
        "certified": plan.certified,
    }


def _sentences(plan: RobotsPlan) -> list[str]:
    """The totals for people."""
    each = ", ".join(
        f"{robot} {program.report.energy / 1e3:.2f} kJ"
        for robot, program in zip(plan.robots, plan.programs, strict=True)
    )
    share = 100.0 * (plan.full_speed - plan.joules) / plan.full_speed
    return [
        f"a cycle of {plan.period:.2f} s (the shortest: {plan.fastest:.2f} s), "
        f"{plan.joules / 1e3:.2f} kJ from the mains, predicted: {each}",
        f"{share:.1f} % less than with the same zones, all movements as fast as they can and "
        f"motors on in every wait ({plan.full_speed / 1e3:.2f} kJ in the same time)",
        f"at most {plan.gap:.2f} % above the cheapest cycle of these configurations and zones, "
        "without what the capacitor carries",
        f"peak at most {plan.peak_power / 1e3:.1f} kW: the robots' own together, however they are "
        "shifted",
        f"{'every' if plan.certified else 'NOT every'} robot is free of collision with the cell, "
        f"and with the others at every timing that the {len(plan.zones)} signals admit, proved: "
        f"{plan.proved} pairs of movements and stops are free at any timing, the others take turns",
    ]
