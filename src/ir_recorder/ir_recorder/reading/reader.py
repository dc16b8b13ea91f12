"""Reads a recording into typed series, without ROS: what is damaged or missing becomes a sentence,
not a refusal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from ir_msgs_py import names
from ir_msgs_py.names import owns_diagnostic, owns_logger
from ir_msgs_py.plc import PlcInputs, PlcOutputs
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.errors import ReadError
from ir_recorder.format import contents
from ir_recorder.reading.bag_file import read_bag_file
from ir_recorder.reading.cdr import (
    Columns,
    TooManyValuesError,
    by_name,
    fitting,
    joint_groups,
    one_robot,
)
from ir_recorder.reading.chunk_limits import ReadLimits
from ir_recorder.reading.mcap_file import RawChannel, RawRecording, chosen_namespace, read_raw
from ir_recorder.reading.messages import (
    contact_sentence,
    decoder_of,
    movement_from,
    savings_from,
    trajectory_from,
)
from ir_recorder.reading.planner_answers import planned_program, with_plans, with_trajectories
from ir_recorder.reading.recording import (
    BitSeries,
    ControllerSeries,
    GoalEnd,
    JointSeries,
    PowerSeries,
    ProgramEvent,
    Recording,
    SavingsEvent,
    TextEvent,
    TopicSummary,
)
from ir_values.arrays import FloatArray, IntArray
from ir_values.errors import IrError, one_line
from ir_values.files import ANYWHERE, FileRoots

# What happens around the robot, as events: the states of machines, and what the robot touches.


def machine_states(messages: Iterable[tuple[float, Any]]) -> Iterator[TextEvent]:
    """The state of each machine; "closed>open" while it changes."""
    for time, message in messages:
        for name, state, ahead in zip(
            message.equipment, message.states, message.next, strict=False
        ):
            yield TextEvent(time, str(name), f"{state}>{ahead}" if ahead else str(state))


def contacts(messages: Iterable[tuple[float, Any]]) -> Iterator[TextEvent]:
    """What was touched, by the body that stands there."""
    for time, message in messages:
        yield TextEvent(time, str(message.pair.body_b), contact_sentence(message))


_T = TypeVar("_T")
_OF_A_RUN = (names.JOINT_STATES, names.POWER_STATE, names.CONTROLLER_STATE, names.PROGRAM_STATE)
_CALLS = f"{names.PLANNER}/{names.CALLS}"
# a message lacks a field, or has another kind of value in it
_NO_SENSE = (AttributeError, TypeError, ValueError, OverflowError, IndexError, IrError)
_LATE = 2_000_000_000  # ns that a message may arrive late: more is another clock
_WARN = 30  # rcl_interfaces/Log
# action_msgs/GoalStatus
_OUTCOMES = {
    1: "accepted",
    2: "executing",
    3: "canceling",
    4: "succeeded",
    5: "canceled",
    6: "aborted",
}
_IN_BITS = tuple(bit.name for bit in fields(PlcInputs) if bit.type == "bool")
_OUT_BITS = tuple(bit.name for bit in fields(PlcOutputs) if bit.type == "bool")


TYPES = {
    names.JOINT_STATES: "sensor_msgs/msg/JointState",
    names.POWER_STATE: "ir_msgs/msg/PowerState",
    names.CONTROLLER_STATE: "ir_msgs/msg/ControllerState",
    names.PLC_INPUTS: "ir_msgs/msg/PlcInputs",
    names.PLC_INPUTS_IN_FORCE: "ir_msgs/msg/PlcInputs",
    names.PLC_OUTPUTS: "ir_msgs/msg/PlcOutputs",
    names.PROGRAM_STATE: "ir_msgs/msg/ProgramState",
    names.PROGRAM_SAVINGS: "ir_msgs/msg/ProgramSavings",
    names.PLANNED_TRAJECTORY: "trajectory_msgs/msg/JointTrajectory",
    names.MACHINE_STATES: "ir_msgs/msg/MachineStates",
    names.CONTACTS: "ir_msgs/msg/Contact",
    names.SIGNALS: "ir_msgs/msg/Signal",
    names.MACHINE_SIGNALS: "ir_msgs/msg/Signal",
    names.ROBOT_DESCRIPTION: "std_msgs/msg/String",
    names.PLANT: "std_msgs/msg/String",
    names.DIAGNOSTICS: "diagnostic_msgs/msg/DiagnosticArray",
    names.ROSOUT: "rcl_interfaces/msg/Log",
    _CALLS: "ir_msgs/msg/RecordedCall",
    **{
        f"{action}/_action/status": "action_msgs/msg/GoalStatusArray"
        for action in (names.PLAN, names.RUN_PROGRAM)
    },
}
"""Types of the topics that are read; anything else on them is named and left out."""
_STAMP = ("header.stamp.sec", "header.stamp.nanosec")
REQUIRED = {
    names.JOINT_STATES: (*_STAMP, "position", "velocity", "effort"),
    names.POWER_STATE: (*_STAMP, "mode", "target_mode", "power", "energy", "joint_power"),
    names.CONTROLLER_STATE: (*_STAMP, "trajectory_id", "path_time", "speed_scaling"),
    names.PLC_INPUTS: ("ab", "hib", "emergency_stop"),
    names.PLC_INPUTS_IN_FORCE: ("ab", "hib", "emergency_stop"),
    names.PLC_OUTPUTS: (*_STAMP, "drives_ready"),
}
"""Fields that every version of a type has: a definition without them is another type's."""


