"""`ir ros replan`: requests of a recording planned again, and their ids compared.

The planner gets what it had: cell, settings, timers, load and doors as the recording holds them;
start states and drawn seeds are those of the answers.
"""

from __future__ import annotations

import argparse
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any

import numpy as np
import yaml
from rclpy.parameter import parameter_value_to_python
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from ir_cli.output import table
from ir_description.files import power_from_yaml
from ir_msgs.msg import RecordedCall
from ir_msgs_py import names
from ir_msgs_py.ros.conversions import configuration_from_msg
from ir_msgs_py.ros.messages import interface_type
from ir_msgs_py.ros.plan_conversions import machine_states_from_msg
from ir_msgs_py.ros.power_conversions import carried_load_from_msg, controller_timers_from_msg
from ir_msgs_py.status import StatusCode
from ir_planner import Planner, PlannerSettings
from ir_planner.node.inputs import MEASURED, LastState
from ir_planner.node.requests import Requests
from ir_recorder.arguments import add_roots, roots_of
from ir_recorder.errors import ReadError
from ir_recorder.format import contents
from ir_recorder.reading.mcap_file import RawRecording, chosen_namespace, read_raw
from ir_recorder.reading.planner_answers import completed
from ir_recorder.recording.arithmetic import arithmetic
from ir_recorder.recording.cell_files import data_of_cell
from ir_recorder.recording.session import PACKAGES, installed_version
from ir_values.errors import InvalidValueError, IrError
from ir_values.settings import changed, tree

# The recorded planner: cell, settings, changes and requests.

_OWN_PLACE = ("cell", "roots")  # settings of the place where it was recorded, not of planning
_ALWAYS = -1  # ns: what is latched was there before


@dataclass(frozen=True)
class KnownChange:
    """Something that the planner knew from `time` on [ns]: `make` it known to another planner."""

    time: int
    make: Callable[[Planner], None]


@dataclass(frozen=True)
class Call:
    """A request that the planner took at `time` [ns]: the service's name, its type, both as
    messages.

    response is None where it was too long to be recorded.
    """

    time: int
    service: str
    type: str
    request: Any
    response: Any


