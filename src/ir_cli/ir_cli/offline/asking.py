"""What the commands without ROS share: a planner with a cell, goals, options, and errors as
sentences.

Exit codes: 0 it was found, 1 it was looked for and not found, 2 the input makes no sense.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ir_description import DescriptionError, UnknownNameError, load_cell
from ir_krl import KrlError
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.options import OBJECTIVES, PlanOptions
from ir_planner import Goal, Planner, PlannerSettings, RequestError, parse_goal

from ..errors import CommandError, InputError
from ..suggestions import nearest, unknown_name

FAILED = 1
CEILING = 600.0  # s: what is asked at a terminal ends with its work, or with Ctrl-C


@contextmanager
def sentences() -> Iterator[None]:
    """Refusals of the description and the planner inside the block become an InputError."""
    try:
        yield
    except (DescriptionError, InvalidValueError, KrlError, RequestError) as error:
        raise InputError(str(error)) from error


def planner_of(cell: str, power_parameters: str = "") -> Planner:
    """A planner with a cell: the name of a bundled one, or a file; power_parameters: a file, or
    "".
    """
    planner = Planner(time.monotonic, PlannerSettings(power_parameters=power_parameters))
    try:
        load_cell(cell)
    except UnknownNameError as error:
        beside = [
            name for name in (f"{cell[:80]}.yaml", f"{cell[:80]}.yml") if Path(name).is_file()
        ]
        known = beside or error.known
        raise InputError(unknown_name("cell", cell[:80], known, "ir cell list")) from error
    planner.set_cell("", cell)
    return planner


def goal_of(text: str, planner: Planner) -> Goal:
    """What a person types as a goal; a mistyped station is answered with the one that was meant."""
    try:
        return parse_goal(text, planner.cell)
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
            listing = f"ir cell check {planner.cell.name}"
            raise InputError(unknown_name("station", name[:80], known, listing))


def _places(planner: Planner) -> list[str]:
    return [*(station.name for station in planner.cell.stations), "home", "park"]


def configuration_of(text: str, planner: Planner, margin: float, load: str = "") -> FloatArray:
    """Joint values (n,) rad of a posture or of values in degrees; at a station or a pose, the free
    configuration that is nearest to home.
    """
    goal = goal_of(text, planner)
    if goal.configuration is not None:
        return goal.configuration
    answer = planner.compute_ik(goal, "analytic", margin, planner.cell.machine_home, load)
    if not answer.solutions:
        raise CommandError(answer.status.message)
    return answer.solutions[0].q


def add_cell(parser: argparse.ArgumentParser) -> None:
    """The first argument of every command here."""
    parser.add_argument(
        "cell", metavar="CELL", help="a cell file, or the name of a bundled cell: demo"
    )


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


def add_options(parser: argparse.ArgumentParser) -> None:
    """What a planning request may choose."""
    add_margin(parser)
    parser.add_argument("--objective", choices=OBJECTIVES, default="time_and_energy")
    parser.add_argument(
        "--time-value", type=float, default=500.0, metavar="W", help="worth of a second (500)"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--planning-time", type=float, default=CEILING, metavar="S", help="ceiling in s"
    )


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
    )


def failed(sentence: str) -> int:
    """Say why nothing was found; the exit code."""
    sys.stderr.write(f"ir: {sentence}\n")
    return FAILED
