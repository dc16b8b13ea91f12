"""Searches and savings are of the program that was driven, not of the last that was planned."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap_ros2._dynamic import serialize_dynamic
from rclpy.serialization import deserialize_message, serialize_message

from ir_msgs.action import Plan
from ir_msgs.msg import (
    PlannedMovement,
    ProgramPoint,
    ProgramSavings,
    ProgramState,
    RecordedCall,
)
from ir_msgs_py.ros.search_conversions import searches_to_msg
from ir_msgs_py.search_log import ConfigurationLog, CorrectionLog, SearchLog
from ir_recorder import read_recording
from ir_recorder.format.qos import QosOffer
from ir_recorder.format.schemas import SchemaLibrary
from ir_recorder.reading import planner_answers
from ir_recorder.reading.cdr import Columns
from ir_recorder.reading.planner_answers import ACTION, completed, result_definition
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingWriter

CALLS = "/ir_planner/calls"
STATES = "/ir_program_runner/program_state"
SAVINGS = "/ir_planner/savings"
STATE = "ir_msgs/msg/ProgramState"
SAVED = "ir_msgs/msg/ProgramSavings"
ROWS = np.array([[1.0, 0.0, 1.0], [1.0, 1.0, 1.0]])


@dataclass(frozen=True)
class Planned:
    """An answer: a program, its trajectories, others that came with it."""

    program: str
    moves: tuple[str, ...] = ()
    front: tuple[str, ...] = ()

    def result(self) -> bytes:
        """The answer with logs that carry the program's name."""
        answer = Plan.Result(program_id=self.program)
        answer.status.message = "a text that names point-of-a and t1"
        answer.savings.program_id = f"saved by {self.program}"
        answer.movements = [
            PlannedMovement(kind="regional", trajectory_id=each) for each in self.moves
        ]
        answer.front = [
            ProgramPoint(cycle_time=9.0, energy=9.0, program_id=each) for each in self.front
        ]
        driven = CorrectionLog(
            *("a", self.program, 1, ((1.0,),), (1.0, 1.0)), *(ROWS, (), ROWS), met="", driven=ROWS
        )
        logs: tuple[SearchLog, ...] = (ConfigurationLog(self.program, 1, 1, 1, (), ()), driven)
        answer.searches = searches_to_msg(logs)
        return bytes(serialize_message(answer))


def record(path: Path, plans: list[Planned], driven: list[tuple[str, str]]) -> Path:
    """Plans, then steps (program, trajectory) that started."""
    session = RecordingSession(RecordingWriter(path), {}, 1)
    session.open_topic(CALLS, "ir_msgs/msg/RecordedCall", [QosOffer()])
    session.open_topic(STATES, STATE, [QosOffer()])
    session.open_topic(SAVINGS, SAVED, [QosOffer()])
    encode, saved = (
        serialize_dynamic(kind, SchemaLibrary().schema(kind).text)[kind] for kind in (STATE, SAVED)
    )
    for k, plan in enumerate(plans):
        call = RecordedCall(node="/ir_planner", service="plan", type=ACTION)
        call.response = plan.result()
        session.message(CALLS, serialize_message(call), k + 1)
        savings = ProgramSavings(available=True, program_id=f"saved by {plan.program}")
        session.message(SAVINGS, saved(savings), k + 1)
    for k, (program, trajectory) in enumerate(driven):
        step = PlannedMovement(kind="regional", trajectory_id=trajectory)
        state = ProgramState(
            program_id=program, index=k, total=len(driven), event="started", movement=step
        )
        session.message(STATES, encode(state), len(plans) + k + 1)
    return session.finish().path


PLANS = [
    Planned("program-a", ("t1", "t2"), ("point-of-a",)),
    Planned("program-b", ("t2", "t3")),
    Planned("program-c", ("t4",)),
]


@pytest.mark.parametrize(
    ("driven", "shown"),
    [
        ([], ["program-c"]),  # the last that was planned
        ([("program-a", "t1"), ("program-a", "t2")], ["program-a"]),
        (
            [("program-b", "t2"), ("program-a", "t1"), ("program-b", "t2")],
            ["program-b", "program-a"],
        ),
        ([("elsewhere", "t9")], []),  # planned before the recording
        ([("", "t2"), ("", "t3")], ["program-b"]),  # steps that a client handed over
        ([("", "")], []),  # a pause that a client handed over
        ([("point-of-a", "t7")], ["program-a"]),  # a point of the front
    ],
)
def test_searches_are_those_of_the_programs_that_were_driven(
    driven: list[tuple[str, str]], shown: list[str], tmp_path: Path
) -> None:
    searches = read_recording(record(tmp_path / "a.mcap", PLANS, driven)).searches
    assert [log.station for log in searches if isinstance(log, ConfigurationLog)] == shown
    assert len(searches) == 2 * len(shown)


def test_an_answer_is_read_a_few_times_however_many_programs_were_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read: list[int] = []
    plans = planner_answers._plans

    def counted(recorded: Any, definition: str) -> Any:
        for each in plans(recorded, definition):
            read.append(1)
            yield each

    monkeypatch.setattr(planner_answers, "_plans", counted)
    every = [Planned(f"program-{k}", ("t1",), ("common",)) for k in range(20)]
    driven = [("common", "t1"), *((f"program-{k}", "t1") for k in range(20))]
    many = [*driven, *((f"elsewhere-{k}", "t1") for k in range(200))]
    searches = read_recording(record(tmp_path / "a.mcap", every, many)).searches
    assert len(searches) == 2 * len(driven)
    assert len(read) <= 2 * len(driven)


@pytest.mark.parametrize(
    ("driven", "saved"),
    [
        ([], ["program-c"]),
        ([("program-a", "t1")], ["program-a"]),
        (
            [("saved by program-b", "t3")],
            ["program-b"],
        ),  # what was planned in the common program's time
        ([("elsewhere", "t9")], ["program-a", "program-b", "program-c"]),  # nobody knows
    ],
)
def test_savings_are_those_of_the_programs_that_were_driven(
    driven: list[tuple[str, str]], saved: list[str], tmp_path: Path
) -> None:
    savings = read_recording(record(tmp_path / "a.mcap", PLANS, driven)).savings
    assert [event.savings.program_id for event in savings] == [f"saved by {name}" for name in saved]


@pytest.mark.parametrize(("program", "points"), [("program-a", 2), ("point-of-a", 0)])
def test_a_movement_of_another_program_is_not_shown_as_driven(
    program: str, points: int, tmp_path: Path
) -> None:
    searches = read_recording(record(tmp_path / "a.mcap", PLANS, [(program, "t1")])).searches
    (correction,) = [log for log in searches if isinstance(log, CorrectionLog)]
    assert len(correction.driven) == points


def test_an_answer_of_an_earlier_version_is_completed() -> None:
    data = PLANS[0].result()
    end = Columns([data], "ir_msgs/msg/Plan_Result", result_definition()).ends()[0]
    earlier = data[:end] + b"\xab" * 24  # what a middleware leaves behind the last field
    answer = deserialize_message(completed(earlier, ACTION), Plan.Result)
    assert [each.trajectory_id for each in answer.movements] == ["t1", "t2"]
    assert len(answer.searches.corrections) == 0
