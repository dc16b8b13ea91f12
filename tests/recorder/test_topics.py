"""The topics of the cell are chosen, in any namespace."""

from __future__ import annotations

import pytest

from ir_recorder.errors import RecorderError
from ir_recorder.recording.cell_topics import TopicSelection, checked_topics, single_type


def test_the_cells_topics_are_chosen_and_strangers_are_not() -> None:
    cell = TopicSelection()
    for topic in (
        "/joint_states",
        "/robot_description",
        "/rosout",
        "/diagnostics",
        "/ir_planner/markers",
    ):
        assert topic in cell
    assert "/ir_sim_driver/execute_trajectory/_action/status" in cell
    for topic in (
        "/camera/image",
        "/ir_planner_2/markers",
        "/ir_sim_driver/x/_action/feedback",
        "/_hidden",
    ):
        assert topic not in cell


def test_a_namespace_moves_the_selection() -> None:
    cell = TopicSelection(namespace="/cell_1")
    assert "/cell_1/joint_states" in cell
    assert "/joint_states" not in cell
    assert "/diagnostics" in cell
    assert "/cell_1/other" in TopicSelection(("other",), "/cell_1")


def test_topics_of_several_types_are_passed_over() -> None:
    assert single_type("/a", ["std_msgs/msg/String"]) == "std_msgs/msg/String"
    assert single_type("/a", ["std_msgs/msg/String", "std_msgs/msg/Bool"]) is None


@pytest.mark.parametrize(
    ("topics", "sentence"),
    [
        (["/t"] * 1001, "1001 names or patterns of topics: at most 1000"),
        (["/" + "t" * 255], "at most 255 characters"),
        (["/a\x1b[31m"], "without control characters"),
    ],
)
def test_topics_that_cannot_be_ones_are_refused(topics: list[str], sentence: str) -> None:
    with pytest.raises(RecorderError, match=sentence):
        checked_topics(topics)


def test_empty_names_of_topics_count_as_nothing() -> None:
    assert checked_topics(["", "/a", ""]) == ("/a",)
