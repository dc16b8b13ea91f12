"""`ir ros up`: parameters are held against what the nodes know, ports are free, and nothing is left
behind.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rclpy.node import Node

from ir_cli.errors import CommandError
from ir_cli.main import main
from ir_cli.ports import TCP, UDP, PortClaims, free_port, is_free
from ir_cli.ros import domain as alone
from ir_cli.ros.processes import cell_nodes
from ir_cli.ros.up import choose_ports, given_parameters, parameters_of
from ir_msgs_py.ros.testing import PATIENCE

WAITING = """
import os, signal, threading
from pathlib import Path
ended = threading.Event()
signal.signal(signal.SIGINT, lambda *_: ended.set())  # before anybody can know of this process
Path({pid!r}).write_text(str(os.getpid()))
while not ended.wait(0.02):
    pass
Path({end!r}).write_text("finished")
"""
PARENT = """
import signal, sys
from pathlib import Path
from ir_cli.ros.processes import NodeCommand, NodeProcesses
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whoever runs the tests may ignore it, as nohup does
with NodeProcesses(Path(sys.argv[1]), {"PYTHONPATH": sys.argv[2]}) as nodes:
    nodes.start([NodeCommand("waiting")])
    signal.pause()
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGHUP])
def test_nodes_end_with_the_process_that_started_them(
    number: int, tmp_path: Path, wait_for: Any
) -> None:
    pid = tmp_path / "pid"
    end = tmp_path / "end"
    (tmp_path / "waiting.py").write_text(WAITING.format(pid=str(pid), end=str(end)))
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    parent = subprocess.Popen([sys.executable, "-c", PARENT, str(tmp_path / "log"), path])
    try:
        wait_for(lambda: pid.exists() and pid.read_text(), what="the node starts")
        os.kill(int(pid.read_text()), 0)
        parent.send_signal(number)
        assert parent.wait(PATIENCE) == -number
        wait_for(lambda: end.exists() and end.read_text() == "finished", what="the node finishes")
    finally:
        parent.kill()


def test_a_parameter_goes_to_every_node_that_has_it_or_to_the_one_that_is_named() -> None:
    values = given_parameters(
        ["regeneration:=none", "ir_planner:max_iterations:=9", "signal_timeout:=5"]
    )
    assert values == {
        "ir_planner": {"regeneration": "none", "max_iterations": 9},
        "ir_sim_driver": {"regeneration": "none"},
        "ir_program_runner": {"signal_timeout": 5.0},
        "ir_recorder": {},
    }
    assert given_parameters(["facts:=[a=1, b=2]"])["ir_recorder"] == {"facts": ["a=1", "b=2"]}
    assert given_parameters(["execution.tube:=0.004"])["ir_sim_driver"] == {"execution.tube": 0.004}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("regeneration", "write name:=value"),
        ("regenaration:=none", "no parameter regenaration: did you mean regeneration?"),
        ("ir_plannr:cell:=demo", "no node ir_plannr: did you mean ir_planner?"),
        ("ir_planner:wake_port:=9", "no parameter wake_port"),
        ("wake_port:=high", "wake_port is 'high': it must be a whole number"),
        ("wake_port:=70000", "wake_port is 70000: it must be 0 .. 65535"),
        ("modbus:=1", "modbus is '1': it must be true or false"),
        ("backend:=real", 'backend is "real": known are pybullet, ideal'),
        ("wake_port:={", "is no YAML"),
        ("facts:=5", "must be a list of texts"),
    ],
)
def test_a_parameter_that_no_node_takes_is_a_sentence(text: str, sentence: str) -> None:
    with pytest.raises(CommandError) as refused:
        given_parameters([text])
    assert sentence in str(refused.value)


@pytest.mark.long
def test_every_default_is_a_value_that_may_be_given() -> None:
    for node in ("ir_planner", "ir_sim_driver", "ir_program_runner", "ir_recorder"):
        for name, setting in parameters_of(node).items():
            default = setting.default
            text = str(list(default)) if isinstance(default, tuple) else str(default).lower()
            if isinstance(default, str):
                text = default
            value = given_parameters([f"{node}:{name}:={text}"])[node][name]
            assert value == (list(default) if isinstance(default, tuple) else default), name


