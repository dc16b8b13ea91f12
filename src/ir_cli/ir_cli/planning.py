"""Planner, goals and options of the commands that plan without ROS.

Exit codes: 0 an answer was found, 1 none was found, 2 the input makes no sense.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypedDict

from ir_cli.errors import CommandError, InputError, nearest, unknown_name
from ir_cli.output import Row
from ir_description import DescriptionError, UnknownNameError, load_cell
from ir_krl import KrlError
from ir_msgs_py.options import (
    AS_THE_CELL_SAYS,
    NO_TILT,
    OBJECTIVES,
    ROBOTS_TIME_VALUE,
    PlanOptions,
)
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.savings import one_sided
from ir_msgs_py.status import StatusCode
from ir_planner import Goal, Planner, PlannerSettings, ProgramPlan, RequestError, parse_goal
from ir_planner.program import Progress
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

FAILED = 1


class TiltFields(TypedDict):
    """Fields of PlanOptions."""

    tilt_max: float
    tilt_axis: tuple[float, ...]
    tilt_direction: tuple[float, ...]


CEILING = 600.0  # s: what is asked at a terminal ends with its work, or with Ctrl-C


@contextmanager
def sentences() -> Iterator[None]:
    """Refusals of the description and the planner inside the block become an InputError."""
    try:
        yield
    except (DescriptionError, InvalidValueError, KrlError, RequestError) as error:
        raise InputError(str(error)) from error


def clock() -> float:
    """Time [s] by which planning at a terminal is limited; here alone, so that a test stops it."""
    return time.monotonic()


def planner_of(cell: str, power_parameters: str = "") -> Planner:
    """A planner with a cell: the name of a bundled one, or a file; power_parameters: a file, or
    "".
    """
    planner = Planner(clock=clock, settings=PlannerSettings(power_parameters=power_parameters))
    try:
        load_cell(cell)
    except UnknownNameError as error:
        beside = [
            name for name in (f"{cell[:80]}.yaml", f"{cell[:80]}.yml") if Path(name).is_file()
        ]
        known = beside or error.known
        raise InputError(unknown_name("cell", cell[:80], known, "ir cell list")) from error
    planner.set_cell(cell)
    return planner


def goal_of(
    text: str,
    planner: Planner,
    what: str = "goal",
    code: StatusCode = StatusCode.GOAL_STATE_INVALID,
) -> Goal:
    """What a person types as a goal, or as what `what` and `code` say (see parse_goal); a mistyped
    station is answered with the one that was meant.
    """
    try:
        return parse_goal(text, planner.cell, what, code)
    except RequestError:
        if nearest(text, _places(planner)):
            check_stations([text], planner)
        raise


def check_stations(names: Iterable[str], planner: Planner) -> None:
    """Raise InputError for a name that is no station, posture or path, with the one that was
    meant.
    """
    known = [*_places(planner), *(path.name for path in planner.cell.paths)]
    for name in names:
        if name not in known:
            listing = f"ir check {planner.cell.name}"
            raise InputError(unknown_name("station", name[:80], known, listing))


def _places(planner: Planner) -> list[str]:
    return [*(station.name for station in planner.cell.stations), "home", "park"]


def configuration_of(
    text: str, planner: Planner, margin: float, load: str = "", what: str = "start"
) -> FloatArray:
    """Joint values (n,) rad of a posture or of values in degrees; at a station or a pose, the free
    configuration that is nearest to home. what: its name where it is refused.
    """
    goal = goal_of(text, planner, what, StatusCode.START_STATE_INVALID)
    if goal.configuration is not None:
        return goal.configuration
    answer = planner.compute_ik(
        goal, method="analytic", safety_distance=margin, near=planner.cell.machine_home, load=load
    )
    if not answer.solutions:
        raise CommandError(answer.status.message)
    return answer.solutions[0].q


def add_start(parser: argparse.ArgumentParser, of: str = "") -> None:
    """Where a program begins."""
    words = f"{of}posture or joint values (where the program ends, as in production; else park)"
    parser.add_argument("--start", default="", help=words)


def add_blend(parser: argparse.ArgumentParser) -> None:
    """How near a program passes what it needn't stand still at."""
    parser.add_argument(
        "--blend",
        type=float,
        default=AS_THE_CELL_SAYS,
        metavar="M",
        help="pass stops and ends of lines within so many metres where nothing happens; -1: as the "
        "cell says (-1)",
    )