def read_recording(
    path: str | Path,
    roots: FileRoots = ANYWHERE,
    limits: ReadLimits | None = None,
    namespace: str | None = None,
) -> Recording:
    """The recording of one cell in a file below `roots`, read within `limits`.

    namespace: of the cell ("/cell_1"); None: the first one, with a sentence where there are more.
    ReadError when the file is no recording, or holds no cell of that namespace.
    """
    read = read_bag_file if Path(path).suffix.lower() == ".db3" else read_raw
    return _SeriesReader(read(Path(path), roots, limits), namespace).recording()


def _columns_of(channel: RawChannel, rows: Sequence[int]) -> tuple[Columns, RawChannel]:
    """Columns of these messages of a channel."""
    messages = tuple(channel.messages[row] for row in rows)
    channel = replace(channel, messages=messages, log_time=channel.log_time[list(rows)])
    return Columns(messages, channel.type, channel.schema_text), channel


class _SeriesReader:
    def __init__(self, raw: RawRecording, namespace: str | None) -> None:
        self._raw = raw
        self._problems = list(raw.problems)
        times = [channel.log_time for channel in raw.channels if len(channel.log_time)]
        self._start = int(min(t.min() for t in times)) if times else 0
        self._end = int(max(t.max() for t in times)) if times else 0
        self._namespace, others = chosen_namespace(raw, namespace)
        self._problems += [others] if others else []
        self._prefix = f"{self._namespace.rstrip('/')}/"
        self._power_series: PowerSeries | None = None

    def recording(self) -> Recording:
        """All series of the raw channels, with a sentence for what can't be read; a recording
        without a run holds the planned program instead.
        """
        raw = self._raw
        for channel in raw.channels:
            if channel.message_encoding != "cdr" and channel.messages:
                self._problems.append(
                    f"{channel.topic} is {channel.message_encoding}, not cdr: left out"
                )
        self._power_series = self._series(names.POWER_STATE, self._power)
        found = Recording(
            path=raw.path,
            start_ns=self._start,
            duration=(self._end - self._start) * 1e-9,
            topics=tuple(
                TopicSummary(c.topic, c.type, len(c.messages), c.message_encoding)
                for c in raw.channels
            ),
            joints=self._series(names.JOINT_STATES, self._joints),
            power=self._power_series,
            controller=self._series(names.CONTROLLER_STATE, self._controller),
            plc_inputs=self._plc_inputs(),
            plc_outputs=self._series(
                names.PLC_OUTPUTS, self._bits(_OUT_BITS, stamped=True), needed=False
            ),
            events=tuple(self._events()),
            loads=tuple(self._loads()),
            signals=tuple(self._signals()),
            machines=tuple(self._machines()),
            contacts=tuple(self._contacts()),
            warnings=tuple(self._warnings()),
            goals=tuple(self._goals()),
            savings=tuple(self._savings()),
            hardware=self._hardware(),
            cell_yaml=self._attached(contents.CELL),
            urdf=self._attached(contents.URDF) or self._text(names.ROBOT_DESCRIPTION),
            power_yaml=self._attached(contents.POWER),
            plant_yaml=self._text(names.PLANT),
            facts=raw.facts,
            problems=tuple(dict.fromkeys(map(one_line, self._problems))),
        )
        found = with_plans(found, self._channel(_CALLS))
        if found.joints is not None or found.power is not None or found.events:
            return found
        planned, interval, certified = planned_program(self._channel(_CALLS))
        missing = {f"{self._prefix}{name} isn't in the recording" for name in _OF_A_RUN}
        kept = tuple(problem for problem in found.problems if problem not in missing)
        if not planned:
            return found
        return replace(
            found,
            planned=with_trajectories(planned, tuple(self._trajectories())),
            planned_interval=interval,
            planned_certified=certified,
            problems=kept,
        )

    def _channel(self, name: str) -> RawChannel | None:
        """The channel of a topic, where its messages are of the type that the topic has."""
        channel = self._raw.channel(name if name.startswith("/") else self._prefix + name)
        if channel is None or channel.message_encoding != "cdr":
            return None
        wanted = TYPES.get(name, channel.type)
        if channel.type == wanted and channel.schema_encoding == "ros2msg":
            return channel
        what = channel.type if channel.type != wanted else f"{wanted} ({channel.schema_encoding})"
        sentence = f"{channel.topic} is of type {what}, must be {wanted}: left out"
        if sentence not in self._problems:
            self._problems.append(sentence)
        return None

    def _series(
        self, name: str, build: Callable[[Columns, RawChannel], _T], needed: bool = True
    ) -> _T | None:
        channel = self._channel(name)
        if channel is None:
            if needed:
                self._problems.append(f"{self._prefix}{name} isn't in the recording")
            return None
        try:
            required = REQUIRED.get(name) or ()
            columns, channel = self._columns(channel)
            columns.require(*required)
            if name == names.JOINT_STATES:
                columns, channel = self._of_one_robot(columns, channel)
            if set(_STAMP) <= set(required):
                columns, channel = self._by_stamp(columns, channel)
            return build(columns, channel)
        except (ReadError, IrError) as error:
            self._problems.append(f"{channel.topic} can't be read: {error}")
            return None

    def _columns(self, channel: RawChannel) -> tuple[Columns, RawChannel]:
        """The fields of a channel, without a few messages that don't fit its type."""
        try:
            return Columns(channel.messages, channel.type, channel.schema_text), channel
        except ReadError:
            rows = fitting(channel.messages, channel.type, channel.schema_text)
            lost = len(channel.messages) - len(rows)
            if lost >= len(rows):
                raise
            self._problems.append(
                f"{channel.topic}: {lost} of {len(channel.messages)} messages are empty or of "
                f"another type than {channel.type}: left out"
            )
            return _columns_of(channel, rows)

    def _of_one_robot(self, columns: Columns, channel: RawChannel) -> tuple[Columns, RawChannel]:
        """The joint states that name most joints; others on the topic, as a gripper's or empty
        ones, are left out and told.
        """
        groups = joint_groups(columns)
        if len(groups) < 2:
            return columns, channel
        robot = one_robot(groups)
        others = [each for each in groups if each not in robot]
        if not others:
            return columns, channel
        for each in others:
            joints = ", ".join(each)[:200] or "no joint"
            self._problems.append(
                f"{channel.topic}: {len(groups[each])} messages of {joints} are left out"
            )
        rows = np.sort(np.concatenate([groups[each] for each in robot]))
        return _columns_of(channel, rows.tolist())

    def _by_stamp(self, columns: Columns, channel: RawChannel) -> tuple[Columns, RawChannel]:
        """Messages that arrived in another order than they were made in, in that of their stamps;
        a clock that was set back stays as it is.
        """
        stamps = columns.stamps()
        back = np.maximum.accumulate(stamps) - stamps
        if not 0 < back.max(initial=0) <= _LATE:
            return columns, channel
        self._problems.append(
            f"{channel.topic}: {np.count_nonzero(back)} messages arrived after later ones, by at "
            f"most {back.max() * 1e-6:.3g} ms: put into the order of their stamps"
        )
        return _columns_of(channel, np.argsort(stamps, kind="stable").tolist())

    def _seconds(self, stamps: IntArray) -> FloatArray:
        return np.asarray((stamps - self._start) * 1e-9, dtype=np.float64)

    def _plant_time(self, heard: FloatArray) -> FloatArray:
        """Times of the plant [s] at which messages were heard: a plant that a busy machine holds up
        lags behind the recorder's clock, by what the meter's readings do.
        """
        power = self._power_series
        if power is None or not len(power.time):
            return heard
        readings = np.maximum.accumulate(power.heard)
        lag = np.interp(heard, readings, readings - power.time)
        return np.asarray(heard - lag, dtype=np.float64)

    def _joints(self, columns: Columns, channel: RawChannel) -> JointSeries:
        first = next(self._decoded(channel), None)
        if first is None:
            raise ReadError("no message can be decoded")
        joint_names = tuple(map(str, first[1].name))
        n = len(joint_names)
        if columns.lengths("position") != {n}:
            raise ReadError(f"not every message has the {n} positions of the first")
        fields = by_name(columns, joint_names, "position", "velocity", "effort")
        position, velocity, effort = fields
        if not np.isfinite(position).all():
            raise ReadError("a position is not a finite number")
        stamps = columns.stamps()
        return JointSeries(
            joint_names,
            stamps,
            self._seconds(stamps),
            position,
            velocity,
            effort,
        )

    def _power(self, columns: Columns, channel: RawChannel) -> PowerSeries:
        return PowerSeries(
            self._seconds(columns.stamps()),
            columns.integers("mode"),
            columns.integers("target_mode"),
            columns.numbers("power"),
            columns.numbers("energy"),
            columns.numbers("base_power"),
            columns.numbers("bus_voltage"),
            columns.numbers("burnt_power"),
            columns.by_axis("joint_power", len(names.JOINT_NAMES)),
            columns.by_axis("joint_torque", len(names.JOINT_NAMES)),
            columns.numbers("tool_power"),
            columns.numbers("rectifier_loss"),
            columns.by_axis("joint_temperature", len(names.JOINT_NAMES)),
            self._seconds(channel.log_time),
            next((name for name in reversed(columns.texts("plant")) if name), ""),
        )

    def _controller(self, columns: Columns, channel: RawChannel) -> ControllerSeries:
        return ControllerSeries(
            self._seconds(columns.stamps()),
            tuple(columns.texts("trajectory_id")),
            columns.numbers("path_time"),
            columns.numbers("speed_scaling"),
            columns.numbers("tool_deviation"),
            columns.by_axis("error.positions", len(names.JOINT_NAMES)),
        )

    def _bits(
        self, bits: tuple[str, ...], stamped: bool
    ) -> Callable[[Columns, RawChannel], BitSeries]:
        def build(columns: Columns, channel: RawChannel) -> BitSeries:
            times = (
                self._seconds(columns.stamps())
                if stamped
                else self._plant_time(self._seconds(channel.log_time))
            )
            levels = np.stack([columns.integers(bit) for bit in bits], axis=1)
            return BitSeries(times, bits, levels)

        return build

    def _plc_inputs(self) -> BitSeries | None:
        """The levels in force, whoever set them; in a recording without them those sent on the
        topic.
        """
        bits = self._bits(_IN_BITS, stamped=False)
        in_force = self._series(names.PLC_INPUTS_IN_FORCE, bits, needed=False)
        return in_force or self._series(names.PLC_INPUTS, bits, needed=False)

    def _events(self) -> Iterator[ProgramEvent]:
        def of(time: float, message: Any) -> Iterator[ProgramEvent]:
            yield ProgramEvent(
                self._stamp(message.header.stamp),
                str(message.program_id),
                int(message.index),
                int(message.total),
                str(message.event),
                movement_from(message.movement),
                str(message.note),
            )

        return self._values(names.PROGRAM_STATE, of, needed=True)

    def _loads(self) -> Iterator[TextEvent]:
        """The attached load by the driver's diagnostics: key "load"."""

        def of(time: float, message: Any) -> Iterator[TextEvent]:
            for status in message.status:
                if not self._is_of_driver(status.name):
                    continue
                for pair in status.values:
                    if pair.key == "load":
                        yield TextEvent(self._stamp(message.header.stamp), "load", str(pair.value))

        return self._values(names.DIAGNOSTICS, of)

    def _signals(self) -> Iterator[TextEvent]:
        def of(time: float, message: Any) -> Iterator[TextEvent]:
            yield TextEvent(time, str(message.name), "1" if message.value else "0")

        for name in (names.SIGNALS, names.MACHINE_SIGNALS):
            yield from self._values(name, of)

    def _warnings(self) -> Iterator[TextEvent]:
        def of(time: float, message: Any) -> Iterator[TextEvent]:
            if message.level >= _WARN and owns_logger(self._namespace, message.name):
                yield TextEvent(time, str(message.name), str(message.msg))

        yield from self._values(names.ROSOUT, of)
        for contact in self._contacts():
            yield TextEvent(contact.time, names.SIM_DRIVER, contact.text)

    def _contacts(self) -> Iterator[TextEvent]:
        return self._values(names.CONTACTS, lambda time, message: contacts([(time, message)]))

    def _machines(self) -> Iterator[TextEvent]:
        return self._values(
            names.MACHINE_STATES, lambda time, message: machine_states([(time, message)])
        )

    def _trajectories(self) -> Iterator[JointTrajectory]:
        """What a planner published of its movements, in their order."""

        def of(_: float, message: Any) -> Iterator[JointTrajectory]:
            yield trajectory_from(message)

        return self._values(names.PLANNED_TRAJECTORY, of)

    def _savings(self) -> Iterator[SavingsEvent]:
        def of(time: float, message: Any) -> Iterator[SavingsEvent]:
            yield SavingsEvent(time, savings_from(message))

        return self._values(names.PROGRAM_SAVINGS, of)

    def _goals(self) -> Iterator[GoalEnd]:
        """How every goal of planner and runner ended, by the status of their actions."""

        def of(time: float, message: Any) -> Iterator[tuple[bytes, int]]:
            for goal in message.status_list:
                yield bytes(goal.goal_info.goal_id.uuid), int(goal.status)

        for action in (names.PLAN, names.RUN_PROGRAM):
            last = dict(self._values(f"{action}/_action/status", of))
            for status in last.values():
                yield GoalEnd(action, status, _OUTCOMES.get(status, f"status {status}"))

    def _hardware(self) -> str:
        def of(time: float, message: Any) -> Iterator[str]:
            for status in message.status:
                if self._is_of_driver(status.name) and status.hardware_id:
                    yield str(status.hardware_id)

        return next(self._values(names.DIAGNOSTICS, of), "")

    def _is_of_driver(self, name: str) -> bool:
        return names.SIM_DRIVER in name and owns_diagnostic(self._namespace, name)

    def _text(self, name: str) -> str:
        """The first text of a topic."""
        return next(self._values(name, lambda time, message: (str(message.data),)), "")

    def _messages(self, name: str, needed: bool = False) -> Iterator[tuple[float, Any]]:
        channel = self._channel(name)
        if channel is not None:
            yield from self._decoded(channel)
        elif needed:
            self._problems.append(f"{self._prefix}{name} isn't in the recording")

    def _decoded(self, channel: RawChannel) -> Iterator[tuple[float, Any]]:
        """Messages one by one with the plant's time [s] at which they were heard; undecodable ones
        are counted.
        """
        try:
            decode = decoder_of(channel)
        except Exception as error:  # a damaged schema makes the parser raise nearly anything
            self._problems.append(
                f"{channel.topic}: definition of {channel.type} can't be read ({error})"
            )
            return
        failed = 0
        times = self._plant_time(self._seconds(channel.log_time))
        for time, data in zip(times.tolist(), channel.messages, strict=True):
            try:
                message = decode(data) if decode else None
            except TooManyValuesError as error:
                self._problems.append(f"{channel.topic}: the rest is left out, {error}")
                break
            except Exception:  # damaged bytes: the decoder raises nearly anything
                message = None
            if message is None:
                failed += 1
            else:
                yield time, message
        if failed:
            self._problems.append(
                f"{channel.topic}: {failed} of {len(channel.messages)} messages can't be decoded"
            )

    def _values(
        self, name: str, convert: Callable[[float, Any], Iterable[_T]], needed: bool = False
    ) -> Iterator[_T]:
        """Values of a topic's messages; those that lack a field or make no sense are counted and
        named.
        """
        failed = 0
        why = ""
        for time, message in self._messages(name, needed):
            try:
                yield from tuple(convert(time, message))
            except _NO_SENSE as error:
                failed += 1
                why = why or f"at {time:.2f} s: {error}"
        if failed:
            self._problems.append(f"{name}: {failed} messages make no sense, the first {why}")

    def _stamp(self, stamp: Any) -> float:
        return float((stamp.sec * 1_000_000_000 + stamp.nanosec - self._start) * 1e-9)

    def _attached(self, name: str) -> str:
        own = self._raw.attachment(contents.attached(self._namespace, name))
        data = self._raw.attachment(name) if own is None else own
        return data.decode(errors="replace") if data is not None else ""
