"""The call that every .srv file starts with, put to running nodes with the demonstration cell."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message
from std_msgs.msg import String

from ir_msgs.msg import Status
from ir_msgs_py import names
from ir_msgs_py.ros.messages import interface_type, message_from_yaml
from ir_msgs_py.ros.testing import PATIENCE
from ir_recorder.node.recorder import RecorderNode
from ir_recorder.play.node import PlayNode
from ir_recorder.play.playback import PlaySettings
from ir_recorder.reading.mcap_file import RawRecording, read_raw
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.settings import RecorderSettings
from ir_recorder.recording.writer import RecordingWriter
from ir_sim_driver.node import SimDriver

SRV_FOLDER = Path(__file__).parents[2] / "ros_ws" / "src" / "ir_msgs" / "srv"
LINE = re.compile(r'# ros2 service call (\S+) (\S+) "(.*)"')
LONG = ("PlanProgram", "PlanRobots")  # they take as long as all others together
UNKNOWN = "0123456789abcdef"  # the id that examples give
LATER: set[str] = set()  # defined before a node offers it
DRIVER = {
    "cell": "demo",
    "backend": "ideal",
    "wake_port": 0,
    "transitions.stand_on_brakes_minimum_stay": 0.1,
}

# in this order: a pause ends before a bit is set, a recording starts before it stops; code and a
# word of the sentence
EXPECTED: dict[str, tuple[int, str]] = {
    "SetCell": (Status.SUCCESS, ""),
    "GetCell": (Status.SUCCESS, ""),
    "SetEquipment": (Status.SUCCESS, ""),
    "CheckState": (Status.SUCCESS, ""),
    "CheckStates": (Status.SUCCESS, ""),
    "StartRecording": (Status.SUCCESS, "shift.mcap"),
    "ComputeIk": (Status.SUCCESS, ""),
    "PlanRegionalMovement": (Status.SUCCESS, ""),
    "PlanEscape": (Status.SUCCESS, ""),
    "PlanServiceMovement": (Status.SUCCESS, ""),
    "PlanTrajectory": (Status.SUCCESS, ""),
    "PlanCartesianMovement": (Status.SUCCESS, ""),
    "PlanProgram": (Status.SUCCESS, ""),
    "PlanSteadyCycle": (Status.INVALID_GOAL_CONSTRAINTS, "cell demo has no route"),
    "PlanRobots": (Status.SUCCESS, ""),
    "PlanStandby": (Status.SUCCESS, ""),
    "EvaluateTrajectory": (Status.INVALID_OBJECT_NAME, UNKNOWN),
    "GetTrajectory": (Status.INVALID_OBJECT_NAME, UNKNOWN),
    "GetProgram": (Status.INVALID_OBJECT_NAME, UNKNOWN),
    "OptimizeTrajectory": (Status.SUCCESS, ""),
    "ExportProgram": (Status.INVALID_OBJECT_NAME, UNKNOWN),
    "SetLoad": (Status.SUCCESS, "gripper"),
    "QueryModes": (Status.SUCCESS, ""),
    "StartPause": (Status.SUCCESS, "STAND_ON_BRAKES for 60 s"),
    "EndPause": (Status.SUCCESS, ""),
    "Recover": (Status.SUCCESS, "nothing to recover from"),
    "SetPlcInput": (Status.SUCCESS, ""),
    "StopRecording": (Status.SUCCESS, "messages over"),
    "ControlPlayback": (Status.SUCCESS, ""),
}


def example(name: str) -> tuple[str, str, str]:
    """Service, type and request as the first line of a file says."""
    found = LINE.fullmatch((SRV_FOLDER / f"{name}.srv").read_text(encoding="utf-8").splitlines()[0])
    assert found is not None, name
    return found[1], found[2], found[3]


def recorded(path: Path) -> RawRecording:
    """Something to play that nobody listens to."""
    session = RecordingSession(RecordingWriter(path), {}, 0)
    session.open_topic("/played", "std_msgs/msg/String", [])
    for second in range(60):
        session.message("/played", serialize_message(String(data="text")), second * 1_000_000_000)
    return read_raw(session.finish().path)


def test_an_answer_is_expected_of_every_service() -> None:
    assert set(EXPECTED) | LATER == {file.stem for file in SRV_FOLDER.glob("*.srv")}


@pytest.mark.usefixtures("planner_node")
def test_the_examples_are_answered_as_they_should(
    ros_context: Any,
    ros_executor: Any,
    ros_node: Any,
    wait_for: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path)
    overrides = [Parameter(name, value=value) for name, value in DRIVER.items()]
    ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
    ros_executor.add_node(RecorderNode(RecorderSettings(), context=ros_context))
    player = PlayNode(
        recorded(tmp_path / "played.mcap"), PlaySettings(loop=True), context=ros_context
    )
    ros_executor.add_node(player).start()
    wait_for(lambda: ros_node.count_publishers(f"/{names.JOINT_STATES}"), what="joint_states come")

    def offered() -> set[str]:
        return {service for service, _ in ros_node.get_service_names_and_types()}

    asked = {name: wanted for name, wanted in EXPECTED.items() if name not in LONG}
    now = {name: example(name)[0] for name in asked}
    wait_for(lambda: set(now.values()) <= offered(), what="the services are offered")
    wrong = []
    for name, (code, word) in asked.items():
        service, type_text, text = example(name)
        kind = interface_type(type_text, "srv")
        client = ros_executor.run(
            lambda kind=kind, service=service: ros_node.create_client(kind, service)
        )
        wait_for(client.service_is_ready, what=f"{service} is ready")
        request = message_from_yaml(kind.Request, text)
        future = ros_executor.run(lambda client=client, request=request: client.call_async(request))
        wait_for(future.done, what=f"{service} answers")
        status = future.result().status
        if status.code != code or word not in status.message:
            wrong.append(f"{name}: {status.code} {status.message!r} (wanted {code} with {word!r})")
    assert wrong == []
    assert (tmp_path / "out" / "shift.mcap").stat().st_size > 0


@pytest.mark.long
@pytest.mark.parametrize("name", LONG)
def test_the_example_of_a_long_plan_is_answered_as_it_should(call: Any, name: str) -> None:
    service, type_text, text = example(name)
    kind = interface_type(type_text, "srv")
    node, _, own = service.rpartition("/")
    assert node == "/ir_planner"
    request = message_from_yaml(kind.Request, text)
    fields = {field: getattr(request, field) for field in request.get_fields_and_field_types()}
    status = call(kind, own, timeout=PATIENCE, **fields).status
    code, word = EXPECTED[name]
    assert status.code == code
    assert word in status.message
