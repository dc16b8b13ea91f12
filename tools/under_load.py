"""Run tests again and again beside busy processes, and print a line for each run.

    python tools/under_load.py [--busy 8] [--runs 10] [--at-once 1] [what pytest takes]

Without further words the tests of real nodes are run, tests/nodes and tests/system. A line says how
many tests passed, failed and were repeated, the seconds, and the machine's load average at the end
of the run; the names of failed tests follow it. The output of each run is in out/under_load. The
exit code is 1 where any run failed.

Runs at once are each other's load, and leave the processor to tests instead of busy processes.

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
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

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


class Runs:
    """Runs of the tests, each in a process group of its own, which ends with it or with all."""

    def __init__(self, command: list[str]) -> None:
        self._command = command
        self._running: set[subprocess.Popen[bytes]] = set()

    def __enter__(self) -> Runs:
        return self

    def __exit__(self, *_: object) -> None:
        for process in tuple(self._running):
            _end_group(process)

    def run(self, k: int) -> bool:
        """Run the tests once and print their line; whether all passed."""
        begun = time.monotonic()
        log = OUTPUT / f"run_{k:03d}.log"
        with log.open("w", encoding="utf-8") as output:
            process = subprocess.Popen(
                self._command,
                cwd=ROOT,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
            self._running.add(process)
            code = process.wait()
            _end_group(process)
            self._running.discard(process)
        said = log.read_text(encoding="utf-8", errors="replace")
        passed, failed, errors, reruns, skipped = counts_of(said).values()
        lines = [
            f"{k:3d}  {passed:6d}  {failed:6d}  {errors:6d}  {reruns:6d}  {skipped:7d}"
            f"  {time.monotonic() - begun:7.0f}  {os.getloadavg()[0]:5.1f}"
        ]
        lines += [
            f"     {line[:160]}" for line in re.findall(r"^(?:FAILED|ERROR) .*", said, re.MULTILINE)
        ]
        print("\n".join(lines), flush=True)
        return code == 0


def _end_group(process: subprocess.Popen[bytes]) -> None:
    """End a run and all that it started."""
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
    parser.add_argument(
        "--at-once", type=int, default=1, help="runs at once (default: %(default)s)"
    )
    given, chosen = parser.parse_known_args()
    command = [sys.executable, "-m", "pytest", "-q", "-rfE", *(chosen or TESTS)]
    OUTPUT.mkdir(parents=True, exist_ok=True)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    print(
        f"{' '.join(command[1:])}, {given.at_once} at once beside {given.busy} busy processes on "
        f"{os.cpu_count()} cores"
    )
    print("run  passed  failed  errors  reruns  skipped  seconds   load", flush=True)
    with load(given.busy), ThreadPoolExecutor(given.at_once) as threads, Runs(command) as runs:
        asked = [threads.submit(runs.run, k) for k in range(1, given.runs + 1)]
        try:
            green = sum(run.result() for run in asked)
        finally:
            threads.shutdown(wait=False, cancel_futures=True)
    print(f"{green} of {given.runs} runs green")
    return int(green < given.runs)


if __name__ == "__main__":
    sys.exit(main())
