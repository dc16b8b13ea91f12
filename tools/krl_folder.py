"""How many KRL programs of a folder are followed to the end?

    python tools/krl_folder.py FOLDER... [--cell NAME] [--drive] [--quiet]

Every folder, or every archive, is one robot's project. A program is a .src whose first routine
takes no arguments and whose routines move the robot; it is followed with the modules of its
project.
Prints a line for each: followed, followed with assumptions (how many, the worst one), or refused
with file, line and remedy; then the counts. --drive: each is driven in the cell too.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from pathlib import Path

from ir_krl import KrlError, read_project
from ir_krl.project import File, Project
from ir_krl.run import Effect
from ir_planner import Planner
from ir_planner.krl import evaluate_krl, follow_krl

FOLLOWED = "followed"
ASSUMED = "followed with assumptions"
REFUSED = "refused"
NOT_DRIVEN = "followed, not driven here"


def main(arguments: list[str] | None = None) -> int:
    """Print a line for each program and the counts; 0 where every folder could be read."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--cell", default="open", help="whose home and tool stand in (open)")
    parser.add_argument("--drive", action="store_true", help="drive them in the cell too")
    parser.add_argument("--quiet", action="store_true", help="print the counts alone")
    chosen = parser.parse_args(arguments)
    planner = Planner(chosen.cell)
    counts: Counter[str] = Counter()
    failed = False
    for folder in chosen.folders:
        try:
            project = read_project(folder)
        except (KrlError, OSError) as error:
            sys.stderr.write(f"{folder}: {error}\n")
            failed = True
            continue
        for file in project.programs():
            verdict, said = judged(project, file, planner, drive=chosen.drive)
            counts[verdict] += 1
            if not chosen.quiet:
                sys.stdout.write(f"{folder.name}/{file.path}: {verdict}{said}\n")
    total = sum(counts.values())
    listed = ", ".join(f"{counts[name]} {name}" for name in (FOLLOWED, ASSUMED, REFUSED))
    sys.stdout.write(f"{total} motion programs: {listed}")
    if counts[NOT_DRIVEN]:
        sys.stdout.write(f", {counts[NOT_DRIVEN]} {NOT_DRIVEN}")
    sys.stdout.write("\n")
    return int(failed)


def judged(project: Project, file: File, planner: Planner, *, drive: bool) -> tuple[str, str]:
    """What becomes of the program in a file, and a few words about it."""
    try:
        program = follow_krl(planner, project.sources(file)[0])
    except KrlError as error:
        return REFUSED, f": {error}"
    if drive:
        try:
            evaluate_krl(planner, program)
        except KrlError as error:
            return NOT_DRIVEN, f": {error}"
    assumed = [note for note in program.notes if note.effect > Effect.NONE]
    if not assumed:
        return FOLLOWED, f": {len(program.commands)} commands"
    return ASSUMED, f" ({len(assumed)}): {len(program.commands)} commands; {assumed[0]}"


if __name__ == "__main__":
    sys.exit(main())