def asked_program(
    arguments: argparse.Namespace, planner: Planner
) -> tuple[tuple[str, ...], FloatArray]:
    """Stations that a command asks for, (): the cell's program, and the joint values (n,) rad where
    it begins.
    """
    stations = tuple(arguments.stations)
    check_stations(stations, planner)
    start = arguments.start or planner.cell.cycle_start(stations)
    return stations, configuration_of(start, planner, arguments.safety_distance)


def planned_program(
    arguments: argparse.Namespace,
    planner: Planner,
    options: PlanOptions,
    progress: Progress,
    *,
    savings: bool = False,
) -> ProgramPlan:
    """The program that a command asks for, as planned."""
    stations, start = asked_program(arguments, planner)
    return planner.plan_program(
        stations=stations,
        cycle_time=arguments.cycle_time,
        blend=arguments.blend,
        options=options,
        start=start,
        progress=progress,
        savings=savings,
    )


def add_cell(parser: argparse.ArgumentParser, *, optional: bool = False) -> None:
    """The first argument of every command here."""
    words = "a cell file, or the name of a bundled cell: demo"
    parser.add_argument("cell", metavar="CELL", nargs="?" if optional else None, help=words)


def add_parameters(parser: argparse.ArgumentParser) -> None:
    """What joules follow from."""
    words = "power parameters that joules follow from, as a fit writes them (the data sheet)"
    parser.add_argument("--power-parameters", default="", metavar="FILE", help=words)


def add_margin(parser: argparse.ArgumentParser) -> None:
    """The safety distance, and what the robot holds."""
    parser.add_argument(
        "--safety-distance", type=float, default=0.02, metavar="M", help="m to keep (0.02)"
    )
    parser.add_argument(
        "--load", default="", help='what is held: "gripper+part", "none" (the tool)'
    )


def add_tool_limits(parser: argparse.ArgumentParser) -> None:
    """How fast the tool may be."""
    parser.add_argument(
        "--tool-speed",
        type=float,
        default=0.0,
        metavar="M/S",
        help="most speed of the tcp in m/s (as the axes allow)",
    )
    parser.add_argument(
        "--tool-acceleration",
        type=float,
        default=0.0,
        metavar="M/S^2",
        help="most acceleration of the tcp in m/s^2 (as the axes allow)",
    )
    parser.add_argument(
        "--whole-tool",
        action="store_true",
        help="both hold for every point of the capsules of tool and part",
    )


def add_options(parser: argparse.ArgumentParser) -> None:
    """What a planning request may choose."""
    add_margin(parser)
    parser.add_argument("--objective", choices=OBJECTIVES, default="time_and_energy")
    parser.add_argument(
        "--time-value",
        type=float,
        default=ROBOTS_TIME_VALUE,
        metavar="W",
        help="worth of a second (the robot's own: ir robot check; 500 for the KR 210)",
    )
    add_tool_limits(parser)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--planning-time", type=float, default=CEILING, metavar="S", help="ceiling in s"
    )
    add_tilt(parser)


def add_tilt(parser: argparse.ArgumentParser) -> None:
    """How far the tool may lean."""
    parser.add_argument(
        "--tilt-max", type=float, metavar="DEG", help="deg that the tool may lean on the way"
    )
    for name, words in (
        ("axis", "the tool's axis that counts, in the tcp (that which points up at the start)"),
        ("direction", "what it may lean from, in the cell (up: 0 0 1)"),
    ):
        parser.add_argument(
            f"--tilt-{name}", type=float, nargs=3, metavar=("X", "Y", "Z"), default=(), help=words
        )


