"""Make or complete the virtual environment .venv, doing only what has changed since the last call.

    python tools/set_up.py [--tests] [--portable]

Standard library only: it runs before anything is installed. Every stage has a fingerprint of what
it depends on; a stage whose fingerprint lies in .venv/.setup is skipped. Downloads and builds run
side by side. What pip and the compilers say goes to out/setup/STAGE.log, whose end is shown when a
stage fails. What somebody has uninstalled since is installed again. --tests: also what checks,
tests and benchmarks need. --portable: also the compiled core for any x86-64, which runs where .venv
is taken to another processor.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import platform
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor, as_completed
from pathlib import Path

from _distributions import ROOT, STAMPS, VENV, installed, note_what_came, said, site_packages
from _stages import LOGS, PYTHON, Stage, Stages

ONE_INSTALLS = threading.Lock()
ROS_OF_THE_SHELL = (
    "PYTHONPATH",
    "PYTHONHOME",
    "AMENT_PREFIX_PATH",
    "CMAKE_PREFIX_PATH",
    "LD_LIBRARY_PATH",
)


class SetupError(Exception):
    """Set-up can't go on; the sentence says what to do."""


def check_machine() -> None:
    """Raise a sentence for what no package index can deliver."""
    if sys.platform != "linux" or platform.machine() not in ("x86_64", "AMD64"):
        raise SetupError(
            f"The ROS 2 wheels exist for x86-64 Linux; this is {platform.machine()} "
            f"{platform.system()}. Use the container in docker/ instead."
        )
    compilers = (os.environ.get("CXX", "g++"), os.environ.get("CC", "gcc"))
    absent = [name for name in compilers if shutil.which(name.split()[0]) is None]
    if absent:
        raise SetupError(
            f"No {' and no '.join(absent)} on the path. A C++ compiler builds the interfaces and "
            "the core: apt install g++ (Debian, Ubuntu) or dnf install gcc-c++ (Fedora)."
        )


def make_venv() -> None:
    """Create .venv unless one is there that runs and was made at this place."""
    place = STAMPS / "place"
    moved = place.exists() and place.read_text() != str(VENV)
    runs = (
        PYTHON.exists()
        and subprocess.run([PYTHON, "-c", "import pip"], capture_output=True).returncode == 0
    )
    if moved or not runs:
        if VENV.exists() and Path(sys.prefix).resolve() == VENV.resolve():
            raise SetupError(
                f"{VENV} has been moved or lacks pip. Remove it: rm -rf .venv; make setup"
            )
        print(f"virtual environment of Python {platform.python_version()} in .venv", flush=True)
        shutil.rmtree(VENV, ignore_errors=True)
        run((sys.executable, "-m", "venv", str(VENV)), LOGS / "venv.log")
    STAMPS.mkdir(exist_ok=True)
    place.write_text(str(VENV))
    (
        VENV / "COLCON_IGNORE"
    ).touch()  # else colcon takes the wheels' package.xml files for packages to build


def run(command: tuple[str, ...], log: Path, folder: Path = ROOT, **variables: str) -> None:
    """Run one command with its output in the log; raise with the end of its output when it
    fails.
    """
    environment = {k: v for k, v in os.environ.items() if k not in ROS_OF_THE_SHELL} | variables
    environment["PATH"] = f"{VENV / 'bin'}{os.pathsep}{environment.get('PATH', os.defpath)}"
    with log.open("a") as output:
        output.write(f"$ {' '.join(command)}\n")
        output.flush()
        start = output.tell()
        code = subprocess.run(
            command, stdout=output, stderr=subprocess.STDOUT, cwd=folder, env=environment
        ).returncode
    if code != 0:
        lines = log.read_bytes()[start:].decode(errors="replace").splitlines()
        useful = [line for line in lines if "is ignored: it is" not in line]
        raise SetupError(
            "\n".join([*useful[-40:], f"{' '.join(command)} failed; all of it is in {log}"])
        )


def set_up(tests: bool, portable: bool) -> None:
    """Do what is missing."""
    start = time.monotonic()
    check_machine()
    make_venv()
    asked = subprocess.run(
        [PYTHON, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"],
        capture_output=True,
        text=True,
        check=True,
    )
    own = asked.stdout.strip()
    called = f"{sys.version_info[0]}.{sys.version_info[1]}"
    if own != called:
        raise SetupError(
            f".venv is of Python {own}, asked for is {called}. To change it: rm -rf .venv, then "
            "again."
        )
    stages = [stage for stage in Stages(own).all(tests, portable) if needed(stage)]
    left = [stage.says for stage in stages]
    for stage, seconds in side_by_side(stages, site_packages(own)):
        left.remove(stage.says)
        print(
            f"  {time.monotonic() - start:3.0f} s: {stage.says}, {seconds:.0f} s"
            + (f"; left: {', '.join(left)}" if left else ""),
            flush=True,
        )


def needed(stage: Stage) -> bool:
    """Say whether what a stage depends on has changed, or something of its result is missing."""
    unchanged = stage.stamp.exists() and stage.stamp.read_text() == stage.fingerprint
    missing = stage.missing() if unchanged else []
    if missing:
        print(f"{stage.says}{said(missing)}", flush=True)
    return not unchanged or bool(missing)


def side_by_side(stages: list[Stage], site: Path) -> Iterator[tuple[Stage, float]]:
    """Complete the stages, each after those that it needs, and yield each with its seconds once it
    is done.

    All that can end does before the first failure is raised.
    """
    running: dict[str, Future[float]] = {}
    with ThreadPoolExecutor(max(len(stages), 1)) as pool:
        for stage in stages:
            before = [running[name] for name in stage.after if name in running]
            running[stage.name] = pool.submit(complete_after, before, stage, site)
        of = {running[stage.name]: stage for stage in stages}
        for done in as_completed(of):
            if done.exception() is None:
                yield of[done], done.result()
    for done in running.values():
        done.result()


def complete_after(before: list[Future[float]], stage: Stage, site: Path) -> float:
    """Do a stage when others are done; seconds that it took. Their failure is its own."""
    for other in before:
        other.result()
    return complete(stage, site)


def complete(stage: Stage, site: Path) -> float:
    """Do a stage; seconds that it took, without waiting for other installs."""
    stage.stamp.unlink(missing_ok=True)
    start = time.monotonic()
    if stage.builds:
        run(("nice", "-n", "5", *stage.builds), stage.log, stage.folder, **stage.environment)
    seconds = time.monotonic() - start
    if stage.installs:
        with ONE_INSTALLS:
            start = time.monotonic()
            before = installed(site)
            run(stage.installs, stage.log, stage.folder, **stage.environment)
            if stage.requirements is not None:
                note_what_came(site, stage.requirements, before)
            seconds += time.monotonic() - start
    stage.stamp.write_text(stage.fingerprint)
    if missing := stage.missing():
        sentence = (
            f"  {stage.name}: not all of it is there{said(missing)}; see "
            f"{stage.log.relative_to(ROOT)}"
        )
        print(sentence, file=sys.stderr, flush=True)
    return seconds


def main() -> int:
    """Set up under a lock: two calls at a time would install into each other."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--tests", action="store_true", help="also what checks, tests and benchmarks need"
    )
    parser.add_argument(
        "--portable", action="store_true", help="also the compiled core for any x86-64"
    )
    arguments = parser.parse_args()
    LOGS.mkdir(parents=True, exist_ok=True)
    with (LOGS / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        try:
            set_up(arguments.tests, arguments.portable)
        except SetupError as error:
            print(error, file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
