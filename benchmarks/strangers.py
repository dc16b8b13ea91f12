"""Are URDFs, meshes, worlds and recordings of strangers read right, or refused with a sentence?

    python benchmarks/strangers.py [--seeds N] [--quick] [--json FILE]

Each file is generated together with what it says, by code that shares nothing with the readers:
kinematics and bodies of arms, corners of meshes, positions at their times. A file that is read must
give just that, or name what it leaves out; one that is wrong beyond repair must be refused with one
line. Anything else is a silent misreading or a traceback. Of stout robots, whose links overlap by
construction, no posture may be allowed in which meshes meet elsewhere; they may be refused.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from _results import Claim, add_ending, at_least, at_most, finish, line_of
from _strangers_logs import bags, messages, misread_log, tables
from _strangers_robots import (
    meet_though_allowed,
    meshes,
    misread_mesh,
    misread_robot,
    stout_urdfs,
    urdfs,
)
from _strangers_worlds import misread_world, worlds

from ir_cli.errors import CommandError
from ir_recorder.errors import RecorderError
from ir_values.errors import IrError

FIRST_SEED = 1
Case = tuple[str, str, bool | None, Callable[[], str]]
"""Kind, name, whether it may be read (None: as it likes), reading."""


def cases(rng: np.random.Generator, folder: Path) -> Iterator[Case]:
    """All files of a seed."""
    for name, path, arm, more, readable in urdfs(rng, folder):
        yield "urdf", name, readable, lambda p=path, a=arm, m=more: misread_robot(p, a, m, rng)
    for name, path in stout_urdfs(rng, folder):
        yield "self check", name, None, lambda p=path: meet_though_allowed(p)
    for name, path, triangles, readable in meshes(rng, folder):
        yield "mesh", name, readable, lambda p=path, t=triangles: misread_mesh(p, t)
    for case in worlds(rng, folder):
        yield "world", case.name, case.readable, lambda c=case: misread_world(c)
    for name, path, q, readable in bags(rng, folder):
        yield "bag", name, readable, lambda p=path, q=q: misread_log(p, q)
    for name, path, q, readable in tables(rng, folder):
        yield "table", name, readable, lambda p=path, q=q: misread_log(p, q)
    for name, path, q, readable in messages(rng, folder):
        yield "egm", name, readable, lambda p=path, q=q: misread_log(p, q)


def row_of(
    kind: str, name: str, readable: bool | None, reading: Callable[[], str]
) -> dict[str, Any]:
    """What came of a file: read, refused, misread, or a traceback."""
    try:
        said = reading()
        outcome = "misread" if said or readable is False else "read"
        said = said or ("it was read, though it is wrong" if readable is False else "")
    except (CommandError, IrError, RecorderError) as error:
        said = str(error)
        outcome = "refused" if "\n" not in said and len(said) > 20 else "misread"
        if readable:
            outcome = "refused though right"
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
        outcome = "traceback"
    return {"kind": kind, "file": name, "outcome": outcome, "said": said[:160]}


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """The counts beside what is asked."""
    counts = Counter(row["outcome"] for row in rows)
    stout = Counter(row["outcome"] for row in rows if row["kind"] == "self check")
    return [
        at_least("files", len(rows), "", 60),
        at_most("silent misreadings", counts["misread"], "", 0),
        at_most("tracebacks", counts["traceback"], "", 0),
        at_most("right files refused", counts["refused though right"], "", 0),
        at_most("stout robots with meshes that meet though allowed", stout["misread"], "", 0),
        at_least("stout robots that are made", stout["read"], "", 1),
    ]


def main() -> None:
    """Read all files, print what came of each, and the counts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=5, help="default: 5")
    add_ending(parser, "1 seed")
    given = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for seed in range(FIRST_SEED, FIRST_SEED + (1 if given.quick else given.seeds)):
        with tempfile.TemporaryDirectory() as folder:
            for case in cases(np.random.default_rng(seed), Path(folder)):
                rows.append({"seed": seed, **row_of(*case)})
                print(line_of(rows[-1]), flush=True)
    finish(given.json, rows, claims_of(rows))


if __name__ == "__main__":
    main()
