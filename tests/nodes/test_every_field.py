"""Every number and text of every service and action of the four nodes, as NaN, inf, 1e308, empty or
10 MB.

Services and actions are those that the nodes offer, their fields those of the definitions
(fields.py). The
judge looks from outside: each request is answered, a refusal says why, no process has ended or
grown.
"""

from __future__ import annotations

import importlib.util
import random
import resource
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from rclpy._rclpy_pybind11 import NodeNameNonExistentError
from rclpy.action.graph import get_action_server_names_and_types_by_node
from rclpy.parameter import Parameter

from ir_cli.ros.processes import NodeProcesses, cell_nodes
from ir_msgs.msg import Status
from ir_msgs_py.names import NODES, hidden_node
from ir_msgs_py.ros import client as client_module
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.messages import interface_type
from ir_program_runner.node import ProgramRunnerNode
from ir_recorder.node.recorder import RecorderNode
from ir_sim_driver.node import SimDriver
from ir_values.errors import CallTimedOutError

DRIVER = {"backend": "ideal", "wake_port": 0}
# of each service and action; of all
SAMPLED = 1
SAMPLED_HUGE = 2
ANSWERED = 60.0  # s; 10 MB take a loaded machine long
RUNS = 0.5  # s; a goal that makes sense after all is canceled then
ENOUGH = 5  # that went wrong: each may have taken a minute
SENTENCE_MAX = 4000  # characters: what fits a screen
GROWN_MB = 25.0
OFFERED = {"ir_planner": 20, "ir_sim_driver": 13, "ir_program_runner": 7, "ir_recorder": 8}
"""Services and actions of each node, parameters included; one that is added may be entered here."""


def _fields() -> ModuleType:
    spec = importlib.util.spec_from_file_location("fields", Path(__file__).with_name("fields.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


fields = _fields()
Offer = tuple[str, str, Any]
"""Name of a service or action, "srv" or "action", and its class."""


def offers_of(client: Client, node: str) -> list[Offer]:
    """What a node offers, except for the parts of actions."""
    try:
        services = client.node.get_service_names_and_types_by_node(node, "/")
        actions = get_action_server_names_and_types_by_node(client.node, node, "/")
    except NodeNameNonExistentError:  # not discovered yet
        return []
    with suppress(NodeNameNonExistentError):  # a participant of its own, where there is one
        services += client.node.get_service_names_and_types_by_node(
            hidden_node(node, "requests"), "/"
        )
    kinds = [(name, "srv", types[0]) for name, types in services if "/_action/" not in name]
    kinds += [(name, "action", types[0]) for name, types in actions]
    return [(name, kind, interface_type(text, kind)) for name, kind, text in sorted(kinds)]


class Attack:
    """Asks the nodes that a client sees; wrong: what was not answered as it should."""

    def __init__(self, client: Client, wait_for: Any) -> None:
        self.wrong: list[str] = []
        self._client = client

        def all_offered() -> bool:
            return all(len(offers_of(client, node)) >= count for node, count in OFFERED.items())

        wait_for(all_offered, what="all services and actions are offered")
        self.offers = [offer for node in NODES for offer in offers_of(client, node)]
        self.cases = [
            (offer, case) for offer in self.offers for case in fields.cases_of(_part(offer))
        ]

    def put(self, cases: Sequence[tuple[Offer, Any]]) -> None:
        """One case after the other."""
        for offer, case in cases:
            if len(self.wrong) >= ENOUGH:
                return
            name, kind, interface = offer
            request = case.put_into(fields.example(f"{kind}/{interface.__name__}", _part(offer)))
            problem = wrong(self._answer(offer, request))
            if problem:
                self.wrong.append(f"{name} {case}: {problem}")

    def _answer(self, offer: Offer, request: Any) -> Any:
        """The response or result; None = canceled, "" = none came."""
        name, kind, _ = offer
        if kind == "srv":
            with suppress(CallTimedOutError):
                return self._client.call(name, request, timeout=ANSWERED)
            return ""
        try:
            return self._client.send_goal(name, request, timeout=RUNS)
        except CallTimedOutError as error:
            return None if "was canceled" in str(error) else ""


def _part(offer: Offer) -> Any:
    return offer[2].Request if offer[1] == "srv" else offer[2].Goal


def wrong(answer: Any) -> str:
    """What is wrong with an answer; "" = nothing."""
    if answer == "":
        return "no answer"
    if hasattr(answer, "status"):
        sentence = answer.status.message
        refused = answer.status.code != Status.SUCCESS
    elif hasattr(answer, "error_string"):
        sentence = answer.error_string
        refused = answer.error_code != 0
    else:  # of a node's parameters, which are ROS's own, or of a goal that was canceled
        return ""
    if refused and not (sentence and sentence.isprintable() and len(sentence) <= SENTENCE_MAX):
        return f"its sentence is {sentence[:200]!r} ({len(sentence)} characters)"
    return f"it is {sentence[:300]}" if "unexpected" in sentence else ""


def sampled(cases: Sequence[tuple[Offer, Any]], seed: int) -> list[tuple[Offer, Any]]:
    """Some cases of each service and action, and a few texts of 10 MB."""
    shuffled = random.Random(seed).sample(cases, len(cases))
    huge = [each for each in shuffled if each[1].value is fields.HUGE]
    small = [each for each in shuffled if each[1].value is not fields.HUGE]
    of_each: dict[str, list[tuple[Offer, Any]]] = {}
    for each in small:
        of_each.setdefault(each[0][0], []).append(each)
    return huge[:SAMPLED_HUGE] + [each for group in of_each.values() for each in group[:SAMPLED]]


@pytest.mark.usefixtures("planner_node")
def test_a_sample_of_all_fields_is_answered(
    ros_context: Any,
    ros_executor: Any,
    wait_for: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(client_module, "_CANCEL_GRACE", ANSWERED)
    overrides = [Parameter(name, value=value) for name, value in {"cell": "demo", **DRIVER}.items()]
    ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    for make in (ProgramRunnerNode, RecorderNode):
        ros_executor.add_node(make(context=ros_context))
    with Client(context=ros_context, timeout=ANSWERED) as client:
        attack = Attack(client, wait_for)
        attack.put(sampled(attack.cases, seed=1))
        assert attack.wrong == []


def memory(nodes: NodeProcesses) -> dict[str, float]:
    """Resident memory of each process [MB]."""
    kept = {name: Path(f"/proc/{pid}/statm").read_text() for name, pid in nodes.ids().items()}
    return {
        name: int(text.split()[1]) * resource.getpagesize() / 2**20 for name, text in kept.items()
    }


@pytest.mark.long
def test_every_field_is_answered_and_no_process_ends_or_grows(
    ros_domain_id: int, wait_for: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(client_module, "_CANCEL_GRACE", ANSWERED)
    with (
        NodeProcesses(tmp_path / "log", {}) as nodes,
        Client(domain_id=ros_domain_id, timeout=ANSWERED) as client,
    ):
        nodes.start(cell_nodes("demo", driver=DRIVER))
        attack = Attack(client, wait_for)
        attack.put(attack.cases)  # buffers get as large as what came
        before = memory(nodes)
        attack.put([each for each in attack.cases if each[1].value is fields.HUGE])
        after = memory(nodes)
        nodes.check()
        assert attack.wrong == []
        grown = {name: after[name] - before[name] for name in before}
        assert {name: mb for name, mb in grown.items() if mb > GROWN_MB} == {}
