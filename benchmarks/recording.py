"""Does a recording keep every message, what does recording take, and how soon is it explained?

    python benchmarks/recording.py [--seconds S] [--minutes M] [--quick] [--json FILE]

A process publishes joint states at 1 kHz and the other topics of a cell, `ir-record` records them.
A run of ten minutes is analysed and reported.
"""

from __future__ import annotations

import argparse
import os
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
from _results import Claim, add_ending, at_most, finish, line_of
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from ir_description import cell_to_yaml, load_cell, robot_urdf
from ir_msgs.msg import ControllerState, PlannedMovement, PowerState, ProgramState
from ir_recorder.format.qos import QosOffer
from ir_recorder.reading.cdr import Columns
from ir_recorder.reading.mcap_file import read_raw
from ir_recorder.recording import CellFiles, RecordingSession, RecordingWriter

# A cell's run as a recording, made without a robot: movements and rests at 500 Hz with their mains
# meter.

# ns
START = 1_700_000_000_000_000_000
TICK = 2_000_000
STEP_SECONDS = 4.0
# ticks between two readings of the meter, and of the controller
METER = 5
STATES = 10
TOPICS = {
    "/joint_states": ("sensor_msgs/msg/JointState", False),
    "/ir_sim_driver/power_state": ("ir_msgs/msg/PowerState", False),
    "/ir_sim_driver/controller_state": ("ir_msgs/msg/ControllerState", False),
    "/ir_program_runner/program_state": ("ir_msgs/msg/ProgramState", True),
}


def write_run(path: Path, seconds: float) -> int:
    """Write a program of movements that lasts so long; returns the number of messages."""
    cell = load_cell("demo")
    session = RecordingSession(RecordingWriter(path), {}, START)
    urdf = robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose)
    session.attach_cell(CellFiles(cell_to_yaml(cell), urdf), START)
    for topic, (kind, latched) in TOPICS.items():
        session.open_topic(topic, kind, [QosOffer(transient_local=latched)])
    count = max(int(seconds / STEP_SECONDS), 1)
    home = np.array(cell.machine_home)
    ends = (home, home + np.array([0.4, 0.1, -0.1, 0.3, 0.2, -0.4]))
    for index in range(count):
        _step(
            session,
            index,
            count,
            ends[index % 2],
            ends[(index + 1) % 2],
            list(cell.robot.joint_names),
        )
    return session.finish().messages


def _step(
    session: RecordingSession, index: int, count: int, start: Any, end: Any, joints: list[str]
) -> None:
    ticks = round(STEP_SECONDS * 1e9 / TICK)
    begun = START + index * ticks * TICK
    x = np.arange(ticks) / ticks
    q = start + (end - start) * (10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5)[:, None]
    qd = (end - start) * ((30.0 * x**2 - 60.0 * x**3 + 30.0 * x**4) / STEP_SECONDS)[:, None]
    effort = np.random.default_rng(index).normal(0.0, 100.0, q.shape)  # noise, as of a real robot
    movement = PlannedMovement(
        kind="regional", from_station="home", to_station="home", load="gripper"
    )
    movement.trajectory_id = f"{index:016x}"
    movement.duration = STEP_SECONDS
    state = ProgramState(
        program_id="run", index=index, total=count, event="started", movement=movement
    )
    _put(session, "/ir_program_runner/program_state", state, begun)
    for k in range(ticks):
        now = begun + k * TICK
        message = JointState(name=joints, position=q[k], velocity=qd[k], effort=effort[k])
        _put(session, "/joint_states", message, now)
        if k % METER == 0:
            power = PowerState(
                mode=1, target_mode=1, power=900.0, base_power=735.0, bus_voltage=560.0
            )
            power.energy = 900.0 * (now - START) * 1e-9
            power.joint_power = effort[k] * qd[k]
            power.joint_torque = effort[k]
            _put(session, "/ir_sim_driver/power_state", power, now)
        if k % STATES == 0:
            follows = ControllerState(
                joint_names=joints, trajectory_id=f"{index:016x}", speed_scaling=1.0
            )
            follows.path_time = k * TICK * 1e-9
            _put(session, "/ir_sim_driver/controller_state", follows, now)
    state.event = "ended"
    _put(session, "/ir_program_runner/program_state", state, begun + ticks * TICK)


def _put(session: RecordingSession, topic: str, message: Any, time: int) -> None:
    message.header.stamp = Time(sec=time // 1_000_000_000, nanosec=time % 1_000_000_000)
    session.message(topic, serialize_message(message), time)


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


def reported(folder: Path, minutes: float) -> dict[str, Any]:
    """Analyse and report a run of so many minutes in a process of its own."""
    path = folder / "run.mcap"
    page = folder / "run.html"
    messages = write_run(path, 60.0 * minutes)
    command = [sys.executable, "-m", "ir_cli.main", "report", str(path), "-o", str(page)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    begun = time.monotonic()
    subprocess.run([*command, "--root", str(folder)], check=True, capture_output=True)
    return {
        "case": "report",
        "minutes": minutes,
        "messages": messages,
        "wall_s": time.monotonic() - begun,
        "cpu_s": resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before,
        "page_mb": page.stat().st_size * 1e-6,
        "file_mb": path.stat().st_size * 1e-6,
    }


def measured(folder: Path, given: argparse.Namespace) -> Iterator[dict[str, Any]]:
    """All rows, one after the other."""
    yield streamed(folder, given.seconds)
    yield reported(folder, given.minutes)


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """The figures that were asked for."""

    def of(case: str) -> list[dict[str, Any]]:
        return [row for row in rows if row["case"] == case]

    (stream,) = of("stream")
    (report,) = of("report")
    page = f"page of {report['minutes']:g} minutes"
    return [
        at_most(f"joint states lost in {stream['seconds']:g} s at 1 kHz", stream["lost"], "", 0),
        at_most("recorder's processor time", stream["cpu_percent"], "% of a core", 30.0),
        at_most(
            f"{report['minutes']:g} minutes analysed and reported", report["wall_s"], "s", 15.0
        ),
        at_most(page, report["page_mb"], "MB", 8.0),
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
    add_ending(parser, "10 s of recording, 2 minutes of a run")
    given = parser.parse_args()
    if given.quick:
        given.seconds = 10.0
        given.minutes = 2.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rows: list[dict[str, Any]] = []
        for row in measured(folder, given):
            print(line_of(row), flush=True)
            rows.append(row)
    finish(given.json, rows, claims_of(rows))


if __name__ == "__main__":
    main()
