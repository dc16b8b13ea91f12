"""ROS parameters of the recorder node, derived from its settings; all are read once, at the start."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node

from ir_recorder.settings import RecorderSettings

_ABOUT = {
    "path": "file to record into from the start; empty: wait for ~/start",
    "overwrite": "replace an existing file",
    "topics": "names or patterns; empty: all topics of the cell",
    "cell": "name or file of the cell to attach; empty: ask the planner",
    "facts": "key=value texts kept in the file and shown by the report",
    "depth": "messages kept per subscription while the disk is busy",
    "discovery_period": "s between two looks for new topics",
}
_RANGES: dict[str, dict[str, Any]] = {
    "depth": {"integer_range": [IntegerRange(from_value=1, to_value=100_000)]},
    "discovery_period": {"floating_point_range": [FloatingPointRange(from_value=0.01, to_value=60.0)]},
}


def declare_settings(node: Node) -> RecorderSettings:
    """Declares a read-only parameter per field and returns the settings; RecorderError names what is out of
    range.
    """
    values: dict[str, Any] = {}
    for field in fields(RecorderSettings):
        name = field.name
        default: Any = getattr(RecorderSettings(), name)
        is_list = isinstance(default, tuple)
        descriptor = ParameterDescriptor(description=_ABOUT[name], read_only=True, **_RANGES.get(name, {}))
        # an empty list has no type in ROS: one empty text stands for it
        value = node.declare_parameter(name, [""] if is_list else default, descriptor).value
        values[name] = tuple(text for text in value if text) if is_list else value
    return RecorderSettings(**values)
