"""How long does a newcomer wait? The tutorial typed from nothing, and the first answers of a cold
start.

    python benchmarks/walk.py [--quick] [--json FILE]

Follows docs/tutorial.md: every line is typed into a file, every command is a process of its own, in
an empty folder. Then `ir --help` and `ir plan demo`, each in a fresh process, the shortest of some
runs. Prints elapsed and processor seconds of each command. Closes with one line per figure:
measured value, bound, holds or falls short.
"""

from __future__ import annotations

import argparse
import resource
import shlex
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from _pages import commands, patched, snippets
from _results import Claim, add_ending, at_most, finish, line_of

PAGE = "tutorial.md"
TYPED = "first_cell.yaml"
IR = (sys.executable, "-m", "ir_cli.main")
RUNS = 10
QUICK_RUNS = 3
Row = dict[str, Any]


def timed(words: str, folder: str) -> Row:
    """Run one command of `ir`; its exit code, elapsed and processor seconds."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin = time.perf_counter()
    done = subprocess.run([*IR, *shlex.split(words)], cwd=folder, capture_output=True, check=False)
    elapsed = time.perf_counter() - begin
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
    return {
        "command": f"ir {words}",
        "seconds": elapsed,
        "processor": processor,
        "code": done.returncode,
    }


def walked(folder: str) -> list[Row]:
    """One row per command of the tutorial, in its order; unexpected: its exit code is not the
    page's.
    """
    typed = Path(folder) / TYPED
    rows = list[Row]()
    typed.write_text("")
    for snippet in snippets(PAGE):
        if snippet.language == "yaml":
            typed.write_text(typed.read_text() + snippet.text)
        elif snippet.language == "diff":
            typed.write_text(patched(typed.read_text(), snippet.text))
        for command in commands(snippet.text):
            row = timed(command.words, folder)
            rows.append(row | {"unexpected": int(row["code"] != command.code)})
    return rows


def claims_of(walk: list[Row], first: list[Row]) -> list[Claim]:
    """What was asked for, measured."""
    claims = [
        at_most(
            f"commands of {PAGE} that end unlike the page, of {len(walk)}",
            _sum(walk, "unexpected"),
            "",
            0,
        ),
        at_most(f"all commands of {PAGE}", _sum(walk, "seconds"), "s", 600),
    ]
    for words, bound in (("--help", 0.2), ("plan demo", 5.0)):
        own = [row["seconds"] for row in first if row["command"] == f"ir {words}"]
        claims.append(at_most(f"ir {words}, cold, shortest of {len(own)}", min(own), "s", bound))
    return claims


def _sum(rows: list[Row], key: str) -> float:
    return float(sum(row[key] for row in rows))


def main() -> None:
    """Walk, print, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add_ending(parser, f"{QUICK_RUNS} cold starts instead of {RUNS}")
    given = parser.parse_args()
    runs = QUICK_RUNS if given.quick else RUNS
    with tempfile.TemporaryDirectory() as folder:
        walk = walked(folder)
        first = [timed(words, folder) for words in ("--help", "plan demo") for _ in range(runs)]
    print("\n".join(line_of(row) for row in [*walk, *first]), flush=True)
    finish(given.json, [*walk, *first], claims_of(walk, first))


if __name__ == "__main__":
    main()
