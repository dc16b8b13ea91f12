"""Do recordings keep everything, what does recording take, and how soon are they explained?

    python benchmarks/recording.py [--seconds S] [--minutes M] [--kills N] [--demo FILE] [--quick]

A process publishes joint states at 1 kHz and the other topics of a cell, `ir-record` records them.
A run of ten minutes is analysed and reported. Recordings are killed and read. A plan is recorded
and planned again, or the demonstration's recording. The CDR reader is held against two libraries.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from _driver_stream import process_cpu
from _node_process import DOMAIN
from _recording_killed import seconds_lost
from _recording_readers import reader_rows
from _recording_run import write_run
from _results import Claim, add_ending, at_least, at_most, finish, line_of

from ir_recorder.reading.cdr import Columns
from ir_recorder.reading.mcap_file import read_raw

HERE = Path(__file__).resolve().parent


def streamed(folder: Path, seconds: float) -> dict[str, Any]:
    """Record 1 kHz joint states and everything else for so long, in processes of their own."""
    path = folder / "stream.mcap"
    environment = {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": DOMAIN,
        **os.environ,
    }
    record = [sys.executable, "-m", "ir_recorder.node", str(path), "--root", str(folder)]
    talk = [sys.executable, str(HERE / "_recording_talker.py"), str(seconds)]
    pipe = subprocess.PIPE
    with (
        subprocess.Popen(record, env=environment, stderr=subprocess.DEVNULL) as recorder,
        subprocess.Popen(talk, env=environment, stdin=pipe, stdout=pipe) as talker,
    ):
        while not path.exists():
            time.sleep(0.05)
        time.sleep(1.0)  # the recorder's imports are no part of its share
        before = process_cpu(recorder.pid)
        begun = time.monotonic()
        assert talker.stdout is not None
        talker.stdout.readline()
        cpu = process_cpu(recorder.pid) - before
        passed = time.monotonic() - begun
        time.sleep(1.0)  # what was sent last arrives
        recorder.send_signal(signal.SIGINT)
        recorder.wait()
        talker.communicate()
    raw = read_raw(path)
    states = raw.channel("/joint_states")
    assert states is not None
    numbers = Columns(states.messages, states.type, states.schema_text).stamps() // 1_000_000
    return {
        "case": "stream",
        "seconds": seconds,
        "took_s": passed,
        "messages": sum(len(channel.messages) for channel in raw.channels),
        "lost": int(round(seconds * 1000.0) - len(np.unique(numbers))),
        "cpu_percent": 100.0 * cpu / seconds,
        "bytes_per_s": path.stat().st_size / seconds,
    }


def reported(folder: Path, minutes: float) -> tuple[dict[str, Any], Path]:
    """Analyse and report a run of so many minutes in a process of its own."""
    path = folder / "run.mcap"
    page = folder / "run.html"
    messages = write_run(path, 60.0 * minutes)
    command = [sys.executable, "-m", "ir_cli.main", "report", str(path), "-o", str(page)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    begun = time.monotonic()
    subprocess.run([*command, "--root", str(folder)], check=True, capture_output=True)
    row = {
        "case": "report",
        "minutes": minutes,
        "messages": messages,
        "wall_s": time.monotonic() - begun,
        "cpu_s": resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before,
        "page_mb": page.stat().st_size * 1e-6,
        "file_mb": path.stat().st_size * 1e-6,
    }
    return row, path


def replanned(folder: Path, demo: Path | None) -> dict[str, Any]:
    """Plan a recorded plan again, or the demonstration's."""
    path = demo or folder / "plan.mcap"
    base = [sys.executable, "-m", "ir_cli.main"]
    if demo is None:
        plan = [*base, "plan", "demo", "--record", str(path)]
        environment = {**os.environ, "IR_FILE_ROOTS": str(folder)}
        subprocess.run(plan, check=True, capture_output=True, env=environment)
    command = [*base, "replan", str(path), "--root", str(path.parent)]
    said = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    found = re.search(r"(\d+) of (\d+) requests planned again with equal ids \((\d+) ids\)", said)
    equal, requests, ids = map(int, found.groups()) if found else (0, 1, 0)
    return {"case": "replan", "file": path.name, "requests": requests, "equal": equal, "ids": ids}


def measured(folder: Path, given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """All rows, one after the other."""
    yield streamed(folder, given.seconds)
    row, run = reported(folder, given.minutes)
    yield row
    yield from reader_rows(run, 20_000)
    yield replanned(folder, given.demo)
    for number in range(given.kills):
        yield {"case": "killed", "lost_s": seconds_lost(folder, number)}


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """The figures that were asked for."""

    def of(case: str) -> list[dict[str, Any]]:
        return [row for row in rows if row["case"] == case]

    (stream,), (report,), (again,) = of("stream"), of("report"), of("replan")
    own, *others = of("reader")
    peer = min(row["us_per_message"] for row in others)
    lost = max(row["lost_s"] for row in of("killed"))
    page = f"page of {report['minutes']:g} minutes"
    return [
        at_most(f"joint states lost in {stream['seconds']:g} s at 1 kHz", stream["lost"], "", 0),
        at_most("recorder's processor time", stream["cpu_percent"], "% of a core", 30.0),
        at_most(
            f"{report['minutes']:g} minutes analysed and reported", report["wall_s"], "s", 15.0
        ),
        at_most(page, report["page_mb"], "MB", 8.0),
        at_least("requests planned again with equal ids", again["equal"], "", again["requests"]),
        at_most(f"lost by a kill, worst of {len(of('killed'))}", lost, "s", 1.0),
        at_least(
            "reading columns, times the faster library", peer / own["us_per_message"], "", 1.0
        ),
        at_least("readers that agree", sum(row["equal"] for row in (own, *others)), "", 3),
        at_most("damaged messages without a sentence", own["other_errors"], "", 0),
    ]


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=60.0, help="of recording at 1 kHz (60)")
    parser.add_argument(
        "--minutes", type=float, default=10.0, help="of the run that is reported (10)"
    )
    parser.add_argument("--kills", type=int, default=50, help="recordings that are killed (50)")
    parser.add_argument("--demo", type=Path, help="recording of the demonstration to plan again")
    add_ending(parser, "10 s of recording, 2 minutes of a run, 5 kills")
    given = parser.parse_args()
    if given.quick:
        given.seconds = 10.0
        given.minutes = 2.0
        given.kills = 5
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows: list[dict[str, Any]] = []
        for row in measured(folder, given):
            print(line_of(row), flush=True)
            rows.append(row)
    finish(given.json, rows, claims_of(rows))


if __name__ == "__main__":
    main()
