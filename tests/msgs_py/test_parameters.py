"""A settings class as ROS parameters: a bad change is refused with its reason and nothing
changes.
"""

from __future__ import annotations

from dataclasses import dataclass

import pytest
from rcl_interfaces.msg import Parameter as ParameterMsg
from rcl_interfaces.msg import ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from ir_msgs_py.ros import parameters
from ir_msgs_py.ros.parameters import Parameters, check_names
from ir_values.errors import InvalidValueError
from ir_values.settings import setting


@dataclass(frozen=True)
class Search:
    speed: float = setting(0.5, "Speed of the search.", unit="m/s", minimum=0.0, maximum=2.0)
    samples: int = setting(100, "Samples to draw.", minimum=1)
    method: str = setting("tree", "Which search.", choices=("tree", "grid"))
    weights: tuple[float, ...] = setting((1.0, 2.0), "Weight per joint.", minimum=0.0)
    address: str = setting("127.0.0.1", "Where it listens.", read_only=True)

    def __post_init__(self) -> None:
        if self.method == "grid" and self.samples > 1000:
            raise ValueError(f"samples is {self.samples}: a grid takes at most 1000")


@pytest.fixture
def node(ros_context):
    node = Node("searcher", context=ros_context)
    yield node
    node.destroy_node()


def test_the_defaults_are_those_of_the_class_and_described(node):
    parameters = Parameters(node, Search, prefix="search.")
    assert parameters.value == Search()
    descriptor = node.describe_parameter("search.speed")
    assert descriptor.description == "Speed of the search. [m/s]"
    assert descriptor.floating_point_range[0].to_value == 2.0
    assert node.describe_parameter("search.address").read_only


def test_a_node_may_fix_all_settings_at_the_start(node):
    parameters = Parameters(node, Search, read_only=True)
    assert node.describe_parameter("speed").read_only
    assert not node.set_parameters([Parameter("speed", value=1.5)])[0].successful
    assert parameters.value == Search()


def test_a_good_change_is_taken_and_reported(node):
    changes = []
    parameters = Parameters(node, Search, on_change=changes.append)
    results = node.set_parameters(
        [
            Parameter("speed", value=1.5),
            Parameter("weights", value=[3.0]),
            Parameter("use_sim_time", value=False),
        ]
    )
    assert all(result.successful for result in results)
    assert parameters.value == Search(speed=1.5, weights=(3.0,))
    assert changes[-1] == parameters.value


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("speed", 3.0, "out of range"),
        ("speed", float("nan"), "out of range"),
        ("speed", "fast", "speed is fast: it must be a number"),
        ("speed", True, "it must be a number"),
        ("weights", 1.0, "it must be a list of numbers"),
        ("samples", 0, "out of range"),
        ("method", "luck", 'method is "luck": known are tree, grid'),
        ("weights", [1.0, -2.0], "weights is -2: it must be at least 0"),
        ("address", "0.0.0.0", "read-only"),
    ],
)
def test_a_bad_change_is_refused_with_its_reason_and_nothing_changes(node, name, value, reason):
    parameters = Parameters(node, Search)
    result = node.set_parameters([Parameter(name, value=value)])[0]
    assert not result.successful
    assert reason in result.reason.lower() or reason in result.reason
    assert parameters.value == Search()
    assert node.get_parameter("speed").value == 0.5


def test_integers_are_taken_for_real_numbers(ros_context, node):
    parameters = Parameters(node, Search)
    results = node.set_parameters([Parameter("speed", value=1), Parameter("weights", value=[3, 4])])
    assert all(result.successful for result in results)
    assert parameters.value == Search(speed=1.0, weights=(3.0, 4.0))
    assert isinstance(parameters.value.speed, float)
    given = [Parameter("speed", value=2), Parameter("weights", value=[5])]
    started = Node("started", context=ros_context, parameter_overrides=given)
    assert Parameters(started, Search).value == Search(speed=2.0, weights=(5.0,))
    started.destroy_node()


@pytest.mark.parametrize("words", [["--ros-args", "-p", "sped:=1.0"], []])
def test_a_misspelt_name_is_refused_on_the_command_line_and_warned_of_in_files(ros_context, words):
    given = [Parameter("sped", value=1.0)]
    started = Node("started", context=ros_context, parameter_overrides=given)
    Parameters(started, Search)
    if words:
        with pytest.raises(InvalidValueError, match=r"no parameter 'sped': did you mean speed\?"):
            check_names(started, words)
    else:
        check_names(started, words)
    started.destroy_node()