def nothing_given() -> dict[str, dict[str, object]]:
    return given_parameters([])


def test_taken_ports_are_replaced_by_free_ones_for_driver_and_runner() -> None:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as wake,
        socket.socket(socket.AF_INET, socket.SOCK_STREAM) as modbus,
    ):
        for other, port in ((wake, 9009), (modbus, 5020)):
            try:
                other.bind(("127.0.0.1", port))
            except OSError:
                continue  # somebody has it already: just as well
        modbus.listen()
        values = given_parameters(["modbus:=true"])
        with PortClaims() as claims:
            lines = choose_ports(values, claims)
    driver = values["ir_sim_driver"]
    assert driver["wake_port"] == values["ir_program_runner"]["wake_port"] != 9009
    assert driver["modbus_port"] != 5020
    assert [line.rpartition(": ")[2] for line in lines] == ["9009 is taken", "5020 is taken"]


@pytest.mark.parametrize("kind", [UDP, TCP])
def test_a_free_port_is_none_that_the_system_or_dds_gives_away_meanwhile(
    kind: socket.SocketKind,
) -> None:
    found = [free_port(kind) for _ in range(50)]
    assert len(set(found)) > 1  # two that start at once choose different ones
    for port in found:
        assert is_free(port, kind)
        assert 1024 < port < 32_768
        assert (port - 7_400) % 250 >= 10 + 2 * 95  # PB + DG * domain + d1 + PG * participant


def test_a_given_port_that_is_taken_is_refused() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        port = other.getsockname()[1]
        with pytest.raises(CommandError, match=f"wake_port {port} is taken"):
            choose_ports(given_parameters([f"wake_port:={port}"]), PortClaims())


def test_who_starts_while_the_nodes_of_another_do_not_listen_yet_gets_other_ports() -> None:
    """The driver opens its ports some seconds after it was started."""
    chosen = []
    with PortClaims() as first, PortClaims() as second:
        for claims in (first, second):
            values = given_parameters(["modbus:=true"])
            choose_ports(values, claims)
            parameters = {"wake_port": 9009, "modbus_port": 5020, **values["ir_sim_driver"]}
            chosen.append({name: parameters[name] for name in ("wake_port", "modbus_port")})
        assert chosen[0]["wake_port"] != chosen[1]["wake_port"]
        assert chosen[0]["modbus_port"] != chosen[1]["modbus_port"]
        port = chosen[0]["wake_port"]
        with pytest.raises(CommandError, match=f"wake_port {port} is taken"):
            choose_ports(given_parameters([f"wake_port:={port}"]), second)
    with PortClaims() as third:
        choose_ports(given_parameters([f"wake_port:={port}"]), third)


def test_the_namespace_reaches_every_node() -> None:
    lines = [command.arguments() for command in cell_nodes("demo", namespace="/cell_1")]
    assert len(lines) == 4
    assert all("__ns:=/cell_1" in line for line in lines)
    assert not any("__ns" in word for command in cell_nodes("demo") for word in command.arguments())


@pytest.mark.parametrize(
    "words", [["--namespace", "a b"], ["--namespace", "1"], ["-p", "x"], ["--cell", "-"]]
)
def test_what_makes_no_sense_is_refused_before_anything_starts(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["ros", "up", *words]) == 1
    said = capsys.readouterr()
    assert said.err.startswith("ir: ")
    assert said.out == ""


@pytest.fixture
def ros_discovery_range() -> str:
    """The command looks from a context of its own."""
    return "SYSTEM_DEFAULT"


def test_nodes_that_are_there_already_are_listed(ros_context, ros_executor, monkeypatch) -> None:
    ros_executor.add_node(Node("ir_planner", context=ros_context, namespace="cell_7"))
    monkeypatch.setattr(alone, "DISCOVERY_SECONDS", 60.0)  # it ends as soon as they are seen
    with pytest.raises(CommandError, match=r"there already: /cell_7/ir_planner\. .*or --namespace"):
        alone.refuse_beside("/cell_7")
    monkeypatch.setattr(alone, "DISCOVERY_SECONDS", 0.1)
    alone.refuse_beside("/cell_8")
