"""The node `ir_live`: hears a cell's nodes; browsers on this machine watch it and set the PLC's
bits.

It looks at the newest of every topic 20 times a second and is woken by none: the cell's nodes never
wait for it, and of a flood the middleware keeps the end.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import UInt64
from trajectory_msgs.msg import JointTrajectory

from ir_msgs.msg import (
    CarriedLoad,
    CellState,
    Contact,
    ControllerState,
    MachineStates,
    PlcInputs,
    PlcOutputs,
    PowerState,
    ProgramState,
)
from ir_msgs.srv import GetTrajectory, SetPlcInput
from ir_msgs_py import names, plc
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.ros.conversions import status_from_msg, trajectory_from_msg
from ir_msgs_py.ros.diagnostics import OK, Condition, Diagnostics
from ir_msgs_py.ros.topics import PolledTopic
from ir_recorder.analysis.checks import Tolerances
from ir_recorder.analysis.steps import STARTED, step_label
from ir_recorder.live.cell_view import CellView, ReceivedCell
from ir_recorder.live.server import Commands, LevelCommand, LiveServer
from ir_recorder.live.stream import Stream, levels, machines, number, power_values, states_of, text
from ir_recorder.reading.messages import contact_sentence, movement_from
from ir_recorder.report.series import Json
from ir_values.errors import IrError

PERIOD = 0.05  # s: a person sees no more pictures a second
STALE = 1.0  # s: a meter that says nothing for so long isn't there; it speaks 100 times a second
LOOK_PERIOD = 0.1  # s: between two looks at the nearest pair
_GRAPH_PERIOD = 1.0  # s
_NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
_READINGS = QoSProfile(depth=20, reliability=ReliabilityPolicy.BEST_EFFORT)
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_EVENTS = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_CONTACTS = QoSProfile(depth=100)
_TOPICS: dict[str, tuple[Any, QoSProfile]] = {
    names.JOINT_STATES: (JointState, _NEWEST),
    names.POWER_STATE: (PowerState, _READINGS),
    names.CONTROLLER_STATE: (ControllerState, _NEWEST),
    names.PLC_INPUTS_IN_FORCE: (PlcInputs, _LATCHED),
    names.PLC_OUTPUTS: (PlcOutputs, _LATCHED),
    names.STOP_NUMBER: (UInt64, _LATCHED),
    names.CARRIED_LOAD: (CarriedLoad, _LATCHED),
    names.MACHINE_STATES: (MachineStates, _LATCHED),
    names.CELL: (CellState, _LATCHED),
    names.PLANNED_TRAJECTORY: (JointTrajectory, _LATCHED),
    names.PROGRAM_STATE: (ProgramState, _EVENTS),
    names.CONTACTS: (Contact, _CONTACTS),
}


class LiveNode(Node):
    """Fills a stream with what a cell's nodes say, and serves it. port 0: a free one."""

    def __init__(self, port: int = 0, **options: Any) -> None:
        super().__init__(names.LIVE, **options)
        self._topics = {
            name: PolledTopic(self, kind, name, qos) for name, (kind, qos) in _TOPICS.items()
        }
        self._stream = Stream()
        self._commands = Commands()
        self._view = CellView()
        self._worker = ThreadPoolExecutor(1, "cell")
        self._looking: Future[dict[str, Json]] | None = None
        self._looked = -math.inf
        self._powered = -math.inf
        self._heard = ReceivedCell()
        self._ended = list[PlannedMovement | None]()
        self._driven = ""
        self._contacts = 0
        self._set_bit = self.create_client(SetPlcInput, names.SET_PLC_INPUT)
        self._get_trajectory = self.create_client(GetTrajectory, names.GET_TRAJECTORY)
        self.server = LiveServer(self._stream, self._commands.press, lambda: self._view.scene, port)
        self._diagnostics = Diagnostics(self)
        self._stream.add({"heard": {}, "bound": Tolerances().safety_distance})
        self.create_timer(PERIOD, self._tick)
        self.create_timer(_GRAPH_PERIOD, self._look_around)

    def destroy_node(self) -> None:
        """Close the server, then the node."""
        self.server.close()
        self._worker.shutdown(wait=False, cancel_futures=True)
        super().destroy_node()

    def _tick(self) -> None:
        """Take what has arrived since the last tick, the newest of each topic, and pass it on to
        the page. Power that is overdue is shown as unknown.
        """
        for command in self._commands.take():
            self._ask(command)
        values: dict[str, Json] = {}
        for topic, take in (
            (names.POWER_STATE, self._power),
            (names.JOINT_STATES, self._joints),
            (names.CONTROLLER_STATE, self._controller),
            (names.PLC_INPUTS_IN_FORCE, lambda m: {"in": levels(m[-1], plc.PlcInputs)}),
            (names.PLC_OUTPUTS, lambda m: {"out": levels(m[-1], plc.PlcOutputs)}),
            (names.STOP_NUMBER, lambda m: {"stop": str(m[-1].data)}),
            (names.CARRIED_LOAD, self._load),
            (names.MACHINE_STATES, self._machines),
            (names.CELL, self._cell),
            (names.PLANNED_TRAJECTORY, self._plan),
            (names.PROGRAM_STATE, self._steps),
            (names.CONTACTS, self._touched),
        ):
            messages = self._topics[topic].take()
            if messages:
                values.update(take(messages))
        if "w" not in values and self._now() - self._powered > STALE:
            values.update({"w": None, "q": None, "near": None})
            self._heard = replace(self._heard, q=None)
        values.update(self._looks())
        if values:
            self._stream.add(values, always=("w",) if values.get("w") else ())

    def _looks(self) -> dict[str, Json]:
        """What the worker found, if it is done; it looks again at what is heard by then."""
        found: dict[str, Json] = {}
        if self._looking is not None and self._looking.done():
            looking = self._looking
            self._looking = None
            try:
                found = looking.result()
            except (
                Exception
            ) as error:  # a cell that can be described, and not drawn, must not end the view
                found = {"problem": text(f"the cell can't be drawn: {error!r}")}
            if self._heard.q is None:
                found["near"] = None
        if self._looking is None and self._now() - self._looked >= LOOK_PERIOD:
            self._looked = self._now()
            ended = tuple(self._ended)
            self._ended = []
            self._looking = self._worker.submit(self._view.look, replace(self._heard, ended=ended))
        return found

    def _look_around(self) -> None:
        """Who is there; a record a second at least says to browsers that this node is."""
        heard = {
            "driver": self._now() - self._powered <= STALE,
            "planner": self.count_publishers(names.CELL) > 0,
            "runner": self.count_publishers(names.PROGRAM_STATE) > 0,
        }
        self._stream.add({"heard": heard})
        values = {"port": self.server.port, "connections": self.server.connections}
        self._diagnostics.publish([Condition(self.get_name(), OK, "serving", values)])

    def _power(self, messages: Sequence[Any]) -> dict[str, Json]:
        self._powered = self._now()
        return power_values(messages)

    def _joints(self, messages: Sequence[Any]) -> dict[str, Json]:
        joints = tuple(str(name) for name in messages[-1].name)
        q = np.array(messages[-1].position, dtype=float)
        self._heard = replace(self._heard, joints=joints, q=q)
        ordered = self._view.in_order(joints, q)
        return {} if ordered is None else {"q": [round(float(x), 4) for x in ordered]}

    def _controller(self, messages: Sequence[Any]) -> dict[str, Json]:
        state = messages[-1]
        if state.trajectory_id and state.trajectory_id != self._driven:
            self._driven = state.trajectory_id
            self._fetch(state.trajectory_id)
        scaling = number(state.speed_scaling, 2)
        off = number(state.tool_deviation, 5)
        return {"scaling": scaling, "off": off, "driving": bool(state.trajectory_id)}

    def _load(self, messages: Sequence[Any]) -> dict[str, Json]:
        self._heard = replace(self._heard, load=messages[-1].load)
        return {"load": text(messages[-1].load)}

    def _machines(self, messages: Sequence[Any]) -> dict[str, Json]:
        self._heard = replace(self._heard, states=states_of(messages[-1]))
        return {"machines": machines(messages[-1])}

    def _cell(self, messages: Sequence[Any]) -> dict[str, Json]:
        self._heard = replace(self._heard, cell=messages[-1].cell_yaml)
        return {}

    def _plan(self, messages: Sequence[Any]) -> dict[str, Json]:
        if not self._driven:
            self._take_path(messages[-1])
        return {}

    def _take_path(self, message: Any) -> None:
        try:
            self._heard = replace(self._heard, path=trajectory_from_msg(message))
        except IrError:
            return  # a stranger's: there is no path to show

    def _steps(self, messages: Sequence[Any]) -> dict[str, Json]:
        values: dict[str, Json] = {}
        for message in messages:
            try:
                movement = movement_from(message.movement)
            except IrError:
                continue
            running = message.event == STARTED
            if running and message.index == 0:
                self._ended.append(None)
            if message.event == "ended":
                self._ended.append(movement)
            self._heard = replace(self._heard, movement=movement)
            values["step"] = {
                "label": text(step_label(movement)),
                "kind": "pause" if movement.is_pause else text(movement.kind),
                "event": text(message.event),
                "at": [int(message.index) + 1, int(message.total)],
                "note": text(message.note),
            }
            if movement.report.safety_distance > 0.0:
                values["bound"] = number(movement.report.safety_distance, 5)
        return values

    def _touched(self, messages: Sequence[Any]) -> dict[str, Json]:
        self._contacts += len(messages)
        return {
            "contact": {"number": self._contacts, "words": text(contact_sentence(messages[-1]))}
        }

    def _fetch(self, trajectory_id: str) -> None:
        """Asks the planner for the points behind an id that is driven; unanswered, the old path
        stays.
        """
        if not self._get_trajectory.service_is_ready():
            return
        future = self._get_trajectory.call_async(GetTrajectory.Request(trajectory_id=trajectory_id))

        def take(done: Any) -> None:
            answer = None if done.cancelled() else done.result()
            if answer is not None and trajectory_id == self._driven:
                self._take_path(answer.trajectory)

        future.add_done_callback(take)

    def _ask(self, command: LevelCommand) -> None:
        """Hands a level to the driver, and its answer to who asked."""
        if not self._set_bit.service_is_ready():
            command.answer(False, "no driver is heard")
            return
        if not (command.after_stop or command.presses_the_stop):
            command.answer(False, "the page has not heard of the driver's last stop: ask again")
            return
        request = SetPlcInput.Request(
            name=command.name, value=command.value, after_stop=command.after_stop
        )
        future = self._set_bit.call_async(request)

        def take(done: Any) -> None:
            answer = None if done.cancelled() else done.result()
            if answer is not None:
                status = status_from_msg(answer.status)
                command.answer(status.ok, text(status.message))

        future.add_done_callback(take)

    def _now(self) -> float:
        return time.monotonic()
