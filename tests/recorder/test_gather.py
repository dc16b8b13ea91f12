"""What a recording asks of other nodes is asked again where the answer was lost."""

from __future__ import annotations

from typing import Any

from rclpy.task import Future

from ir_recorder.node.node_queries import PATIENCE, RepeatedRequest


class Service:
    """A client of a service that answers when the test says so."""

    def __init__(self) -> None:
        self.ready = True
        self.asked: list[Future] = []
        self.given_up: list[Future] = []

    def service_is_ready(self) -> bool:
        return self.ready

    def call_async(self, _request: Any) -> Future:
        self.asked.append(Future())
        return self.asked[-1]

    def remove_pending_request(self, future: Future) -> None:
        self.given_up.append(future)


def looked(asked: RepeatedRequest, times: int) -> None:
    for _ in range(times):
        asked.each()


def test_a_lost_answer_is_asked_for_again() -> None:
    service = Service()
    taken = list[str]()
    asked = RepeatedRequest(service, "request", lambda answer: not taken.append(answer))
    looked(asked, 2 * PATIENCE + 1)
    assert len(service.asked) == 3
    assert service.given_up == service.asked[:2], "their answers count no more"
    service.asked[-1].set_result("answer")
    looked(asked, 3 * PATIENCE)
    assert taken == ["answer"]
    assert len(service.asked) == 3


def test_an_answer_that_is_not_taken_is_asked_for_at_the_next_look() -> None:
    service = Service()
    asked = RepeatedRequest(service, "request", lambda answer: answer == "good")
    for answer in ("bad", None, "good"):
        looked(asked, 1)
        service.asked[-1].set_result(answer)
    assert asked.done
    looked(asked, PATIENCE)
    assert len(service.asked) == 3


def test_a_service_that_has_gone_is_asked_when_it_is_back() -> None:
    service = Service()
    asked = RepeatedRequest(service, "request", bool)
    looked(asked, 1)
    service.ready = False
    looked(asked, 2 * PATIENCE)
    assert len(service.asked) == 1
    service.ready = True
    looked(asked, 1)
    assert len(service.asked) == 2
