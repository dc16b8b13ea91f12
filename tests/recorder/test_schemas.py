"""Definitions of message types are complete, or refused by name."""

from __future__ import annotations

import pytest

from ir_recorder.errors import SchemaError
from ir_recorder.format.schemas import SchemaLibrary, definitions_of


def test_a_schema_holds_all_types_a_message_is_built_from() -> None:
    schema = SchemaLibrary().schema("ir_msgs/msg/ProgramState")
    definitions = definitions_of(schema.name, schema.text)
    used = {f.type for fields in definitions.values() for f in fields if not f.primitive}
    assert used <= set(definitions)
    assert "trajectory_msgs/JointTrajectoryPoint" in used


@pytest.mark.parametrize(
    "name", ["nothing_msgs/msg/Nothing", "ir_msgs/action/Plan_FeedbackMessage", "JointState"]
)
def test_types_that_cannot_be_recorded_are_named(name: str) -> None:
    with pytest.raises(SchemaError, match=r"no definition|not a message type"):
        SchemaLibrary().schema(name)
