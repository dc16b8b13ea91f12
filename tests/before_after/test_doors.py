"""Doors of today's program: as recorded, or assumed as the cell has them, which is said."""

from __future__ import annotations

import numpy as np
import pytest

from ir_cli.trace_programs import RecordedDoors
from ir_description import ProgramStep, load_cell
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.plc import Signal
from ir_planner import Planner, PlanOptions, parse_goal
from ir_planner.before_after import Today, TodayMotion
from ir_planner.before_after.today_steps import (
    AskedProgram,
    StepToday,
    asked_program,
    assumed_doors,
    costed_steps,
    doors_at_the_start,
)
from ir_planner.program import Doors, ProgramRequest
from ir_recorder.reading.recording import TextEvent

CELL = load_cell("demo")
SHUT: Doors = (("lathe", ("door_closed",)),)
MOVES: Doors = (("lathe", ("door_open", "door_closed")),)


def test_doors_of_a_recording_are_those_heard_before_and_all_that_came_meanwhile() -> None:
    heard = [(0.1, "door_open"), (5.0, "door_open>door_closed"), (6.5, "door_closed")]
    events = [TextEvent(t, "lathe", text) for t, text in heard]
    doors = RecordedDoors(CELL, [*events, TextEvent(0.1, "gauge", "")], start=1.0)
    spans = [(-1.0, 0.0), (0.0, 4.0), (3.9, 4.1), (4.5, 5.0), (5.0, 5.6), (5.5, 9.0)]
    assert [doors.during(*span) for span in spans] == [(), (), MOVES, MOVES, MOVES, SHUT]
    assert RecordedDoors(CELL, [], 0.0).during(0.0, 1.0) is None


def today(*doors: Doors | None) -> tuple[Today, AskedProgram]:
    planner = Planner("demo", clock=lambda: 0.0)
    plan = planner.plan_regional(start=CELL.machine_home, goal=parse_goal("lathe_work", CELL))
    assert plan.trajectory is not None
    into = plan.trajectory
    end = np.asarray(plan.trajectory.positions[-1])
    stretches = tuple(
        TodayMotion(into, end, into.duration, works=True, doors=each) for each in doors
    )
    known = Today("t", "trace", np.asarray(CELL.machine_home), stretches)
    return known, asked_program(known, planner.scene(NO_LOAD))


def test_todays_movements_are_judged_with_the_doors_as_recorded() -> None:
    known, asked = today((), SHUT, MOVES)
    planner = Planner("demo", clock=lambda: 0.0)
    power = planner.scene("").power
    request = ProgramRequest(CELL, power, (), known.start, PlanOptions())
    certified = [step.report.certified for step in costed_steps(asked.steps, request)]
    assert certified == [True, False, False]
    begin, notes = doors_at_the_start(known, asked, CELL)
    assert begin == ()
    assert "doors moved in the recording" in notes[0]


@pytest.mark.parametrize(
    ("doors", "signals", "begin", "sentence"),
    [
        (
            (None, None),
            (),
            (),
            "doors at the start are assumed, as the cell has them: lathe door_open",
        ),
        ((SHUT, SHUT), (), SHUT, "doors at the start as recorded: lathe door_closed"),
        ((SHUT, ()), (Signal("lathe_open_door", True),), SHUT, "as recorded: lathe door_closed"),
        ((MOVES,), (), MOVES, "as recorded: lathe door_open changing to door_closed"),
    ],
)
def test_programs_begin_with_the_doors_that_were_recorded(
    doors: tuple[Doors | None, ...], signals: tuple[Signal, ...], begin: Doors, sentence: str
) -> None:
    q = np.asarray(CELL.machine_home)
    known = Today("t", "trace", q, tuple(TodayMotion(None, q, 1.0, doors=each) for each in doors))
    step = ProgramStep("POSTURE", "home", set_signals=signals)
    asked = AskedProgram(CELL, (StepToday(step, known.stretches),), ())
    found, notes = doors_at_the_start(known, asked, CELL)
    assert found == begin
    assert any(sentence in note for note in notes)


def test_a_cell_without_doors_assumes_nothing() -> None:
    assert assumed_doors(load_cell("open")) == ()
