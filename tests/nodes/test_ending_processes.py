"""Every node as a process: SIGINT or SIGTERM, once or twice, ends it with exit code 0 and no
traceback.
"""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node

from ir_msgs_py import names
from ir_msgs_py.ros.testing import PATIENCE

MODULES = {
    names.PLANNER: ["ir_planner.node"],
    names.SIM_DRIVER: [
        "ir_sim_driver.node",
        "--ros-args",
        "-p",
        "cell:=open",
        "-p",
        "wake_port:=0",
    ],
    names.PROGRAM_RUNNER: ["ir_program_runner.node"],
    names.RECORDER: ["ir_recorder.node"],
    "ir_record": ["ir_recorder.node", "FILE", "--root", "/"],
    "ir_play": ["ir_recorder.play.node", "FILE", "--root", "/", "--loop", "--delay", "60"],
}
INT = signal.SIGINT
TERM = signal.SIGTERM


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    from rclpy.serialization import serialize_message
    from std_msgs.msg import String

    from ir_recorder.format.qos import QosOffer
    from ir_recorder.recording.session import RecordingSession
    from ir_recorder.recording.writer import RecordingWriter

    path = tmp_path_factory.mktemp("recording") / "played.mcap"
    session = RecordingSession(RecordingWriter(path), {}, 10**18)
    session.open_topic("/text", "std_msgs/msg/String", [QosOffer()])
    session.message("/text", serialize_message(String(data="a")), 10**18)
    session.finish()
    return path


@pytest.fixture
def watcher(monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "SYSTEM_DEFAULT")
    context = Context()
    rclpy.init(context=context)
    node = Node("watcher", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


QUICK = [(names.PLANNER, [TERM, INT]), (names.RECORDER, [INT]), ("ir_play", [TERM, INT])]
"""Of the others test_driver_process.py, test_runner_process.py and test_recorder_node.py show
some.
"""
EVERY = [
    (name, signals) for name in MODULES for signals in ([INT], [TERM], [INT, INT], [TERM, INT])
]


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("name", "signals"),
    [*QUICK, *(pytest.param(*each, marks=pytest.mark.long) for each in EVERY if each not in QUICK)],
)
def test_a_node_that_is_asked_to_end_ends_well(
    name, signals, recording, tmp_path, watcher, wait_for
):
    file = recording if name == "ir_play" else tmp_path / "new.mcap"
    words = [str(file) if word == "FILE" else word for word in MODULES[name]]
    process = subprocess.Popen([sys.executable, "-m", *words], stderr=subprocess.PIPE, text=True)
    try:
        wait_for(lambda: name in watcher.get_node_names())
        for number in signals:
            process.send_signal(number)
        assert process.wait(PATIENCE) == 0
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()
    finally:
        process.kill()
        assert process.stderr is not None
        process.stderr.close()
    if name == "ir_record":
        from ir_recorder.reading.mcap_file import read_raw

        assert read_raw(file).problems == ()
