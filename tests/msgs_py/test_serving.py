"""Law 13 for services: every request is answered, also what comes while too many wait."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from array import array
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.action import ActionClient, CancelResponse
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.task import Future

from ir_msgs.action import RunProgram
from ir_msgs.srv import SetLoad, SetPlcInput
from ir_msgs_py.ros.rclpy_inside import SENDS, UNDISCOVERED, PatientSender
from ir_msgs_py.ros.serving import (
    BYTES_WAITING,
    LOOK,
    BoundedService,
    RecordedActionServer,
    RequestQueue,
    TakenGoals,
    gone,
)
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import SERVICE
from ir_msgs_py.status import StatusCode

MOST = 50
SENT = 400


def test_every_request_of_a_burst_is_answered_in_its_order_or_refused(
    ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    """The first request holds the server up until all others have come."""
    held = threading.Event()
    go_on = threading.Event()
    seen: list[str] = []

    def handler(request: Any, response: Any) -> Any:
        if request.name == "0":
            held.set()
            go_on.wait(PATIENCE)
        seen.append(request.name)
        response.status.code = StatusCode.SUCCESS
        return response

    server = BackgroundExecutor(ros_context)
    try:
        node = server.add_node(rclpy.create_node("bounded", context=ros_context))
        server.run(lambda: BoundedService(node, SetPlcInput, "~/ask", handler, most_waiting=MOST))
        client = ros_executor.run(
            lambda: ros_node.create_client(SetPlcInput, "/bounded/ask", qos_profile=SERVICE)
        )
        wait_for(client.service_is_ready, what="the service is offered")
        futures = [ros_executor.run(lambda: client.call_async(SetPlcInput.Request(name="0")))]
        wait_for(held.is_set, what="the server is held up")
        names = [str(k) for k in range(1, SENT)]
        futures += ros_executor.run(
            lambda: [client.call_async(SetPlcInput.Request(name=name)) for name in names]
        )
        go_on.set()
        wait_for(lambda: all(future.done() for future in futures), what="all are answered")
    finally:
        go_on.set()
        server.close()
    served = [future.result().status.code == StatusCode.SUCCESS for future in futures]
    said = {future.result().status.message for future in futures} - {""}
    assert seen == [str(k) for k, good in enumerate(served) if good]
    assert MOST <= sum(served) < SENT
    assert said == {f"{MOST} requests of /bounded/ask are waiting: send fewer at once"}


def test_requests_wait_up_to_a_number_of_bytes_and_the_first_whatever_its_size() -> None:
    queue = RequestQueue("ask")
    for size in (2 * BYTES_WAITING, BYTES_WAITING // 2):
        request = SetLoad.Request(inertia=array("d", bytes(size)))
        assert queue.add(request, lambda size=size: size) == ""
        more = SetLoad.Request(inertia=array("d", bytes(BYTES_WAITING // 2 + 8)))
        refused = queue.add(more, lambda: "more")
        assert refused.startswith("requests of ask that wait would take more than 64 MiB")
        assert queue.pop() == size
        assert len(queue) == 0


HELD_UP = """
import sys
from rclpy.node import Node
from ir_msgs.srv import SetLoad
from ir_msgs_py.ros.node_process import run_node
from ir_msgs_py.ros.serving import BoundedService

class Holding(Node):
    def __init__(self):
        super().__init__("holding")
        BoundedService(self, SetLoad, "~/ask", self.answer)

    def answer(self, request, response):
        if request.load == "hold":
            sys.stdin.readline()
        return response

run_node("holding", Holding, sys.argv)
"""


def resident(pid: int) -> int:
    """MB of memory of a process."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="utf-8")
    return int(status.partition("VmRSS:")[2].split()[0]) // 1024


