"""What people type as a goal, and what the answer is when it is none."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_description import load_cell
from ir_msgs_py.status import StatusCode
from ir_planner import Planner
from ir_planner.errors import RequestError
from ir_planner.request.goals import one_goal, parse_goal

CELL = load_cell("demo")
PLANNER = Planner("demo", clock=lambda: 0.0)
START = StatusCode.START_STATE_INVALID
STATE = StatusCode.INVALID_ROBOT_STATE
ASKED: dict[str, Callable[[Any], object]] = {
    "start": lambda place: PLANNER.plan_regional(start=place, goal="park"),
    "start of a program": lambda place: PLANNER.plan_program(start=place),
    "start of an escape": lambda place: PLANNER.plan_escape(start=place),
    "state": lambda place: PLANNER.check_state(place),
    "near": lambda place: PLANNER.compute_ik("lathe_work", near=place),
    "near of a service movement": lambda place: PLANNER.plan_service("lathe_work", near=place),
    "via 1": lambda place: PLANNER.plan_regional(goal="park", via=[place]),
    "goal": lambda place: PLANNER.plan_regional(goal=place),
}
CODES = {"start": START, "state": STATE, "near": STATE}


def test_a_station_is_its_pose_and_keeps_its_name() -> None:
    goal = parse_goal("lathe_work", CELL)
    assert goal.station == "lathe_work"
    assert goal.configuration is None
    assert np.array_equal(goal.pose, CELL.station("lathe_work").pose)  # type: ignore[arg-type]


@pytest.mark.parametrize(("text", "posture"), [("home", "machine_home"), ("Park", "park")])
def test_postures_have_names(text: str, posture: str) -> None:
    assert np.array_equal(parse_goal(text, CELL).configuration, getattr(CELL, posture))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "text",
    [
        "A1 10 A2 -90 A3 90 A4 0 A5 -5 A6 0",
        "a1=10, a2=-90, a3=90, a4=0, a5=-5, a6=0",
        "A6 0 A5 -5 A4 0 A3 90 A2 -90 A1 10",
    ],
)
def test_joint_values_are_degrees_in_any_order(text: str) -> None:
    assert np.degrees(parse_goal(text, CELL).configuration) == pytest.approx(
        [10, -90, 90, 0, -5, 0]
    )  # type: ignore[arg-type]


def test_a_pose_is_metres_and_kukas_angles() -> None:
    pose = parse_goal("X 1.8 Y 0.1 Z 1.2 A 0 B 90 C 0", CELL).pose
    assert pose is not None
    assert pose[:3, 3] == pytest.approx([1.8, 0.1, 1.2])
    assert pose[:3, 0] == pytest.approx([0.0, 0.0, -1.0]), "B 90 turns the tool's x downwards"


@pytest.mark.parametrize(
    ("text", "code", "says"),
    [
        ("lath", StatusCode.INVALID_OBJECT_NAME, "lathe_work"),
        ("A1 10 A2 -90", StatusCode.INVALID_GOAL_CONSTRAINTS, "A1 A2 A3 A4 A5 A6"),
        ("A1 10 A1 10 A3 90 A4 0 A5 -5 A6 0", StatusCode.INVALID_GOAL_CONSTRAINTS, "once"),
        ("A1 ten A2 -90 A3 90 A4 0 A5 -5 A6 0", StatusCode.INVALID_GOAL_CONSTRAINTS, "'ten'"),
        ("A1 nan A2 -90 A3 90 A4 0 A5 -5 A6 0", StatusCode.INVALID_GOAL_CONSTRAINTS, "finite"),
        (
            "A1 190 A2 -90 A3 90 A4 0 A5 -5 A6 0",
            StatusCode.GOAL_STATE_INVALID,
            "joint_a1 is 190 deg",
        ),
        ("X 1 Y 2 Z", StatusCode.INVALID_GOAL_CONSTRAINTS, "X Y Z A B C"),
        ("X 1e9 Y 0 Z 1 A 0 B 0 C 0", StatusCode.INVALID_GOAL_CONSTRAINTS, "100"),
        ("home\n", None, ""),
        ("ho\0me", StatusCode.INVALID_GOAL_CONSTRAINTS, "one line"),
        ("x" * 10_000, StatusCode.INVALID_GOAL_CONSTRAINTS, "300"),
    ],
)
def test_what_is_no_goal_is_named(text: str, code: StatusCode | None, says: str) -> None:
    if code is None:
        assert parse_goal(text, CELL).configuration is not None
        return
    with pytest.raises(RequestError, match=re.escape(says)) as caught:
        parse_goal(text, CELL)
    assert caught.value.code == code


@pytest.mark.parametrize("asked", ASKED)
@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("A1 x A2 -90 A3 90 A4 0 A5 -5 A6 0", "{what}: A1 is 'x': it must be a finite number"),
        ("A1 10 A2 -90", "{what} names A1 A2: it must give each of"),
        ("ho\0me", "{what} has 5 characters: it must be one line of 1 to 300"),
        ("X 1e9 Y 0 Z 1 A 0 B 0 C 0", "{what} lies at (1e+09, 0, 1) m"),
    ],
)
def test_a_text_that_is_no_place_is_refused_by_the_name_and_code_of_its_argument(
    asked: str, text: str, says: str
) -> None:
    what = asked.partition(" of ")[0]
    with pytest.raises(RequestError, match="^" + re.escape(says.format(what=what))) as caught:
        ASKED[asked](text)
    assert caught.value.code == CODES.get(what, StatusCode.INVALID_GOAL_CONSTRAINTS)


@pytest.mark.parametrize("asked", ["start", "start of a program", "state", "near", "via 1", "goal"])
@pytest.mark.parametrize("angle", [186.0, 190.0, 720.0])
def test_a_text_beyond_a_limit_is_refused_as_the_same_array_is(asked: str, angle: float) -> None:
    """Code, sentence and advice: a start just beyond a limit is led back by plan_escape."""
    q = [angle, -90.0, 90.0, 0.0, -5.0, 0.0]
    text = " ".join(f"A{i} {value:g}" for i, value in enumerate(q, start=1))
    refusals = []
    for place in (text, np.radians(q)):
        with pytest.raises(RequestError) as caught:
            ASKED[asked](place)
        refusals.append((caught.value.code, str(caught.value)))
    assert refusals[0] == refusals[1]
    assert refusals[0][1].startswith(f"{asked.partition(' of ')[0]}: joint_a1 is {angle:g} deg")
    assert ("plan_escape" in refusals[0][1]) == (asked.startswith("start") and angle < 200.0)


def test_exactly_one_form_is_taken() -> None:
    home = np.array(CELL.machine_home)
    assert one_goal("", home, None, CELL).configuration is not None
    for text, q, pose in (("", None, None), ("home", home, None), ("", home, np.eye(4))):
        with pytest.raises(RequestError, match="exactly one"):
            one_goal(text, q, pose, CELL)
    with pytest.raises(
        RequestError, match="exactly one of goal and goal_pose must be given, it is none"
    ):
        one_goal("", None, None, CELL, ("goal", "goal_pose"))


@given(st.text(max_size=80))
def test_no_text_escapes_as_another_error(text: str) -> None:
    with contextlib.suppress(RequestError):
        parse_goal(text, CELL)
