"""Robots of other people: every URDF and xacro file below a folder to a certified first movement.

    python tools/robots_of_folder.py FOLDER [--packages FOLDER] [--list FILE] [--judge]

Prints a line for each file: the movement's seconds and joules, or the sentence that says why there
is none and what would help. --list: lines "file payload mass argument:=value ..": these files of
the folder alone, with the figures [kg] of their data sheets, and arguments of a xacro file. Without
it payloads are guessed. --judge: Pinocchio and Coal say too where links and meshes are
(tools/judge_robots.py). Files that hold macros only, and robots that have not six axes, are not
counted. Exit code 1 below 90 % certified of the others, or where any is wrong.
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

from judge_robots import Judge, where_it_is

from ir_cli.errors import CommandError, InputError
from ir_cli.first_cell import first_cell
from ir_cli.robot_from_urdf import RobotSource, write_robot
from ir_planner import Planner

WANTED = 0.9
PAYLOAD = 10.0  # kg, without a list
PARTS = ("macro", "common", "materials", "colours", "colors", "constants", "transmission", "gazebo")
"""Words in the names of xacro files that are no robots by themselves."""
NO_SIX_AXES = ("the robot has no link", r"the arm has \d+ axes", "no joint leads to link")
"""What is said of files that hold no arm of six axes."""


def robots_in(folder: Path) -> Iterator[Path]:
    """Files that describe a robot."""
    for path in sorted([*folder.rglob("*.urdf"), *folder.rglob("*.xacro")]):
        if not any(part in path.name.lower() for part in PARTS):
            yield path


def sources(folder: Path, packages: Path | None, names: Path | None) -> Iterator[RobotSource]:
    """What is tried: all robots of a folder, or those of a list."""
    if names is None:
        for path in robots_in(folder):
            yield RobotSource(path, payload=PAYLOAD, packages=packages)
        return
    for line in names.read_text(encoding="utf-8").splitlines():
        if line.strip() and not line.startswith("#"):
            name, payload, mass, *words = line.split()
            yield RobotSource(
                folder / name,
                payload=float(payload),
                mass=float(mass),
                packages=packages,
                settings=dict(word.split(":=", 1) for word in words),
            )


def outcome(source: RobotSource, folder: Path, judge: bool) -> tuple[str, str]:
    """certified, refused or wrong, and the line for it."""
    out = folder / "robot.yaml"
    begin = time.process_time()
    try:
        made = write_robot(source, out)
        planner = Planner(clock=time.monotonic)
        planner.set_cell(first_cell(str(out)))
        plan = planner.plan_program()
    except (CommandError, InputError) as error:
        return "refused", str(error)
    if not plan.status.ok:
        return "refused", plan.status.message
    seconds = time.process_time() - begin
    report = plan.report
    reduced = planner.cell.robot.reduced_distances
    overlapping = sum(each.distance < 0.0 for each in reduced)
    good = True
    judged = "not judged"
    if judge:
        good, judged = where_it_is(Judge(source, made), made)
    return "certified" if report.certified and good else "wrong", (
        f"{'certified' if report.certified else 'NOT CERTIFIED'} {report.duration:.2f} s, "
        f"{report.energy:.0f} J ({report.energy_low:.0f} to {report.energy_high:.0f}), "
        f"{len(planner.cell.robot.capsules)} capsules, {len(reduced)} pairs near by construction "
        f"({overlapping} overlap), {seconds:.1f} s of processor time; {judged}"
    )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--packages", type=Path)
    parser.add_argument("--list", type=Path, help="lines: file payload mass argument:=value ..")
    parser.add_argument("--judge", action="store_true")
    given = parser.parse_args()
    counts: Counter[str] = Counter()
    for source in sources(given.folder, given.packages, given.list):
        quiet = contextlib.redirect_stdout(io.StringIO())
        with tempfile.TemporaryDirectory() as folder, quiet:
            kind, line = outcome(source, Path(folder), given.judge)
        if any(re.search(words, line) for words in NO_SIX_AXES):
            kind = "of other axes"
        counts[kind] += 1
        print(f"{source.urdf.name}: {kind}: {line}", flush=True)
    arms = counts["certified"] + counts["refused"] + counts["wrong"]
    print(
        f"{counts['certified']} of {arms} certified, {counts['refused']} refused, "
        f"{counts['wrong']} wrong; {counts['of other axes']} files hold no arm of six axes"
    )
    return 0 if counts["certified"] >= max(WANTED * arms, 1.0) and not counts["wrong"] else 1


if __name__ == "__main__":
    sys.exit(main())