@pytest.mark.parametrize("ros_discovery_range", ["SYSTEM_DEFAULT"])
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_the_memory_of_large_requests_is_given_back(
    ros_executor: Any, ros_node: Any, wait_for: Any, ros_domain_id: int
) -> None:
    environment = {**os.environ, "ROS_DOMAIN_ID": str(ros_domain_id)}
    with subprocess.Popen(
        [sys.executable, "-c", HELD_UP], stdin=subprocess.PIPE, env=environment, text=True
    ) as server:
        try:
            client = ros_executor.run(
                lambda: ros_node.create_client(SetLoad, "/holding/ask", qos_profile=SERVICE)
            )
            wait_for(client.service_is_ready, what="the service is offered")
            before = resident(server.pid)
            held = SetLoad.Request(load="hold")
            large = SetLoad.Request(inertia=array("d", bytes(8_000_000)))
            futures = ros_executor.run(
                lambda: [client.call_async(each) for each in (held, *[large] * 15)]
            )
            wait_for(lambda: resident(server.pid) > before + 100, what="15 of 8 MB have come")
            assert server.stdin is not None
            server.stdin.write("\n")
            server.stdin.flush()
            wait_for(lambda: all(future.done() for future in futures), what="all are answered")
            wait_for(lambda: resident(server.pid) < 1.2 * before, what="the memory is given back")
        finally:
            server.kill()


@pytest.mark.parametrize(
    ("there", "gone_from"), [((1, 1, 0, 1), 2), ((0, 0, 1, 0), 3), ((0, 0, 0, 0), 9), ((1,) * 4, 9)]
)
def test_a_client_has_gone_once_it_was_seen_and_is_no_more(
    there: tuple[int, ...], gone_from: int
) -> None:
    """Looked at when its request comes, and every LOOK then; it does not come back."""
    looks: list[int] = []
    now = [0.0]

    def look() -> bool:
        looks.append(there[len(looks)])
        return bool(looks[-1])

    left = gone(look, lambda: now[0])
    for k in range(1, len(there)):
        assert left() == (k > gone_from)  # not looked at yet
        now[0] += 1.01 * LOOK
        assert left() == (k >= gone_from)
    assert len(looks) == min(len(there), gone_from + 1)


class Middleware:
    """Drops the first `lost` responses, each after waiting for the client's reader."""

    def __init__(self, lost: int) -> None:
        self.lost = lost
        self.sent = 0
        self.now = 0.0

    def clock(self) -> float:
        return self.now

    def send(self, _response: Any, _header: Any) -> None:
        self.sent += 1
        if self.sent <= self.lost:
            self.now += 2.0 * UNDISCOVERED


def test_a_response_is_sent_again_until_the_server_has_discovered_its_client() -> None:
    middleware = Middleware(lost=2)
    PatientSender(middleware.send, middleware.clock).send("response", "header")
    assert middleware.sent == 3


def test_a_client_that_is_never_discovered_costs_a_second_and_no_more() -> None:
    """Its other responses are sent once; with a client that listens patience is back."""
    middleware = Middleware(lost=SENDS + 2)
    sender = PatientSender(middleware.send, middleware.clock)
    counts = []
    for _ in range(4):
        before = middleware.sent
        sender.send("response", "header")
        counts.append(middleware.sent - before)
    assert counts == [SENDS, 1, 1, 1]
    middleware.lost = middleware.sent + 1
    sender.send("response", "header")
    assert middleware.sent == middleware.lost + 1


@pytest.mark.parametrize("lost", [SENDS, SENDS + 1, SENDS + 40])
def test_an_answer_arrives_however_late_its_client_is_discovered_and_holds_up_nobody(
    lost: int, wait_for: Any
) -> None:
    """Clients whose reader the middleware finds after `lost` attempts; the others are known."""
    middleware = Middleware(lost)
    taken: list[Any] = []

    def send(response: Any, header: Any) -> None:
        if header == "late":
            middleware.send(response, header)
        if header != "late" or middleware.sent > lost:
            taken.append(response)

    sender = PatientSender(send, middleware.clock, late=100)
    sender.send("first", "late")
    assert middleware.sent >= SENDS
    sender.send("second", "known")
    wait_for(lambda: set(taken) == {"first", "second"}, what="both answers are taken")
    assert middleware.sent == lost + 1  # and none is sent again


def test_an_answer_whose_client_never_comes_is_given_up(wait_for: Any) -> None:
    middleware = Middleware(lost=10**9)
    sender = PatientSender(middleware.send, middleware.clock, late=7)
    sender.send("response", "header")
    wait_for(lambda: middleware.sent == SENDS + 7, what="the last attempt")
    wait_for(lambda: not sender._busy, what="the thread ends")
    assert middleware.sent == SENDS + 7


