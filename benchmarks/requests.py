"""Movements that people ask for beside the plain ones: are they solved, and how soon?

    python benchmarks/requests.py [--only KIND]... [--cases N] [--quick] [--json FILE]

Each `_requests_<kind>.py` beside this file is a kind: it generates cases in several cells and
robots, asks the planner, has every answer judged by code that shares nothing with it (Pinocchio's
kinematics, Coal's distances where these are cheap), and puts a peer beside it where there is one.
Printed is how many were solved, refused and why. The laws: every answer is certified, and no judge
objects.
"""

from __future__ import annotations

import argparse
import importlib
from dataclasses import asdict
from pathlib import Path

from _requests_rows import reasons, summary
from _results import Claim, add_ending, at_most, finish, line_of

CASES = 200
QUICK = 6
_PREFIX = "_requests_"
_SHARED = "rows"


def kinds() -> list[str]:
    """All kinds, by their names."""
    files = Path(__file__).parent.glob(f"{_PREFIX}*.py")
    return sorted({file.stem.removeprefix(_PREFIX) for file in files} - {_SHARED})


def main() -> None:
    """Run the kinds one after the other."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", action="append", choices=kinds(), help="default: all")
    parser.add_argument("--cases", type=int, help=f"of each kind; default: {CASES}")
    add_ending(parser, f"{QUICK} cases of each kind")
    arguments = parser.parse_args()
    count = arguments.cases or (QUICK if arguments.quick else CASES)
    table = []
    claims: list[Claim] = []
    found = {}
    for name in arguments.only or kinds():
        rows = list(importlib.import_module(_PREFIX + name).rows(count))
        table.append(summary(name, rows))
        found[name] = [asdict(row) for row in rows]
        print(line_of(table[-1]), flush=True)
        for sentence in reasons(rows):
            print(f"    {sentence}")
        uncertified = table[-1]["solved"] - table[-1]["certified"]
        claims.append(at_most(f"{name}: answers without a certificate", uncertified, "", 0))
        claims.append(at_most(f"{name}: objections of judges", table[-1]["objections"], "", 0))
    finish(arguments.json, table, claims, cases=found)


if __name__ == "__main__":
    main()
