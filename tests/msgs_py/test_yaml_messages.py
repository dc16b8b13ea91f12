"""Messages as YAML: the syntax of `ros2 service call` and `ros2 topic echo`."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml

from ir_msgs.msg import PlanOptions, PowerState, Status, TrajectoryReport
from ir_msgs.srv import CheckState, EvaluateTrajectory, PlanTrajectory, SetCell, SetLoad
from ir_msgs_py.ros.messages import (
    interface_type,
    message_from_yaml,
    message_to_yaml,
    owner_of,
    type_name,
)
from ir_values.errors import InvalidValueError, UnknownTypeError

SRV_FOLDER = Path(__file__).parents[2] / "ros_ws/src/ir_msgs/srv"


def test_missing_fields_keep_their_defaults():
    options = message_from_yaml(PlanOptions, "{seed: 7}")
    assert options == PlanOptions(seed=7)
    assert options.safety_distance == 0.02
    assert message_from_yaml(PlanOptions, "") == PlanOptions()
    assert message_from_yaml(PlanOptions, "{}") == PlanOptions()


def test_nested_messages_and_arrays_are_filled():
    request = message_from_yaml(
        PlanTrajectory.Request,
        "{reference: {joint_names: [a, b], points: [{positions: [0, -1.5e0]}, {time_from_start: "
        "{sec: 2}}]}}",
    )
    assert request.reference.joint_names == ["a", "b"]
    assert list(request.reference.points[0].positions) == [0.0, -1.5]
    assert request.reference.points[1].time_from_start.sec == 2


def test_a_scalar_is_taken_by_the_type_of_its_field():
    assert message_from_yaml(
        EvaluateTrajectory.Request, "{trajectory_id: 0123456701234567}"
    ).trajectory_id == ("0123456701234567")
    assert message_from_yaml(SetCell.Request, "{cell_file: no}").cell_file == "no"
    assert message_from_yaml(SetLoad.Request, "{mass: 1e2}").mass == 100.0
    assert message_from_yaml(SetLoad.Request, "{mass: .inf}").mass == float("inf")
    assert message_from_yaml(PlanOptions, "{include_points: yes}").include_points is True


@pytest.mark.parametrize(
    ("message_type", "text", "sentence"),
    [
        (SetLoad.Request, "{weight: 3}", 'unknown field "weight": known are load, mass'),
        (
            SetLoad.Request,
            "{center_of_mass: {q: 1}}",
            'unknown field "center_of_mass.q": known are x, y, z',
        ),
        (SetLoad.Request, "{mass: heavy}", 'mass is "heavy": it must be a double'),
        (SetLoad.Request, "{mass: [1]}", "mass is ['1']: it must be a single value"),
        (SetLoad.Request, "{inertia: 3}", "inertia is '3': it must be a list"),
        (
            SetLoad.Request,
            "{center_of_mass: 3}",
            "center_of_mass is '3': it must be fields, of x, y, z",
        ),
        (SetLoad.Request, "[1, 2]", "the message is ['1', '2']: it must be fields"),
        (SetLoad.Request, "{mass: 1", "the text is not YAML"),
        (PlanOptions, "{seed: -1}", "seed is -1: it must be in 0 .. 18446744073709551615"),
        (PlanOptions, "{seed: 1.5}", 'seed is "1.5": it must be a uint64'),
        (
            PlanOptions,
            "{include_points: maybe}",
            'include_points is "maybe": it must be true or false',
        ),
    ],
)
def test_text_that_is_not_the_message_is_named(message_type, text, sentence):
    with pytest.raises(InvalidValueError, match=re.escape(sentence)):
        message_from_yaml(message_type, text)


def test_a_message_is_written_as_block_yaml_in_the_order_of_its_fields():
    assert message_to_yaml(Status(code=-31, message="too far", source="ir_planner")) == (
        "code: -31\nmessage: too far\nsource: ir_planner\n"
    )
    text = message_to_yaml(PowerState(joint_power=[1.0, 2.0, 3.0]), max_elements=2)
    assert "joint_power:\n- 1.0\n- 2.0\n- '...'\n" in text


def test_what_is_written_can_be_read_back():
    report = TrajectoryReport(
        energy=1234.5678901234567, joint_energy=[1e-300, float("inf")], certified=True
    )
    assert message_from_yaml(TrajectoryReport, message_to_yaml(report)) == report


@pytest.mark.parametrize("path", sorted(SRV_FOLDER.glob("*.srv")), ids=lambda path: path.stem)
def test_the_pasteable_line_of_every_service_is_its_request(path):
    line = path.read_text().splitlines()[0]
    _, name, type_text, text = re.fullmatch(
        r'# ros2 service call ((\S+)) (\S+) "(.*)"', line
    ).groups()
    assert yaml.safe_load(text) is not None
    service = interface_type(type_text, "srv")
    assert service.__name__ == path.stem
    assert name.startswith("/ir_")
    message_from_yaml(service.Request, text)


def test_types_are_found_by_the_names_that_people_type():
    assert interface_type("ir_msgs/srv/CheckState", "srv") is CheckState
    assert interface_type("ir_msgs/CheckState", "srv") is CheckState
    assert type_name(CheckState) == "ir_msgs/srv/CheckState"
    assert owner_of(CheckState.Request(), "Request", "srv") is CheckState
    for name in ("ir_msgs/srv/Nothing", "nowhere/srv/CheckState"):
        with pytest.raises(UnknownTypeError, match="no srv type"):
            interface_type(name, "srv")
    with pytest.raises(UnknownTypeError, match="write package/msg/Name"):
        interface_type("Status", "msg")


@pytest.mark.parametrize(
    ("message_type", "text", "sentence"),
    [
        (PlanOptions, "{seed: 1, seed: 2}", 'field "seed" stands twice, in line 1'),
        (
            SetLoad.Request,
            "mass: 1\nload: a\nmass: 2",
            'field "mass" stands twice, in line 1 and line 3',
        ),
        (
            SetLoad.Request,
            "{center_of_mass: {x: 1, y: 2, x: 1}}",
            'field "x" stands twice, in line 1',
        ),
        (SetLoad.Request, '{mass: 1, "mass": 1}', 'field "mass" stands twice, in line 1'),
    ],
)
def test_a_field_that_stands_twice_is_refused_by_its_name(
    message_type: type, text: str, sentence: str
) -> None:
    with pytest.raises(InvalidValueError) as refused:
        message_from_yaml(message_type, text)
    assert str(refused.value) == sentence


def test_fields_of_one_name_in_several_places_are_several_fields() -> None:
    text = "{reference: {points: [{positions: [1]}, {positions: [2]}]}}"
    assert len(message_from_yaml(PlanTrajectory.Request, text).reference.points) == 2
