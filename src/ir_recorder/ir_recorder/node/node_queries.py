"""Requests to other nodes for what explains a recording: the planner's cell, all parameters."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import yaml
from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.client import Client
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.task import Future

from ir_description import DescriptionError
from ir_description.library import read_power_parameters
from ir_msgs.srv import GetCell
from ir_msgs_py import names
from ir_msgs_py.status import StatusCode
from ir_recorder.format.contents import PARAMETERS, POWER_PARAMETERS
from ir_recorder.recording.cell_files import CellFiles

PATIENCE = 5
"""Looks, each a second after the other, at a request that nobody has answered."""
ASKED = (names.PLANNER, names.SIM_DRIVER, names.PROGRAM_RUNNER)


class RepeatedRequest:
    """One service call that is repeated until its answer was taken; `each` sends it while nobody
    answers.

    An answer may be lost, as that of a node that had not discovered its client: who has not
    answered for PATIENCE looks is asked again.
    """

    def __init__(self, client: Client, request: Any, take: Callable[[Any], bool]) -> None:
        self._client = client
        self._request = request
        self._take = take
        self._pending: Future | None = None
        self._looks = 0
        self.done = False

    def each(self) -> None:
        """Sends the request where it is still needed and its service is there."""
        if self.done:
            return
        if self._pending is not None and not self._pending.done():
            self._looks += 1
            if self._looks < PATIENCE:
                return
            self._client.remove_pending_request(self._pending)
            self._pending = None
        if self._client.service_is_ready():
            self._looks = 0
            self._pending = self._client.call_async(self._request)
            self._pending.add_done_callback(self._answered)

    def _answered(self, future: Future) -> None:
        answer = None if future.cancelled() else future.result()
        if answer is not None and not self.done:
            self.done = self._take(answer)


class CellRequest:
    """The planner's cell, for a recording that was given none."""

    def __init__(self, node: Node, attach: Callable[[CellFiles], None]) -> None:
        self._client = node.create_client(GetCell, names.GET_CELL)
        self._attach = attach
        self._asked: RepeatedRequest | None = None

    def begin(self) -> None:
        """Forgets the answer of the recording before."""
        self._asked = RepeatedRequest(self._client, GetCell.Request(), self._take)

    def each(self) -> None:
        """Asks once more."""
        if self._asked is not None:
            self._asked.each()

    def _take(self, answer: GetCell.Response) -> bool:
        if answer.status.code != StatusCode.SUCCESS or not answer.cell_yaml:
            return False
        self._attach(CellFiles(answer.cell_yaml, answer.robot_description))
        return True


class ParameterRequests:
    """Parameters of the cell's nodes, as files that `--params-file` takes."""

    def __init__(self, node: Node, attach: Callable[[str, str], None]) -> None:
        self._attach = attach
        self._namespace = node.get_namespace().rstrip("/")
        self._clients = {
            name: (
                node.create_client(ListParameters, f"{name}/list_parameters"),
                node.create_client(GetParameters, f"{name}/get_parameters"),
            )
            for name in ASKED
        }
        self._asked: dict[str, RepeatedRequest] = {}

    def begin(self) -> None:
        """Asks every node anew."""
        for name, (listing, _) in self._clients.items():
            self._asked[name] = RepeatedRequest(
                listing, ListParameters.Request(), self._listed(name)
            )

    def each(self) -> None:
        """Asks those that have not answered yet."""
        for asked in list(self._asked.values()):
            asked.each()

    def _listed(self, name: str) -> Callable[[ListParameters.Response], bool]:
        def take(answer: ListParameters.Response) -> bool:
            known = list(answer.result.names)
            request = GetParameters.Request(names=known)
            self._asked[name] = RepeatedRequest(
                self._clients[name][1], request, self._valued(name, known)
            )
            self._asked[name].each()
            return True

        return take

    def _valued(self, name: str, known: list[str]) -> Callable[[GetParameters.Response], bool]:
        def take(answer: GetParameters.Response) -> bool:
            values = {key: _plain(value) for key, value in zip(known, answer.values, strict=False)}
            self._attach_power_parameters(str(values.get("power_parameters") or ""))
            page = {f"{self._namespace}/{name}": {"ros__parameters": values}}
            self._attach(PARAMETERS.format(node=name), yaml.safe_dump(page, sort_keys=True))
            return True

        return take

    def _attach_power_parameters(self, path: str) -> None:
        """The file of power parameters that a node names, where it can be read here."""
        if not path:
            return
        try:
            self._attach(POWER_PARAMETERS, read_power_parameters(path))
        except (DescriptionError, OSError):
            return  # on another machine: its name is in the parameters


def _plain(value: Any) -> object:
    """A parameter's value as YAML has it; arrays become lists."""
    found = parameter_value_to_python(value)
    return found if isinstance(found, bool | int | float | str) or found is None else list(found)
