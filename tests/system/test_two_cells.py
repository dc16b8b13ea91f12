"""Two complete cells in one graph: each plans, drives and records its own, started by two `ir
up`.
"""

from __future__ import annotations

import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Log, ParameterEvent
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from ir_msgs.msg import Status
from ir_msgs.srv import CheckState, StartRecording, StopRecording
from ir_msgs_py import names
from ir_msgs_py.names import NODES
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.testing import PATIENCE
from ir_recorder import read_recording
from ir_recorder.reading.mcap_file import RawRecording, read_raw

CELLS = ("left", "right")
GOALS = {"left": "A1 20 A2 -90 A3 90 A4 0 A5 0 A6 0", "right": "A1 -20 A2 -90 A3 90 A4 0 A5 0 A6 0"}
TURNED = {"left": math.radians(20.0), "right": math.radians(-20.0)}
REACHED = 1e-3  # rad
START_SECONDS = 120.0  # four processes on a busy machine


@pytest.fixture
def up(tmp_path: Path, ros_domain_id: int) -> Iterator[Callable[[str], subprocess.Popen[str]]]:
    """Start a cell in a namespace; whatever still runs at the end is ended."""
    started: list[subprocess.Popen[str]] = []

    def start(cell: str) -> subprocess.Popen[str]:
        words = ["up", "--cell", "open", "--namespace", cell, "--domain", str(ros_domain_id)]
        words += [
            "-p",
            "backend:=ideal",
            "-p",
            f"ir_recorder:roots:=[{tmp_path}]",
            "--logs",
            str(tmp_path),
        ]
        started.append(
            subprocess.Popen(
                [sys.executable, "-m", "ir_cli.main", *words],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                env=dict(os.environ),
            )
        )
        return started[-1]

    yield start
    for process in started:
        process.kill()
        process.wait()


def own(raw: RawRecording, topic: str, message_type: Any) -> list[Any]:
    channel = raw.channel(topic)
    return (
        []
        if channel is None
        else [deserialize_message(data, message_type) for data in channel.messages]
    )


@pytest.mark.long
def test_two_cells_in_one_domain_keep_to_themselves(
    up: Any, ros_domain_id: int, wait_for: Any, tmp_path: Path
) -> None:
    processes = []
    clients = {}
    try:
        for cell in CELLS:
            processes.append(up(cell))
            client = Client(cell, domain_id=ros_domain_id, timeout=START_SECONDS)
            clients[cell] = client
            nodes = {f"/{cell}/{node}" for node in NODES}
            wait_for(
                lambda nodes=nodes, client=client: (
                    nodes <= set(client.graph.nodes())
                    or any(process.poll() is not None for process in processes)
                ),
                timeout=START_SECONDS,
            )
        for cell, client in clients.items():
            request = StartRecording.Request(path=str(tmp_path / f"{cell}.mcap"))
            client.ask(names.START_RECORDING, request)
        ids = {}
        for cell, client in clients.items():
            wait_for(
                lambda client=client: (
                    client.call(names.CHECK_STATE, CheckState.Request()).status.code
                    == Status.SUCCESS
                ),
                timeout=START_SECONDS,
                what=f"the planner of {cell} hears its robot",
            )
            plan = client.plan_to(GOALS[cell])
            ids[cell] = plan.trajectory_id
            client.execute(client.get_trajectory(plan.trajectory_id))
        for cell in CELLS:
            wait_for(
                lambda cell=cell: is_written(tmp_path / f"{cell}.mcap", cell),
                what="all is recorded",
            )
        for client in clients.values():
            client.ask(names.STOP_RECORDING, StopRecording.Request())
    finally:
        for client in clients.values():
            client.close()
    for process in processes:
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=PATIENCE)
        assert process.returncode == 130, said
    assert "is taken" in said, "the second cell has a Wake-on-LAN port of its own"
    assert ids["left"] != ids["right"]
    for cell in CELLS:
        judge(tmp_path / f"{cell}.mcap", cell, ids[cell])


def is_written(path: Path, cell: str) -> bool:
    """Whether a running recording has the end of the movement, and a word of every node."""
    raw = read_raw(path)
    states = own(raw, f"/{cell}/{names.JOINT_STATES}", JointState)
    heard = {
        status.name for msg in own(raw, names.DIAGNOSTICS, DiagnosticArray) for status in msg.status
    }
    said = {f"{cell}/{node}" for node in NODES} <= {name.split(":")[0] for name in heard}
    return said and bool(states) and abs(states[-1].position[0] - TURNED[cell]) < REACHED


def judge(path: Path, cell: str, trajectory_id: str) -> None:
    """Everything in the recording is of this cell, and the movement that was asked of it is in
    it.
    """
    raw = read_raw(path)
    shared = {names.DIAGNOSTICS, names.ROSOUT, names.PARAMETER_EVENTS}
    assert all(
        channel.topic.startswith(f"/{cell}/") or channel.topic in shared for channel in raw.channels
    )
    statuses = [
        status.name for msg in own(raw, names.DIAGNOSTICS, DiagnosticArray) for status in msg.status
    ]
    assert {name.split(":")[0] for name in statuses} == {f"{cell}/{node}" for node in NODES}
    assert {msg.name.split(".")[0] for msg in own(raw, names.ROSOUT, Log)} <= {cell}
    events = own(raw, names.PARAMETER_EVENTS, ParameterEvent)
    assert all(msg.node.startswith(f"/{cell}/") for msg in events)
    recording = read_recording(path)
    assert all("program_state" in problem for problem in recording.problems)  # no program was run
    assert recording.controller is not None
    assert set(recording.controller.trajectory_id) - {""} == {trajectory_id}
    assert recording.joints is not None
    assert recording.joints.position[-1, 0] == pytest.approx(TURNED[cell], abs=REACHED)