def tilt_of(arguments: argparse.Namespace) -> TiltFields:
    """The fields of options that say how far the tool may lean."""
    degrees = arguments.tilt_max
    return {
        "tilt_max": NO_TILT if degrees is None else math.radians(degrees),
        "tilt_axis": tuple(arguments.tilt_axis),
        "tilt_direction": tuple(arguments.tilt_direction),
    }


def options_of(arguments: argparse.Namespace, duration: float = 0.0) -> PlanOptions:
    """The options as they were typed."""
    return PlanOptions(
        seed=arguments.seed,
        planning_time=arguments.planning_time,
        safety_distance=arguments.safety_distance,
        objective=arguments.objective,
        time_value=arguments.time_value,
        duration=duration,
        load=arguments.load,
        **tilt_of(arguments),
        tool_speed=arguments.tool_speed,
        tool_acceleration=arguments.tool_acceleration,
        whole_tool=arguments.whole_tool,
    )


def failed(sentence: str) -> int:
    """Say why nothing was found; the exit code."""
    sys.stderr.write(f"ir: {sentence}\n")
    return FAILED


def figures_of(report: TrajectoryReport) -> Row:
    """What a trajectory costs and keeps, SI units."""
    closest = report.closest
    return {
        "seconds": report.duration,
        "joules": report.energy,
        "joules_low": report.energy_low,
        "joules_high": report.energy_high,
        "power_parameters": report.power_parameters,
        "torque_reserve": report.torque_reserve,
        "base_joules": report.base_energy,
        "dissipated_joules": report.burnt_energy,
        "joint_joules": report.joint_energy,
        "peak_watts": report.peak_power,
        "clearance": report.min_clearance,
        "largest_tilt": None if report.largest_tilt == NO_TILT else report.largest_tilt,
        "closest": None if closest is None else [closest.body_a, closest.body_b],
        "certified": report.certified,
        "velocity_share": report.velocity_ratio,
        "acceleration_share": report.acceleration_ratio,
        "jerk_share": report.jerk_ratio,
        "torque_share": report.torque_ratio,
        "tool_speed": report.tool_speed,
        "tool_acceleration": report.tool_acceleration,
    }


def predicted(report: TrajectoryReport) -> str:
    """The interval of an energy, and what it follows from."""
    low = report.energy_low
    high = report.energy_high
    within = (
        f"{low:.0f} to {high:.0f} J" if high < 1e5 else f"{low / 1e3:.1f} to {high / 1e3:.1f} kJ"
    )
    why = one_sided(report.energy, low, high)
    return f"90 % interval {within} by {report.power_parameters}{f', {why}' if why else ''}"


def mains_counted(planner: Planner) -> bool:
    """Whether joules hold what the controller draws, by its data or by fitted parameters."""
    parameters = planner.scene("").parameters
    return parameters.power_with(planner.cell.robot.controller).counted


def supply(planner: Planner) -> str:
    """Where joules are counted: without watts of a controller they are those of drives and tool."""
    counted = mains_counted(planner)
    return "from the mains" if counted else "at the drives, no controller counted"


def sentence_of(report: TrajectoryReport, planner: Planner) -> str:
    """The same for people."""
    near = report.closest
    pair = (
        ""
        if near is None
        else f" between {near.body_a} and {near.body_b} at {report.closest_time:.2f} s"
    )
    used = max(
        float(share.max(initial=0.0))
        for share in (
            report.velocity_ratio,
            report.acceleration_ratio,
            report.jerk_ratio,
            report.torque_ratio,
        )
    )
    tilt = f"leans at most {math.degrees(report.largest_tilt):.2f} deg; "
    leans = "" if report.largest_tilt == NO_TILT else tilt
    return (
        f"{report.duration:.3f} s, {report.energy:.0f} J {supply(planner)}, predicted "
        f"({predicted(report)}), "
        f"at most {report.peak_power / 1e3:.1f} kW\n"
        f"clearance {report.min_clearance * 1e3:.1f} mm{pair}; uses {100.0 * used:.0f} % of a "
        f"limit; {leans}"
        f"the tool at most {report.tool_speed:.3f} m/s and {report.tool_acceleration:.2f} m/s^2; "
        f"{'certified' if report.certified else 'NOT certified'}"
    )
