"""rclpy's services for parameters, so that each of their requests is answered, and in bounded
sentences.

rclpy converts what comes without a look at it: a type of value that is none raises in its callback,
and the client waits for ever. A reason repeats the name or the value, however long they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node

from ir_msgs_py.checks import one_line
from ir_msgs_py.ros.refusals import ANY

PACKAGE = "rcl_interfaces"
Callback = Callable[[Any, Any], Any]


def answer_always(node: Node) -> None:
    """Let every request for parameters of the node be answered; once is enough.

    What can't be set is refused with what was raised, and what comes after it in the request with
    it. Whoever asks for values gets none.
    """
    for service in node.services:
        if service.srv_type.__module__.startswith(PACKAGE) and not hasattr(
            service.callback, "guarded"
        ):
            service.callback = _guarded(service.callback)


def _guarded(callback: Callback) -> Callback:
    def answer(request: Any, response: Any) -> Any:
        try:
            response = callback(request, response)
        except ANY as error:
            response = _refused(request, response, f"{type(error).__name__}: {error}")
        for result in _results(response):
            result.reason = one_line(result.reason)
        return response

    answer.guarded = callback  # type: ignore[attr-defined]
    return answer


def _refused(request: Any, response: Any, reason: str) -> Any:
    refusal = SetParametersResult(successful=False, reason=reason)
    if isinstance(
        request, SetParameters.Request
    ):  # those before the one that raised have their results
        missing = len(request.parameters) - len(response.results)
        response.results = [*response.results, *[refusal] * missing]
    elif isinstance(request, SetParametersAtomically.Request):
        response.result = refusal
    return response


def _results(response: Any) -> Sequence[Any]:
    if isinstance(response, SetParameters.Response):
        return response.results
    return [response.result] if isinstance(response, SetParametersAtomically.Response) else []