class RecordedPlanner:
    """The planner of one cell in a recording. namespace: of the cell; None: the first."""

    def __init__(self, raw: RawRecording, namespace: str | None = None) -> None:
        self._raw = raw
        self._prefix = chosen_namespace(raw, namespace)[0].rstrip("/") + "/"
        self._cells = list(self._heard(names.CELL))
        first = str(self._cells[0][1].cell_yaml) if self._cells else ""
        self.cell_yaml = first or (raw.attachment(contents.CELL) or b"").decode(errors="replace")

    def planner(self, clock: Callable[[], float]) -> Planner:
        """A planner with the recorded data and settings, and its first cell."""
        if not self.cell_yaml:
            raise ReadError(f"{self._raw.path} holds no cell: nothing can be planned again")
        power = self._raw.attachment(contents.POWER)
        data = power_from_yaml(power.decode(), contents.POWER) if power is not None else None
        planner = Planner(clock=clock, settings=self._settings(), power=data)
        planner.set_cell(text=self.cell_yaml)
        return planner

    def calls(self) -> Iterator[Call]:
        """What the planner was asked, in the order in which it took the requests."""
        taken = [message for _, message in self._heard(f"{names.PLANNER}/{names.CALLS}")]
        for call in sorted(taken, key=lambda call: _nanoseconds(call.header.stamp)):
            kind = interface_type(call.type, "action" if "/action/" in call.type else "srv")
            ask, answer = (
                (kind.Goal, kind.Result)
                if "/action/" in call.type
                else (kind.Request, kind.Response)
            )
            if len(call.request):
                response = _answer(bytes(call.response), answer, call.type)
                request = _decoded(bytes(call.request), ask)
                yield Call(
                    _nanoseconds(call.header.stamp), call.service, call.type, request, response
                )

    def changes(self) -> list[KnownChange]:
        """What the planner learnt meanwhile, in the order of time."""
        found = [
            KnownChange(_nanoseconds(message.header.stamp), _set_cell(message.cell_yaml))
            for _, message in self._cells[1:]
        ]
        for name, learn in (
            (names.CONTROLLER_TIMERS, _hear_timers),
            (names.CARRIED_LOAD, _hear_load),
            (names.MACHINE_STATES, _hear_machines),
        ):
            for number, (time, message) in enumerate(self._heard(name)):
                found.append(KnownChange(time if number else _ALWAYS, learn(message)))
        for time, event in self._heard(names.PARAMETER_EVENTS):
            if event.node == self._prefix + names.PLANNER:
                pairs = (*event.new_parameters, *event.changed_parameters)
                values = {each.name: parameter_value_to_python(each.value) for each in pairs}
                found.append(KnownChange(time, _set_parameters(values)))
        return sorted(found, key=lambda change: change.time)

    def states(self) -> list[tuple[int, Any]]:
        """The robot's states with their times of arrival [ns], still encoded."""
        channel = self._raw.channel(self._prefix + names.JOINT_STATES)
        if channel is None:
            return []
        return list(zip(channel.log_time.tolist(), channel.messages, strict=True))

    def differences(self) -> list[str]:
        """What is other here than where it was recorded: versions, arithmetic, and data of robot
        and controller.
        """
        found = []
        for entry in self._raw.fact(contents.PACKAGES).split(", "):
            name, _, version = entry.partition(" ")
            if name in PACKAGES and version != (here := installed_version(name)):
                found.append(f"{name} {version} there, {here} here")
        numbers = self._raw.fact(contents.ARITHMETIC)
        if numbers not in ("", here := arithmetic()):
            why = "another architecture or compiler, or the NumPy reference"
            found.append(f"arithmetic {numbers} there, {here} here ({why})")
        for name, text in data_of_cell(self.cell_yaml).items():
            recorded = self._raw.attachment(name)
            if recorded is not None and recorded.decode(errors="replace") != text:
                found.append(f"{name} is another than the installed one")
        return found

    def _settings(self) -> PlannerSettings:
        attached = self._raw.attachment(contents.PARAMETERS.format(node=names.PLANNER))
        settings = _with(PlannerSettings(), _parameters(attached or b""))
        text = self._raw.attachment(contents.POWER_PARAMETERS)
        if not settings.power_parameters or text is None:
            return _with(settings, {"power_parameters": ""})
        with NamedTemporaryFile("wb", suffix=".yaml", delete=False) as file:
            file.write(text)
        try:
            settings = _with(settings, {"power_parameters": file.name})
            settings.read()
            return settings
        finally:
            Path(file.name).unlink()

    def _heard(self, name: str) -> Iterator[tuple[int, Any]]:
        channel = self._raw.channel(name if name.startswith("/") else self._prefix + name)
        if channel is None:
            return
        kind = (
            RecordedCall
            if channel.type.endswith("/RecordedCall")
            else interface_type(channel.type, "msg")
        )
        for time, data in zip(channel.log_time.tolist(), channel.messages, strict=True):
            yield time, _decoded(data, kind)


def _decoded(data: bytes, kind: Any) -> Any:
    try:
        return deserialize_message(data, kind)
    except Exception as error:  # damaged bytes: the middleware raises what it likes
        raise ReadError(f"a message of type {kind.__name__} can't be read: {error}") from error


def _answer(data: bytes, kind: Any, name: str) -> Any:
    """An answer, also one of an earlier version; None where it wasn't recorded."""
    if not data:
        return None
    try:
        return _decoded(data, kind)
    except ReadError:
        return _decoded(completed(data, name), kind)


def _parameters(page: bytes) -> dict[str, Any]:
    """Values by name of a file as `--params-file` takes it."""
    try:
        nodes = yaml.safe_load(page) or {}
        return {
            name: value
            for node in nodes.values()
            for name, value in node["ros__parameters"].items()
        }
    except (yaml.YAMLError, AttributeError, KeyError, TypeError, UnicodeDecodeError) as error:
        raise ReadError(f"the planner's parameters can't be read: {error}") from error


def _with(settings: PlannerSettings, values: dict[str, Any]) -> PlannerSettings:
    known = tree(settings)
    own = {
        name: value for name, value in values.items() if name in known and name not in _OWN_PLACE
    }
    plain = {
        name: tuple(value) if isinstance(value, list) else value for name, value in own.items()
    }
    return changed(settings, plain)


