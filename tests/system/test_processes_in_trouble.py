"""Nodes as processes: on a host that lacks what they could want, idle, and killed in their work."""

from __future__ import annotations

import itertools
import os
import signal
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from ir_cli.ros.processes import NodeProcesses, cell_nodes
from ir_msgs.srv import CheckState, QueryModes, SetCell, StartRecording
from ir_msgs_py import names
from ir_msgs_py.names import NODES
from ir_msgs_py.ros.client import Client
from ir_msgs_py.status import StatusCode
from ir_recorder.reading.mcap_file import read_raw
from ir_values.errors import CallTimedOutError, ServiceUnavailableError

pytestmark = pytest.mark.long

START_SECONDS = 120.0  # four processes on a busy machine
IDLE_SECONDS = 6.0
IDLE_SHARE = 0.35
"""Of a core, for the planner or the runner that has nothing to do. With /clock at factor 4: 0.15
and 0.09, on a busy machine; with a message for every tick of the plant, 2000 a second, it was 0.93
for the planner.
"""
AT_WORK = 0.3  # s of processor time after which a planner reads the cell that it was sent
GOAL = "A1 20 A2 -90 A3 90 A4 0 A5 0 A6 0"


@pytest.fixture
def nodes(tmp_path: Path) -> Iterator[NodeProcesses]:
    """No temporary folder, and a home that is none."""
    missing = str(tmp_path / "missing")
    environment = {**dict.fromkeys(("TMPDIR", "TEMP", "TMP"), missing), "HOME": "/dev/null"}
    with NodeProcesses(tmp_path / "log", environment) as processes:
        yield processes


@pytest.fixture
def client(ros_domain_id: int) -> Iterator[Client]:
    with Client(domain_id=ros_domain_id, timeout=START_SECONDS) as made:
        yield made


def used(pid: int) -> float:
    """Processor time [s] of a process so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_nodes_without_temporary_folder_and_home_plan_and_drive_and_idle_cheaply(
    factor: float, nodes: NodeProcesses, client: Client, wait_for: Any
) -> None:
    simulated = {"use_sim_time": factor != 1.0}
    driver = {"wake_port": 0, "backend": "pybullet", "real_time_factor": factor}
    nodes.start(
        cell_nodes("open", driver=driver, planner=simulated, runner=simulated, recorder=simulated)
    )

    def robot_is_heard() -> bool:
        status = client.call(names.CHECK_STATE, CheckState.Request()).status
        return bool(status.code == StatusCode.SUCCESS)

    wait_for(robot_is_heard, timeout=START_SECONDS)
    plan = client.plan_to(GOAL)
    assert (
        client.execute(client.get_trajectory(plan.trajectory_id), timeout=START_SECONDS).energy
        > 0.0
    )
    watched = {name: nodes.ids()[f"{name}.node"] for name in (names.PLANNER, names.PROGRAM_RUNNER)}
    before = {name: used(pid) for name, pid in watched.items()}
    began = time.monotonic()
    wait_for(lambda: time.monotonic() - began > IDLE_SECONDS, timeout=START_SECONDS)
    elapsed = time.monotonic() - began
    shares = {name: (used(pid) - before[name]) / elapsed for name, pid in watched.items()}
    assert {name: share for name, share in shares.items() if share > IDLE_SHARE} == {}
    nodes.check()
    assert set(nodes.stop().values()) == {0}


def large_cell(bodies: int) -> str:
    """A cell that takes the planner seconds to read."""
    boxes = "".join(
        f"      - {{name: b{k}, kind: box, size: [0.02, 0.02, 0.02], xyz: [{k % 50}, {k // 50}, "
        "0.5]}\n"
        for k in range(bodies)
    )
    return (
        "format: ir_cell/1\nname: large\nrobot: kr210_r2700_extra\nequipment:\n"
        f"  - name: far\n    pose: {{xyz: [3.5, 0, 0]}}\n    zone: OPEN\n    bodies:\n{boxes}"
    )


def test_a_planner_that_is_killed_in_set_cell_is_a_sentence_and_the_next_one_answers(
    nodes: NodeProcesses, client: Client, wait_for: Any
) -> None:
    planner = cell_nodes("open")[:1]
    nodes.start(planner)
    client.call(names.CHECK_STATE, CheckState.Request())
    answers: list[Any] = []

    def ask() -> None:
        try:
            answers.append(
                client.call(
                    names.SET_CELL, SetCell.Request(cell_yaml=large_cell(3000)), timeout=20.0
                )
            )
        except (CallTimedOutError, ServiceUnavailableError) as error:
            answers.append(str(error))

    pid = nodes.ids()["ir_planner.node"]
    idle = used(pid)
    asking = threading.Thread(target=ask)
    asking.start()
    wait_for(lambda: used(pid) - idle > AT_WORK, timeout=START_SECONDS)
    os.kill(pid, signal.SIGKILL)
    asking.join(START_SECONDS)
    (said,) = answers
    assert isinstance(said, str), "it was answered before it was killed"
    assert names.SET_CELL in said
    nodes.stop()
    nodes.start(planner)
    wait_for(lambda: client.set_cell("demo"), timeout=START_SECONDS)


def test_a_clock_of_times_that_are_none_ends_no_node(
    nodes: NodeProcesses, client: Client, wait_for: Any
) -> None:
    """A node whose callbacks fail fifty times in a minute ends."""
    simulated = {"use_sim_time": True}
    driver = {"wake_port": 0, "backend": "ideal", **simulated}
    nodes.start(
        cell_nodes("open", driver=driver, planner=simulated, runner=simulated, recorder=simulated)
    )
    clock = client._executor.run(lambda: client.node.create_publisher(Clock, "/clock", 10))
    wait_for(lambda: clock.get_subscription_count() == len(NODES), timeout=START_SECONDS)
    for _ in range(200):
        clock.publish(Clock(clock=Time(sec=-(2**31))))
        wait_for(clock.wait_for_all_acked)
    states: list[Any] = []
    client.subscribe(names.JOINT_STATES, JointState, states.append)
    hundredths = itertools.count(10_000)

    def goes_on() -> bool:
        seconds, rest = divmod(next(hundredths), 100)
        clock.publish(Clock(clock=Time(sec=seconds, nanosec=10_000_000 * rest)))
        return len(states) > 100

    wait_for(goes_on, timeout=START_SECONDS, what="the plant follows a time that is one")
    nodes.check()


def test_a_recorder_that_is_killed_leaves_a_file_that_can_be_read(
    nodes: NodeProcesses, client: Client, wait_for: Any, tmp_path: Path
) -> None:
    driver = {"wake_port": 0, "backend": "ideal"}
    nodes.start(cell_nodes("open", driver=driver, recorder={"roots": [str(tmp_path)]})[1::2])
    client.call(names.QUERY_MODES, QueryModes.Request())
    path = tmp_path / "killed.mcap"
    client.ask(names.START_RECORDING, StartRecording.Request(path=str(path)))
    wait_for(lambda: path.exists() and path.stat().st_size > 100_000, timeout=START_SECONDS)
    os.kill(nodes.ids()["ir_recorder.node"], signal.SIGKILL)
    raw = read_raw(path)
    joints = raw.channel(f"/{names.JOINT_STATES}")
    assert joints is not None
    assert len(joints.messages) > 100
    assert any(problem for problem in raw.problems), "that it has no end is said"
    assert client.ask(names.QUERY_MODES, QueryModes.Request()).status.code == StatusCode.SUCCESS
