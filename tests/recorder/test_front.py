"""The front that a planner answered with is read from the recorded answer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rclpy.serialization import serialize_message

from ir_msgs.action import Plan
from ir_msgs.msg import PlannedMovement, ProgramPoint, RecordedCall
from ir_recorder.format.qos import QosOffer
from ir_recorder.reading.planner_answers import ACTION, recorded_front
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingWriter

POINTS = ((31.5, 41_000.0, "a"), (35.25, 39_500.0, "b"), (40.0, 39_100.0, "c"))


def record(path: Path, answers: list[bytes], kind: str = ACTION) -> Path:
    session = RecordingSession(RecordingWriter(path), {}, 1)
    session.open_topic("/ir_planner/calls", "ir_msgs/msg/RecordedCall", [QosOffer()])
    for k, answer in enumerate(answers):
        call = RecordedCall(node="/ir_planner", service="plan", type=kind)
        call.response = answer
        session.message("/ir_planner/calls", serialize_message(call), k + 1)
    return session.finish().path


def result(points: tuple[tuple[float, float, str], ...] = POINTS) -> bytes:
    answer = Plan.Result(program_id="0123", gap=1.5)
    movement = PlannedMovement(kind="regional", from_station="home", to_station="lathe")
    movement.report.joint_energy = np.arange(6.0)
    answer.movements = [movement, PlannedMovement(kind="pause")]
    answer.front = [ProgramPoint(cycle_time=t, energy=e, program_id=name) for t, e, name in points]
    return bytes(serialize_message(answer))


def test_the_points_are_those_of_the_answer(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mcap", [result(), result(())])
    found = recorded_front(path)
    assert [(p.cycle_time, p.energy, p.program_id) for p in found] == list(POINTS)


@pytest.mark.parametrize("answer", [b"", b"\0\1\0\0", result()[:200], b"\0\1\0\0" + b"\xff" * 400])
def test_an_answer_that_makes_no_sense_has_no_front(tmp_path: Path, answer: bytes) -> None:
    assert recorded_front(record(tmp_path / "a.mcap", [answer])) == ()


def test_an_answer_of_another_type_has_no_front(tmp_path: Path) -> None:
    assert recorded_front(record(tmp_path / "a.mcap", [result()], "os/action/System")) == ()