@pytest.fixture
def late_discovery(monkeypatch: pytest.MonkeyPatch) -> dict[str, int]:
    """The middleware's first two responses of each kind are lost, as rclpy says it; counts by
    kind.
    """
    sent: dict[str, int] = {}

    def loses(kind: str) -> None:
        plain = getattr(_rclpy.ActionServer, kind)

        def send(handle: Any, header: Any, response: Any) -> None:
            sent[kind] = sent.get(kind, 0) + 1
            if sent[kind] <= 2:
                time.sleep(2.0 * UNDISCOVERED)
                raise _rclpy.RCLError(f"Failed to {kind}")
            plain(handle, header, response)

        monkeypatch.setattr(_rclpy.ActionServer, kind, send)

    for kind in ("send_goal_response", "send_result_response", "send_cancel_response"):
        loses(kind)
    return sent


def test_a_goal_is_executed_though_its_client_is_discovered_late(
    late_discovery: dict[str, int],
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    wait_for: Any,
) -> None:
    """And the client hears that it was taken, that it will end, and what became of it."""
    canceled = Future()

    async def execute(goal: Any) -> Any:
        await canceled
        goal.canceled()
        return RunProgram.Result(executed=3)

    def cancel(goal: Any) -> CancelResponse:
        canceled.set_result(None)
        return CancelResponse.ACCEPT

    server = BackgroundExecutor(ros_context)
    try:
        node = server.add_node(rclpy.create_node("late", context=ros_context))
        made = server.run(
            lambda: RecordedActionServer(node, RunProgram, "~/run", execute, cancel_callback=cancel)
        )
        client = ros_executor.run(lambda: ActionClient(ros_node, RunProgram, "/late/run"))
        wait_for(client.server_is_ready, what="the action is offered")
        sent = ros_executor.run(lambda: client.send_goal_async(RunProgram.Goal()))
        wait_for(sent.done, what="the goal is taken")
        result = ros_executor.run(sent.result().get_result_async)
        ending = ros_executor.run(sent.result().cancel_goal_async)
        wait_for(lambda: result.done() and ending.done(), what="the goal has ended")
        assert result.result().result.executed == 3
        ros_executor.run(client.destroy)
        server.run(made.destroy)
    finally:
        server.close()
    assert set(late_discovery.values()) == {3}


class Unsendable:
    """No response at all."""


def fails(error: BaseException) -> Any:
    def handler(_request: Any, _response: Any) -> Any:
        raise error

    return handler


def unsendable(_request: Any, response: Any) -> Any:
    response.status.message = "\udcff"  # as a file name that is no UTF-8 gives
    return response


@pytest.mark.parametrize(
    "handler",
    [
        fails(SystemExit(3)),
        fails(MemoryError()),
        fails(RecursionError("deep")),
        fails(KeyError("\x1b[2J" * 5_000)),
        lambda _request, _response: None,
        lambda _request, _response: Unsendable(),
        unsendable,
    ],
)
def test_whatever_a_handler_does_its_client_is_answered_and_the_next_one_too(
    handler: Any, ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any
) -> None:
    """By a failure with a sentence that can be printed; the node goes on."""
    said: list[str] = []
    server = BackgroundExecutor(ros_context)
    try:
        node = server.add_node(rclpy.create_node("clumsy", context=ros_context))
        service = server.run(lambda: BoundedService(node, SetPlcInput, "~/ask", handler))
        service._log = said.append
        client = ros_executor.run(
            lambda: ros_node.create_client(SetPlcInput, "/clumsy/ask", qos_profile=SERVICE)
        )
        wait_for(client.service_is_ready, what="the service is offered")
        futures = [
            ros_executor.run(lambda: client.call_async(SetPlcInput.Request(name="0")))
            for _ in range(2)
        ]
        wait_for(lambda: all(future.done() for future in futures), what="both are answered")
    finally:
        server.close()
    statuses = [future.result().status for future in futures]
    assert [status.code for status in statuses] == [StatusCode.FAILURE] * 2
    assert all(status.message.isprintable() and len(status.message) < 5_000 for status in statuses)
    assert all("unexpected" in status.message for status in statuses)
    assert len(said) == 2


def test_of_goals_that_are_never_accepted_the_oldest_are_forgotten() -> None:
    noted = TakenGoals[int]()
    for k in range(5_000):
        noted.note(k.to_bytes(16, "big"), k)
    assert noted.pop((0).to_bytes(16, "big"), -1) == -1
    newest = (4_999).to_bytes(16, "big")
    assert noted.pop(newest, -1) == 4_999
    assert noted.pop(newest, -1) == -1
