"""Requests with one field that nobody should send, for every number and text that an interface has.

The fields are found in the definitions: a field that is added tomorrow is tested tomorrow.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any, NamedTuple

from rosidl_parser.definition import (
    AbstractNestedType,
    AbstractString,
    Array,
    BasicType,
    NamespacedType,
)
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ir_msgs.msg import PlannedMovement, PlanOptions
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.ros.messages import interface_type, message_from_yaml

INTERFACES = Path(__file__).parents[2] / "ros_ws" / "src" / "ir_msgs"
LINE = re.compile(r'# ros2 (?:service call|action send_goal) \S+ \S+ "(.*)"')
HOME = [0.0, -math.pi / 2, math.pi / 2, 0.0, 0.0, 0.0]
HUGE = "x" * 10_000_000
NUMBERS = (math.nan, math.inf, -math.inf, 1e308)
TEXTS = ("", HUGE)
_SMALL = {"savings": False, "stations": ["home"], "max_candidates": 1}


class Case(NamedTuple):
    """A value for a field; path: the names that lead to it, through first elements of sequences."""

    path: tuple[str, ...]
    value: Any

    def __str__(self) -> str:
        return f"{'.'.join(self.path)}={str(self.value)[:12]!r}"

    def put_into(self, request: Any) -> Any:
        """A copy of the request with the value in its place."""
        owner = deepcopy(request)
        request = owner
        for name in request.get_fields_and_field_types():
            if (
                name.endswith("_id") and name != self.path[0]
            ):  # what is asked about is in the request itself
                setattr(request, name, "")
        for name in self.path[:-1]:
            owner = _entered(owner, name)
        present = getattr(owner, self.path[-1])
        value = self.value
        if isinstance(_kind_of(owner, self.path[-1]), AbstractNestedType):
            many = 1 if isinstance(value, str) else len(JOINT_NAMES)
            value = [value, *list(present)[1:]] if len(present) else [value] * many
        setattr(owner, self.path[-1], value)
        return request


def cases_of(message: type) -> Iterator[Case]:
    """All cases of a request, goal or message class."""
    for name, kind in zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True):  # type: ignore[attr-defined]
        inner = kind.value_type if isinstance(kind, AbstractNestedType) else kind
        if isinstance(inner, NamespacedType):
            for case in cases_of(_class_of(inner)):
                yield Case((name, *case.path), case.value)
        else:
            yield from (Case((name,), value) for value in _values(inner))


def _values(kind: Any) -> tuple[Any, ...]:
    if isinstance(kind, AbstractString):
        return TEXTS
    assert isinstance(kind, BasicType)
    if kind.typename == "boolean":
        return ()
    if kind.typename in ("double", "float"):
        return NUMBERS
    bits = {"octet": 8, "byte": 8, "char": 8}.get(kind.typename) or int(
        re.sub(r"\D", "", kind.typename)
    )
    signed = kind.typename.startswith("int")
    return (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)


def _kind_of(message: Any, name: str) -> Any:
    names = list(message.get_fields_and_field_types())
    return message.SLOT_TYPES[names.index(name)]


def _class_of(kind: NamespacedType) -> Any:
    return interface_type("/".join(kind.namespaced_name()), kind.namespaces[1])


def _entered(owner: Any, name: str) -> Any:
    """The message in a field, or the first of a sequence, which is made where there is none."""
    kind = _kind_of(owner, name)
    value = getattr(owner, name)
    if not isinstance(kind, AbstractNestedType):
        return value
    if not isinstance(kind, Array) and not len(value):
        value = [filled(_class_of(kind.value_type)())]
        setattr(owner, name, value)
    return value[0]


def example(interface: str, part: Any) -> Any:
    """The request or goal that the file of an interface ("srv/SetCell") begins with, little work to
    plan.
    """
    file = next(INTERFACES.glob(f"{interface}.*"), None)
    line = LINE.match(file.read_text(encoding="utf-8")) if file is not None else None
    return filled(message_from_yaml(part, line[1] if line is not None else ""))


def filled(message: Any) -> Any:
    """The message with its empty states and trajectories at home, and what a plan may take."""
    if isinstance(message, JointState) and not message.position:
        message.name = list(JOINT_NAMES)
        message.position = HOME
    elif isinstance(message, JointTrajectory) and not message.points:
        message.joint_names = list(JOINT_NAMES)
        message.points = [_standing(0.1), _standing(0.2)]
    elif isinstance(message, PlannedMovement):
        message.kind = PlannedMovement.REGIONAL
        filled(message.trajectory)
    elif isinstance(message, PlanOptions):
        message.planning_time = 0.2
        message.max_iterations = 10
    else:
        for name in message.get_fields_and_field_types():
            if hasattr(getattr(message, name), "get_fields_and_field_types"):
                filled(getattr(message, name))
            elif name in _SMALL:
                setattr(message, name, _SMALL[name])
    return message


def _standing(seconds: float) -> JointTrajectoryPoint:
    point = JointTrajectoryPoint(positions=HOME, velocities=[0.0] * 6, accelerations=[0.0] * 6)
    point.time_from_start.nanosec = round(1e9 * seconds)
    return point
