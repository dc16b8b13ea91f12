"""Nodes as child processes: parameters reach them, a dead one is noticed, all are stopped."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from ir_cli.errors import CommandError
from ir_cli.ros.processes import NodeCommand, NodeProcesses


def write_module(folder: Path, name: str, body: str) -> dict[str, str]:
    (folder / f"{name}.py").write_text(body)
    return {"PYTHONPATH": os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])}


def wait_for(path: Path, text: str) -> None:
    for _ in range(2400):
        if path.exists() and text in path.read_text():
            return
        threading.Event().wait(0.025)
    raise AssertionError(f"{path} never held {text!r}")


def check_until_it_raises(nodes: NodeProcesses) -> None:
    for _ in range(2400):
        nodes.check()
        threading.Event().wait(0.025)


def test_strings_stay_strings_and_numbers_numbers_on_the_command_line() -> None:
    command = NodeCommand(
        "some.node", {"cell": "123", "rate": 2.5, "on": True, "facts": ["a=1", "b"]}
    )
    line = command.arguments()
    assert 'cell:="123"' in line
    assert "rate:=2.5" in line
    assert "on:=true" in line
    assert "facts:=['a=1', 'b']" in line


def test_a_node_that_dies_is_named_with_the_end_of_its_output(tmp_path: Path) -> None:
    environment = write_module(tmp_path, "dying", "raise SystemExit('no robot here')")
    with NodeProcesses(tmp_path / "log", environment) as nodes:
        nodes.start([NodeCommand("dying")])
        wait_for(tmp_path / "log" / "dying.log", "no robot here")
        with pytest.raises(CommandError, match=r"dying ended with exit code 1:\n  no robot here"):
            check_until_it_raises(nodes)


def test_a_node_that_is_killed_is_named_with_the_signal(tmp_path: Path) -> None:
    environment = write_module(tmp_path, "killed", "import os\nos.kill(os.getpid(), 9)\n")
    with NodeProcesses(tmp_path / "log", environment) as nodes:
        nodes.start([NodeCommand("killed")])
        with pytest.raises(CommandError, match=r"^killed was ended by SIGKILL$"):
            check_until_it_raises(nodes)


def test_leaving_the_context_ends_all_nodes(tmp_path: Path) -> None:
    body = (
        "import os, signal\nprint(os.getpid(), flush=True)\nprint('up', "
        "flush=True)\nsignal.pause()\n"
    )
    environment = write_module(tmp_path, "waiting", body)
    with NodeProcesses(tmp_path / "log", environment) as nodes:
        nodes.start([NodeCommand("waiting")])
        log = tmp_path / "log" / "waiting.log"
        wait_for(log, "up")
        process_id = int(log.read_text().split()[0])
        nodes.check()
    with pytest.raises(ProcessLookupError):
        os.kill(process_id, 0)
