"""Robots of other people: every URDF and xacro file below a folder to a certified first movement.

    python tools/robots_of_folder.py FOLDER [--packages FOLDER] [--list FILE]

Prints a line for each file: the movement's seconds and joules, or the sentence that says why there
is none and what would help. A payload and a mass that are not in --list (lines "name payload mass",
name as in the file's) are guessed from the size of the arm. Files that hold macros only, and robots
that have not six axes, are not counted. Exit code 1 below 90 % certified of the others.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import re
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from ir_cli.errors import CommandError, InputError
from ir_cli.first_cell import first_cell
from ir_cli.robot_from_urdf import RobotSource, write_robot
from ir_planner import Planner

WANTED = 0.9
PAYLOAD = 10.0  # kg, of robots that --list does not name
PARTS = ("macro", "common", "materials", "colours", "colors", "constants", "transmission", "gazebo")
"""Words in the names of xacro files that are no robots by themselves."""
NO_SIX_AXES = ("the robot has no link", r"the arm has \d+ axes", "no joint leads to link")
"""What is said of files that hold no arm of six axes."""


def robots_in(folder: Path) -> Iterator[Path]:
    """Files that describe a robot."""
    for path in sorted([*folder.rglob("*.urdf"), *folder.rglob("*.xacro")]):
        if not any(part in path.name.lower() for part in PARTS):
            yield path


def outcome(source: RobotSource, folder: Path) -> tuple[bool, str]:
    """Whether a movement of the robot is certified, and the line for it."""
    out = folder / "robot.yaml"
    begin = time.process_time()
    try:
        write_robot(source, out)
        planner = Planner(clock=time.monotonic)
        planner.set_cell(first_cell(str(out)))
        plan = planner.plan_program()
    except (CommandError, InputError) as error:
        return False, str(error)
    if not plan.status.ok:
        return False, plan.status.message
    report = plan.report
    reduced = planner.cell.robot.reduced_distances
    overlapping = sum(each.distance < 0.0 for each in reduced)
    return report.certified, (
        f"{'certified' if report.certified else 'NOT CERTIFIED'} {report.duration:.2f} s, "
        f"{report.energy:.0f} J ({report.energy_low:.0f} to {report.energy_high:.0f}), "
        f"{len(planner.cell.robot.capsules)} capsules, {len(reduced)} pairs near by construction "
        f"({overlapping} overlap), {time.process_time() - begin:.1f} s of processor time"
    )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--packages", type=Path)
    parser.add_argument("--list", type=Path, help="lines: name payload mass")
    arguments = parser.parse_args()
    known = {}
    if arguments.list is not None:
        for line in arguments.list.read_text(encoding="utf-8").splitlines():
            name, payload, mass = line.split()
            known[name] = (float(payload), float(mass))
    counts: Counter[bool] = Counter()
    others = 0
    for path in robots_in(arguments.folder):
        payload, mass = known.get(path.name.partition(".")[0], (PAYLOAD, None))
        source = RobotSource(path, payload=payload, mass=mass, packages=arguments.packages)
        quiet = contextlib.redirect_stdout(io.StringIO())
        with tempfile.TemporaryDirectory() as folder, quiet:
            good, line = outcome(source, Path(folder))
        print(f"{path.name}: {line}", flush=True)
        if any(re.search(words, line) for words in NO_SIX_AXES):
            others += 1
        else:
            counts[good] += 1
    total = counts.total()
    print(f"{counts[True]} of {total} certified; {others} files hold no arm of six axes")
    return 0 if total and counts[True] >= WANTED * total else 1


if __name__ == "__main__":
    sys.exit(main())
