"""The runner as a process: it ends with 0 when it is asked to, and with a sentence when it can't
start.
"""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from ir_msgs_py.ros.testing import PATIENCE

NODE = [sys.executable, "-m", "ir_program_runner.node"]


# at its first line in the log the node is only half made
@pytest.mark.parametrize(
    ("signal_number", "moment"),
    [
        (signal.SIGINT, "ready to run programs"),
        (signal.SIGTERM, "ir_program_runner"),
        pytest.param(signal.SIGTERM, "ready to run programs", marks=pytest.mark.long),
        pytest.param(signal.SIGINT, "ir_program_runner", marks=pytest.mark.long),
    ],
)
def test_a_node_that_is_asked_to_end_exits_with_zero(
    signal_number, moment, ros_domain_id, monkeypatch
):
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain_id))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    arguments = ["--ros-args", "--log-level", "debug"]
    process = subprocess.Popen([*NODE, *arguments], stderr=subprocess.PIPE, text=True)
    try:
        assert any(moment in line for line in process.stderr)
        process.send_signal(signal_number)
        process.stderr.read()
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.stderr.close()


@pytest.mark.parametrize(
    ("parameter", "sentence"),
    [
        pytest.param("wake_port:=99999", "wake_port must be 1 .. 65535", marks=pytest.mark.long),
        ("mac:=nonsense", "mac is 'nonsense': it must be six hex bytes"),
        pytest.param("cell:=atlantis", "atlantis", marks=pytest.mark.long),
    ],
)
def test_a_bad_parameter_is_named_and_the_exit_code_is_not_zero(parameter, sentence, monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF")
    ended = subprocess.run(
        [*NODE, "--ros-args", "-p", parameter], capture_output=True, text=True, timeout=PATIENCE
    )
    assert ended.returncode == 1
    assert ended.stderr.startswith("ir_program_runner: ")
    assert sentence in ended.stderr
    assert "Traceback" not in ended.stderr
