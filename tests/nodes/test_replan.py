"""Law: what a recording holds is enough to plan the same again: start states that were known, seeds
that were drawn, parameters and cells that were changed meanwhile.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.parameter import Parameter
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from ir_cli.ros import replan
from ir_cli.ros.replan import (
    RecordedPlanner,
    Replanned,
    ReplayVerdict,
    all_equal,
    planned_again,
    sentence_of,
)
from ir_msgs.msg import PlanOptions, RecordedCall
from ir_msgs.srv import (
    OptimizeTrajectory,
    PlanRegionalMovement,
    PlanServiceMovement,
    SetEquipment,
)
from ir_msgs_py import names
from ir_planner.node.node import PlannerNode
from ir_recorder.node.recorder import RecorderNode
from ir_recorder.reading.mcap_file import RawRecording, read_raw
from ir_recorder.recording import RecordingSession, RecordingWriter
from ir_recorder.recording.arithmetic import arithmetic
from ir_recorder.recording.settings import RecorderSettings

STATE = np.array([0.3, -1.4, 1.5, 0.1, 0.4, -0.2]) + 1e-4 / 3.0


@pytest.fixture
def recording(
    planner_node: PlannerNode, ros_context: Any, ros_executor: Any, ros_node: Any, wait_for: Any,
    call: Any, tmp_path: Path,
) -> RawRecording:  # fmt: skip
    """Requests of all kinds, while the cell and a parameter change."""
    settings = RecorderSettings(discovery_period=0.01, roots=(str(tmp_path),))
    recorder = ros_executor.add_node(RecorderNode(settings, context=ros_context))
    ros_executor.run(lambda: recorder.start(str(tmp_path / "a.mcap")))
    states = ros_executor.run(lambda: ros_node.create_publisher(JointState, names.JOINT_STATES, 10))
    cell = planner_node.planner.cell
    patient = [Parameter("state_max_age", Parameter.Type.DOUBLE, 600.0)]  # a busy machine
    ros_executor.run(lambda: planner_node.set_parameters(patient))
    calls = f"/{names.PLANNER}/{names.CALLS}"
    wait_for(lambda: recorder.cell_attached, what="the cell is attached")
    wait_for(
        lambda: recorder.attached("ir_planner.parameters.yaml"), what="the parameters are attached"
    )
    wait_for(lambda: ros_node.count_subscribers(calls), what="the recorder listens to the calls")
    wait_for(
        lambda: ros_node.count_subscribers(names.JOINT_STATES) >= 2, what="both listen to the robot"
    )
    joints = list(cell.robot.joint_names)
    message = JointState(name=joints, position=STATE.tolist(), velocity=[0.0] * 6)

    def standing() -> bool:
        states.publish(message)
        planner_node._look()
        return planner_node._last_state.q is not None

    wait_for(standing, what="the planner knows where the robot is")
    drawn = PlanOptions(random_seed=True)
    moved = call(PlanRegionalMovement, "plan_regional_movement", goal="home", options=drawn)
    assert moved.status.code == 1, moved.status.message
    call(OptimizeTrajectory, "optimize_trajectory", trajectory_id=moved.trajectory_id)
    machine = cell.equipment[0]
    call(SetEquipment, "set_equipment", name=machine.name, enabled=False, state=machine.state or "")
    ros_executor.run(
        lambda: planner_node.set_parameters(
            [Parameter("torque_reserve", Parameter.Type.DOUBLE, 0.2)]
        )
    )
    wait_for(standing, what="the robot stands still")
    call(PlanRegionalMovement, "plan_regional_movement", goal="park", options=drawn)
    station = cell.stations[-1].name
    call(
        PlanServiceMovement,
        "plan_service_movement",
        station=station,
        direction="exit",
        max_candidates=1,
    )

    def arrived() -> int:
        channel = read_raw(tmp_path / "a.mcap").channel(calls)
        kinds = (
            [deserialize_message(m, RecordedCall).type for m in channel.messages] if channel else []
        )
        return sum("Plan" in kind or "Optimize" in kind for kind in kinds)

    wait_for(lambda: arrived() == 4, what="all calls are in the file")
    ros_executor.run(recorder.finish)
    return read_raw(tmp_path / "a.mcap")


@pytest.mark.long
def test_all_requests_are_planned_again_with_equal_ids_and_a_difference_is_named(
    recording: RawRecording,
) -> None:
    found = list(planned_again(RecordedPlanner(recording)))
    assert [each.sentence for each in found] == [""] * 4
    assert all_equal(found)
    assert all(each.ids >= 1 for each in found)
    assert "4 of 4 requests planned again with equal ids" in sentence_of(found, [])

    other = next(
        planned_again(RecordedPlanner(with_answers(recording, trajectory_id="0123456789abcdef")))
    )
    assert other.verdict is ReplayVerdict.DIFFERENT
    assert other.sentence.startswith("trajectory_id was 0123456789abcdef, is ")
    assert not all_equal([other, *found[1:]])


def with_answers(recording: RawRecording, trajectory_id: str) -> RawRecording:
    """The recording where the first movement's answer has another id."""

    def other(data: bytes) -> bytes:
        call = deserialize_message(data, RecordedCall)
        if call.type != "ir_msgs/srv/PlanRegionalMovement":
            return data
        response = deserialize_message(bytes(call.response), PlanRegionalMovement.Response)
        response.trajectory_id = trajectory_id
        call.response = serialize_message(response)
        return bytes(serialize_message(call))

    channels = tuple(
        replace(channel, messages=tuple(map(other, channel.messages)))
        if channel.type == "ir_msgs/msg/RecordedCall"
        else channel
        for channel in recording.channels
    )
    return replace(recording, channels=channels)


def test_answers_that_cannot_be_the_same_are_not_compared() -> None:
    found = [Replanned("/ir_planner/plan", 0, ReplayVerdict.NOT_COMPARED, "it was cancelled")]
    assert not all_equal(found)
    assert "1 not compared" in sentence_of(found, [])
    assert sentence_of(found, ["numpy 1.0 there, 2.0 here"]).endswith("numpy 1.0 there, 2.0 here")


def test_a_recording_of_another_arithmetic_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = RecordingSession(RecordingWriter(tmp_path / "a.mcap"), {}, 5)
    raw = read_raw(session.finish().path)
    assert RecordedPlanner(raw).differences() == []
    monkeypatch.setattr(replan, "arithmetic", lambda: "abacus")
    (difference,) = RecordedPlanner(raw).differences()
    assert difference.startswith(f"arithmetic {arithmetic()} there, abacus here")