def test_what_the_class_refuses_as_a_whole_is_refused(node):
    parameters = Parameters(node, Search)
    result = node.set_parameters_atomically(
        [Parameter("method", value="grid"), Parameter("samples", value=5000)]
    )
    assert result.reason == "samples is 5000: a grid takes at most 1000"
    assert parameters.value == Search()


def test_a_change_can_be_refused_for_the_moment(node):
    moving = ["the robot moves: speed can be changed when it stands"]
    parameters = Parameters(
        node, Search, refuse=lambda names: moving[0] if "speed" in names else ""
    )
    assert node.set_parameters([Parameter("speed", value=1.0)])[0].reason == moving[0]
    assert node.set_parameters([Parameter("samples", value=7)])[0].successful
    assert parameters.value == Search(samples=7)


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        ("speed", 9.0, r"speed must be 0 \.\. 2 m/s: .*value: 9"),
        ("method", "luck", 'method is "luck": known are tree, grid'),
        ("samples", "many", "samples: .*type"),
    ],
)
def test_a_node_started_with_a_bad_value_says_so(ros_context, name, value, sentence):
    node = Node("searcher", context=ros_context, parameter_overrides=[Parameter(name, value=value)])
    with pytest.raises(InvalidValueError, match=sentence):
        Parameters(node, Search)
    node.destroy_node()


@pytest.fixture
def ask(ros_context, ros_executor, ros_node, wait_for):
    """Send a request to a node with parameters, as ROS tools do."""
    node = ros_executor.add_node(Node("searcher", context=ros_context))
    ros_executor.run(lambda: Parameters(node, Search))

    def send(kind, name, parameters):
        client = ros_executor.run(lambda: ros_node.create_client(kind, f"/searcher/{name}"))
        wait_for(client.service_is_ready)
        future = ros_executor.run(lambda: client.call_async(kind.Request(parameters=parameters)))
        wait_for(future.done, what=f"{name} answers")
        return future.result()

    return send


SPEED = ParameterMsg(
    name="speed", value=ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=1.5)
)
NO_TYPE = ParameterMsg(name="speed", value=ParameterValue(type=255))


def test_a_value_of_no_type_is_refused_and_what_was_set_before_it_is_said(ask):
    results = ask(SetParameters, "set_parameters", [SPEED, NO_TYPE, SPEED]).results
    assert [each.successful for each in results] == [True, False, False]
    assert "255" in results[1].reason
    result = ask(SetParametersAtomically, "set_parameters_atomically", [SPEED, NO_TYPE]).result
    assert not result.successful
    assert "255" in result.reason


def test_ten_megabytes_are_refused_in_a_sentence(ask):
    text = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value="x" * 10_000_000)
    for name in ("method", "x" * 10_000_000):
        (result,) = ask(
            SetParameters, "set_parameters", [ParameterMsg(name=name, value=text)]
        ).results
        assert not result.successful
        assert len(result.reason) < 5_000


def test_more_parameters_than_a_request_may_have_are_refused_as_one(ask):
    (result,) = ask(SetParameters, "set_parameters", [SPEED] * 20_000).results
    assert not result.successful
    assert result.reason == "more than 500 parameters in one request: nothing of it is done"
    whole = ask(SetParametersAtomically, "set_parameters_atomically", [SPEED] * 501).result
    assert "more than 500 parameters" in whole.reason
    assert all(
        each.successful for each in ask(SetParameters, "set_parameters", [SPEED] * 500).results
    )


def test_what_is_beyond_is_not_even_converted(ask, ros_executor, monkeypatch):
    """rclpy holds the interpreter while it converts: 20,000 parameters kept a stop waiting."""
    seen = []
    entries = parameters._entries
    monkeypatch.setattr(
        parameters, "_entries", lambda request: seen.append(entries(request)) or seen[-1]
    )
    for count in (0, 500, 501, 20_000):
        ask(SetParameters, "set_parameters", [SPEED] * count)
    assert seen == [0, 500, 501, 501]