def _set_cell(text: str) -> Callable[[Planner], None]:
    def learn(planner: Planner) -> None:
        planner.set_cell(text=text)

    return learn


def _hear_timers(message: Any) -> Callable[[Planner], None]:
    def learn(planner: Planner) -> None:
        planner.heard.timers = controller_timers_from_msg(message)

    return _unless_refused(learn)


def _hear_load(message: Any) -> Callable[[Planner], None]:
    def learn(planner: Planner) -> None:
        planner.heard.load = carried_load_from_msg(message)

    return _unless_refused(learn)


def _hear_machines(message: Any) -> Callable[[Planner], None]:
    def learn(planner: Planner) -> None:
        planner.heard.machines = machine_states_from_msg(message)

    return _unless_refused(learn)


def _set_parameters(values: dict[str, Any]) -> Callable[[Planner], None]:
    def learn(planner: Planner) -> None:
        planner.settings = _with(planner.settings, values)

    return _unless_refused(learn)


def _unless_refused(learn: Callable[[Planner], None]) -> Callable[[Planner], None]:
    """The recorded planner ignored what makes no sense, so this one does."""

    def learn_or_ignore(planner: Planner) -> None:
        try:
            learn(planner)
        except IrError:
            return

    return learn_or_ignore


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


# Requests planned once more.

HANDLERS = {
    "ir_msgs/srv/PlanServiceMovement": "plan_service",
    "ir_msgs/srv/PlanRegionalMovement": "plan_regional",
    "ir_msgs/srv/PlanEscape": "plan_escape",
    "ir_msgs/srv/PlanTrajectory": "plan_trajectory",
    "ir_msgs/srv/OptimizeTrajectory": "optimize_trajectory",
    "ir_msgs/srv/PlanProgram": "plan_program",
    "ir_msgs/action/Plan": "plan_program",
}
"""The planner's handler of each type whose answers have ids."""
IDS = ("trajectory_id", "program_id")
_FREE = 1e-9  # s: the age of a state that is as it was


class ReplayVerdict(StrEnum):
    """What came of a request."""

    EQUAL = "equal"
    DIFFERENT = "different"
    NOT_COMPARED = "not compared"


@dataclass(frozen=True)
class Replanned:
    """One request: its service, how many ids its answer has, what came of it, and why."""

    service: str
    ids: int
    verdict: ReplayVerdict
    sentence: str = ""


def planned_again(recorded: RecordedPlanner) -> Iterator[Replanned]:
    """Every request that plans, in its order, with what the planner knew by then.

    Time stands still: an answer that its ceiling did not cut is not cut here either, however slow
    this is.
    """
    planner = recorded.planner(lambda: 0.0)
    changes = recorded.changes()
    states = recorded.states()
    for call in recorded.calls():
        while changes and changes[0].time <= call.time:
            changes.pop(0).make(planner)
        if call.type in HANDLERS:
            yield _again(planner, call, states)


def _again(planner: Planner, call: Call, states: list[tuple[int, bytes]]) -> Replanned:
    """A recorded call asked again, with its seed and the state at its time: are the ids of the
    answer the same?
    """
    if call.response is None:
        return _not_compared(call, "its answer was too long to be recorded")
    if call.response.status.code == StatusCode.PREEMPTED:
        return _not_compared(call, "it was cancelled")
    if getattr(call.response.info, "truncated", False):
        return _not_compared(call, "its answer was cut by its planning time")
    problems: list[str] = []
    seed = int(call.response.info.seed)
    state = LastState(q=_start(planner, call, states))
    requests = Requests(
        planner=planner,
        last_state=state,
        now=lambda: _FREE,
        draw_seed=lambda: seed,
        log=problems.append,
    )
    answer = type(call.response)()
    requests.guarded(getattr(requests, HANDLERS[call.type]))(call.request, answer)
    before = ids_of(call.response)
    now = ids_of(answer)
    if not _front(call.response):  # a recording of an earlier version has no ids of the front
        now = {key: value for key, value in now.items() if not key.startswith("pareto_ids")}
    if before == now:
        return Replanned(call.service, len(before) - 1, ReplayVerdict.EQUAL)
    other = [key for key in before | now if before.get(key) != now.get(key)]
    key = other[0]
    said = answer.status.message
    sentence = f"{key} was {before.get(key, 'none')}, is {now.get(key, 'none')}"
    sentence += f"; {len(other)} of {len(before | now)} differ" if len(other) > 1 else ""
    return Replanned(
        call.service, len(before) - 1, ReplayVerdict.DIFFERENT, f"{sentence}; {said}".strip("; ")
    )


