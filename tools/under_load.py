"""Run tests again and again beside busy processes, and print a line for each run.

    python tools/under_load.py [--busy 8] [--runs 10] [what pytest takes]

Without further words the tests of real nodes are run, tests/nodes and tests/system, one after
another. A line says how many tests passed, failed and were repeated, the seconds, and the machine's
load average at the end of the run; the names of failed tests follow it. The output of each run is
in out/under_load. The exit code is 1 where any run failed.

The busy processes are ended by their ids; they also end by themselves when this process dies.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parent.parent
TESTS = ("-m", "not long", "tests/nodes", "tests/system")
OUTPUT = ROOT / "out" / "under_load"
_BUSY = """
import os, sys
parent = int(sys.argv[1])
while os.getppid() == parent:
    for _ in range(10**6):
        pass
"""
_COUNTS = ("passed", "failed", "error", "rerun", "skipped")


@contextmanager
def load(processes: int) -> Iterator[None]:
    """Keep so many processes busy, on whatever cores the system gives them."""
    busy = [
        subprocess.Popen([sys.executable, "-c", _BUSY, str(os.getpid())]) for _ in range(processes)
    ]
    try:
        yield
    finally:
        for process in busy:
            process.terminate()
        for process in busy:
            process.wait()


def run_to_the_end(command: list[str], output: IO[str]) -> int:
    """Run a command in a process group of its own, which ends with it; its exit code."""
    process = subprocess.Popen(
        command, cwd=ROOT, stdout=output, stderr=subprocess.STDOUT, start_new_session=True
    )
    try:
        return process.wait()
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def counts_of(output: str) -> dict[str, int]:
    """Counts of pytest's summary line ("3 failed, 12 passed, 1 rerun in 9.1s")."""
    summaries = [line for line in output.splitlines() if re.search(r" in \d+(\.\d+)?s\b", line)]
    found = re.findall(
        r"(\d+) (passed|failed|error|rerun|skipped)", summaries[-1] if summaries else ""
    )
    return dict.fromkeys(_COUNTS, 0) | {name: int(number) for number, name in found}


def main() -> int:
    """Run the tests under load; 1 where any run failed."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--busy", type=int, default=8, help="busy processes (default: %(default)s)")
    parser.add_argument("--runs", type=int, default=10, help="runs (default: %(default)s)")
    given, chosen = parser.parse_known_args()
    command = [sys.executable, "-m", "pytest", "-q", "-rfE", *(chosen or TESTS)]
    OUTPUT.mkdir(parents=True, exist_ok=True)
    failures = 0
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    print(f"{' '.join(command[1:])}, beside {given.busy} busy processes on {os.cpu_count()} cores")
    print("run  passed  failed  errors  reruns  skipped  seconds   load", flush=True)
    with load(given.busy):
        for k in range(1, given.runs + 1):
            begun = time.monotonic()
            log = OUTPUT / f"run_{k:03d}.log"
            with log.open("w", encoding="utf-8") as output:
                code = run_to_the_end(command, output)
            seconds = time.monotonic() - begun
            said = log.read_text(encoding="utf-8", errors="replace")
            passed, failed, errors, reruns, skipped = counts_of(said).values()
            print(
                f"{k:3d}  {passed:6d}  {failed:6d}  {errors:6d}  {reruns:6d}  {skipped:7d}"
                f"  {seconds:7.0f}  {os.getloadavg()[0]:5.1f}"
            )
            for line in re.findall(r"^(?:FAILED|ERROR) .*", said, re.MULTILINE):
                print(f"     {line[:160]}")
            sys.stdout.flush()
            failures += code != 0
    print(f"{given.runs - failures} of {given.runs} runs green")
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
