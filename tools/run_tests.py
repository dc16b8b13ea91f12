"""Run the tests in two parts, and close with one summary of both.

    python tools/run_tests.py [what pytest takes]

The tests of tests/system start the nodes as processes, with a robot that moves in real time: they
mostly wait for it, so they run beside the others, two files at a time, and print when both have
ended. Both parts run to their end whatever fails.
Paths and options are pytest's (`tests/planner -n0`, `-k energy`); a part whose paths are not asked
for is left out.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parent.parent
OUTPUT = ROOT / "out" / "tests"
SYSTEM = "tests/system"
MINUTES = 9  # on two quiet cores
WITH_VALUE = ("-k", "-m", "-n", "-p", "-W", "-o", "-c", "--dist", "--deselect", "--ignore")
NOTHING_COLLECTED = 5  # pytest's exit code: the words may choose tests of one part only


@dataclass(frozen=True)
class Part:
    """Tests that one call of pytest runs."""

    name: str
    words: tuple[str, ...]

    @property
    def results(self) -> Path:
        """The file of their results."""
        return OUTPUT / f"{self.name}.xml"

    @property
    def log(self) -> Path:
        """The file of what it prints where another part runs beside it."""
        return OUTPUT / f"{self.name}.log"

    def command(self) -> list[str]:
        """The call of pytest."""
        return [sys.executable, "-m", "pytest", f"--junitxml={self.results}", *self.words]


def parts(words: list[str], workers: int) -> list[Part]:
    """The parts that these words of pytest ask for. One worker more than there are cores keeps them
    busy: tests of nodes wait for each other's answers and for the robot's real time.
    """
    paths = paths_of(words)
    options = [word for word in words if word not in paths]
    system = [path for path in paths if SYSTEM in path]
    others = [path for path in paths if SYSTEM not in path]
    found = []
    if others or not paths:
        shared = ("-n", str(workers), "--dist", "worksteal", "--ignore", SYSTEM)
        found.append(Part("others", (*shared, *options, *others)))
    if system or not paths:
        two = ("-n", "2", "--dist", "loadfile")  # one waits for its robot while the other computes
        found.append(Part("system", (*two, *without_workers(options), *(system or [SYSTEM]))))
    return found


def paths_of(words: list[str]) -> list[str]:
    """The words that are files or folders of tests, or a test in a file."""
    return [
        word
        for before, word in pairwise(["", *words])
        if before not in WITH_VALUE
        and not word.startswith("-")
        and (ROOT / word.partition("::")[0]).exists()
    ]


def without_workers(options: list[str]) -> list[str]:
    """Options without those of pytest-xdist."""
    kept: list[str] = []
    skip = False
    for option in options:
        if not skip and not re.match(r"-n\d*$|-n=|--numprocesses|--dist", option):
            kept.append(option)
        skip = option in ("-n", "--dist", "--numprocesses") and not skip
    return kept


def run(chosen: list[Part]) -> dict[str, int]:
    """Run the parts side by side, whatever fails; exit codes by name. The first prints as it goes,
    what the others print follows when it has ended.
    """
    first, *others = chosen
    with ExitStack() as ends:
        beside = {part: begun(part, ends) for part in others}
        codes = {first.name: subprocess.run(first.command(), cwd=ROOT).returncode}
        for part, process in beside.items():
            codes[part.name] = process.wait()
            print(part.log.read_text(encoding="utf-8", errors="replace"), flush=True)
    return codes


def begun(part: Part, ends: ExitStack) -> subprocess.Popen[bytes]:
    """A part that prints into its log, and is ended when `ends` closes."""
    log = ends.enter_context(part.log.open("wb"))
    process = subprocess.Popen(part.command(), cwd=ROOT, stdout=log, stderr=subprocess.STDOUT)
    ends.callback(process.terminate)  # nothing where it has ended
    return process


def outcome(chosen: list[Part]) -> tuple[dict[str, int], list[str]]:
    """Counts of both parts, and the names of tests that failed."""
    counts = dict.fromkeys(("failed", "passed", "skipped", "error"), 0)
    failed = []
    for part in chosen:
        if not part.results.exists():
            continue
        for case in ElementTree.parse(part.results).iter("testcase"):
            kinds = {child.tag for child in case}
            kind = (
                "error" if "error" in kinds
                else "failed" if "failure" in kinds
                else "skipped" if "skipped" in kinds
                else "passed"
            )  # fmt: skip
            counts[kind] += 1
            if kind in ("failed", "error"):
                name = f"{case.get('classname', '').replace('.', '/')}.py::{case.get('name')}"
                failed.append(f"{kind.upper()} {name}")
    return counts, failed


def summary(counts: dict[str, int], seconds: float) -> str:
    """The line that pytest closes with, of both parts."""
    said = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    minutes, rest = divmod(round(seconds), 60)
    return f" {said or 'no tests ran'} in {seconds:.2f}s ({minutes} min {rest} s) ".center(80, "=")


def main() -> int:
    """Run what is asked for; 1 where any part failed."""
    words = sys.argv[1:]
    OUTPUT.mkdir(parents=True, exist_ok=True)
    cores = os.cpu_count() or 2
    chosen = parts(words, cores + 1)
    for part in chosen:
        part.results.unlink(missing_ok=True)
    if not paths_of(words) and "-k" not in words:
        sentence = f"about {MINUTES} minutes on two quiet cores; here are {cores}"
        print(f"{' and '.join(part.name for part in chosen)}: {sentence}", flush=True)
    begun = time.monotonic()
    codes = run(chosen)
    counts, failed = outcome(chosen)
    for line in failed:
        print(line)
    bad = {name: code for name, code in codes.items() if code not in (0, NOTHING_COLLECTED)}
    for name, code in bad.items():
        print(f"pytest of the part '{name}' ended with {code}")
    print(summary(counts, time.monotonic() - begun))
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main())