def ids_of(message: Any) -> dict[str, str]:
    """The status and all ids of an answer by their place: "movements[2].trajectory_id"."""
    found = {"status": str(int(message.status.code))}
    found |= {place: value for place, name, value in _texts(message, "") if name in IDS and value}
    found |= {f"pareto_ids[{k}]": each for k, each in enumerate(_front(message))}
    return found


def _front(message: Any) -> list[str]:
    return list(getattr(message, "pareto_ids", ()))


def _texts(message: Any, place: str) -> Iterator[tuple[str, str, str]]:
    for name in message.get_fields_and_field_types():
        value = getattr(message, name)
        here = f"{place}.{name}".lstrip(".")
        if isinstance(value, str):
            yield here, name, value
        elif hasattr(value, "get_fields_and_field_types"):
            yield from _texts(value, here)
        elif isinstance(value, list) and value and hasattr(value[0], "get_fields_and_field_types"):
            for k, each in enumerate(value):
                yield from _texts(each, f"{here}[{k}]")


def _start(planner: Planner, call: Call, states: list[tuple[int, bytes]]) -> Any:
    """The robot's state as the planner knew it: where the answer names its start, that one, to the
    bit.
    """
    start = np.array(call.response.info.start.position)
    if len(start) and not call.type.endswith("PlanServiceMovement"):  # its start is a candidate's
        return start
    before = bisect_right(states, call.time, key=lambda state: state[0])
    if not before:
        return None
    joints = planner.cell.robot.joint_names
    try:
        q = configuration_from_msg(deserialize_message(states[before - 1][1], JointState), joints)
    except InvalidValueError:
        return None
    return np.round(q, MEASURED) + 0.0


def _not_compared(call: Call, why: str) -> Replanned:
    return Replanned(call.service, 0, ReplayVerdict.NOT_COMPARED, why)


def add_replan(again: argparse.ArgumentParser) -> None:
    """Arguments of `ir ros replan`."""
    again.add_argument("file", help="recording (.mcap)")
    again.add_argument("--namespace", help="of the cell, where the recording holds several")
    add_roots(again)
    again.set_defaults(run=run_replan)


def run_replan(arguments: argparse.Namespace) -> int:
    """Plan again and print; exit code 0 where something was compared and all of it is equal."""
    raw = read_raw(arguments.file, roots_of(arguments.roots))
    for problem in raw.problems:
        sys.stderr.write(f"{arguments.file}: {problem}\n")
    recorded = RecordedPlanner(raw, arguments.namespace)
    found = list(planned_again(recorded))
    rows = [[each.service, str(each.verdict), str(each.ids), each.sentence] for each in found]
    if rows:
        sys.stdout.write(table(["request", "", "ids", "difference"], rows) + "\n")
    sys.stdout.write(sentence_of(found, recorded.differences()) + "\n")
    return 0 if all_equal(found) else 1


def all_equal(found: list[Replanned]) -> bool:
    """Whether something was compared, and nothing differs."""
    return any(each.verdict is ReplayVerdict.EQUAL for each in found) and not any(
        each.verdict is ReplayVerdict.DIFFERENT for each in found
    )


def sentence_of(found: list[Replanned], differences: list[str]) -> str:
    """What came of all requests, and what may explain it."""
    if not found:
        return "the recording holds no request that plans"
    count = {verdict: sum(each.verdict is verdict for each in found) for verdict in ReplayVerdict}
    ids = sum(each.ids for each in found if each.verdict is ReplayVerdict.EQUAL)
    parts = [
        f"{count[ReplayVerdict.EQUAL]} of {len(found)} requests planned again with equal ids "
        f"({ids} ids)"
    ]
    parts += [
        f"{count[kind]} {kind}"
        for kind in (ReplayVerdict.DIFFERENT, ReplayVerdict.NOT_COMPARED)
        if count[kind]
    ]
    if differences:
        parts.append("recorded with another build or other data: " + "; ".join(differences))
    return "; ".join(parts)
