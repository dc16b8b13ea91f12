"""Requests for a path as nobody should send them: each is answered by a sentence with value and
bound.
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import Pose
from sensor_msgs.msg import JointState

from ir_description import cell_to_yaml, load_cell
from ir_msgs.msg import CartesianSegment, PlannedMovement
from ir_msgs.srv import PlanCartesianMovement, PlanProgram
from ir_msgs_py.status import StatusCode
from ir_planner.node.inputs import LastState
from ir_planner.node.requests import Requests
from ir_planner.planner import Planner

DOWN = (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5))
BACK = (math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0)
SEAM = """paths:
  - name: seam
    tool_speed: 0.2
    start: {xyz: [1.8, -0.3, 1.2], abc_deg: [0, 90, 0]}
    segments: [{line: {xyz: [1.8, 0, 1.2], abc_deg: [0, 90, 0]}}]
"""


@pytest.fixture(scope="module")
def requests() -> Requests:
    planner = Planner(clock=lambda: 0.0)
    planner.set_cell(text=cell_to_yaml(load_cell("open")) + SEAM)
    return Requests(
        planner=planner,
        last_state=LastState(),
        now=time.monotonic,
        draw_seed=lambda: 7,
        log=print,
    )


def pose(x: float, y: float, z: float, turn: tuple[float, ...] = DOWN) -> Pose:
    found = Pose()
    found.position.x = x
    found.position.y = y
    found.position.z = z
    q = found.orientation
    q.x, q.y, q.z, q.w = turn
    return found


def part(kind: str, *poses: Pose) -> CartesianSegment:
    return CartesianSegment(kind=kind, poses=list(poses))


def asked(*segments: CartesianSegment, frame: str = "cell", **fields: Any) -> Any:
    request = PlanCartesianMovement.Request(segments=list(segments), **fields)
    request.start_pose.header.frame_id = frame
    request.start_pose.pose = pose(1.8, -0.3, 1.2)
    return request


def answer(requests: Requests, request: Any) -> Any:
    return requests.guarded(requests.plan_cartesian)(request, PlanCartesianMovement.Response())


LINE = part("line", pose(1.8, 0.3, 1.2))
TWO = (part("line", pose(1.8, 0.0, 1.2)), part("line", pose(1.9, 0.0, 1.2)))
NAN = float("nan")
REFUSED = {
    "no segments": (asked(), "segments have 0 poses: it must be 1 to 2000"),
    "nothing": (PlanCartesianMovement.Request(), "exactly one of path and start_pose"),
    "no end": (asked(part("line")), "a line has 0 poses: it must have 1"),
    "zero length": (
        asked(part("line", pose(1.8, -0.3, 1.2))),
        "is where the pose before it is, turned by 0 rad",
    ),
    "collinear": (asked(part("circle", pose(1.8, 0.0, 1.2), pose(1.8, 0.3, 1.2))), "lie on a line"),
    "there and back": (
        asked(part("circle", pose(1.6, 0.0, 1.2), pose(1.8, -0.3, 1.2))),
        "one place",
    ),
    "opposite": (asked(part("line", pose(1.8, 0.3, 1.2, BACK))), "at most 179 deg"),
    "not a number": (
        asked(part("line", pose(NAN, 0.3, 1.2))),
        "segments[0].poses[0]: position is (nan",
    ),
    "no speed": (asked(LINE, tool_speed=NAN), "tool_speed is nan m/s"),
    "standing": (asked(LINE, tool_speed=0.0), "it must be in [0.0001, 10] m/s"),
    "a day": (asked(LINE, tool_speed=1e-4), "it must be at most 3600 s"),
    "frame": (asked(LINE, frame="moon"), "known are cell, base_link"),
    "a million": (asked(part("spline", *[Pose()] * 1_000_000)), "at most 2000 are taken"),
    "kind": (asked(part("bow", pose(1.8, 0.3, 1.2))), "known are line, circle, spline"),
    "far": (asked(part("line", pose(1e9, 0.3, 1.2))), "it must be within 100 m"),
    "turned": (asked(LINE, free_angle=3.2), "free_angle is 3.2 rad"),
    "path": (PlanCartesianMovement.Request(path="saem"), "known are seam"),
    "both": (asked(LINE, path="seam"), "both are"),
    "too fast": (asked(LINE, tool_speed=5.0), "from 0.000 to 0.600 m"),
    "axis too fast": (asked(LINE, tool_speed=5.0), "with shorter ramps joint_a"),
    "there and back again": (
        asked(LINE, part("line", pose(1.8, -0.3, 1.2)), blending_radius=0.05),
        "m/s: speed_tolerance 1",
    ),
    "beyond": (
        asked(
            LINE, start=JointState(name=[f"joint_a{k}" for k in range(1, 7)], position=[7.0] * 6)
        ),
        "start: joint_a1 is 401.07 deg: it must be in [-185, 185] deg",
    ),
    "corner": (asked(*TWO), "at 0.300 m the path has a corner of 90.0 deg"),
    "turning corner": (asked(*TWO, orientation="tangent", speed_tolerance=1.0), "can't follow it"),
    "along the axis": (
        asked(part("line", pose(1.8, -0.3, 1.0)), orientation="tangent"),
        "at 0.000 m",
    ),
    "tiny approach": (asked(LINE, approach=1e-9), "approach is 1e-09 m"),
    "start": (
        asked(
            LINE,
            start=JointState(
                name=[f"joint_a{k}" for k in range(1, 7)], position=[0.0, -1.5, 1.5, 0.0, 0.5, 0.0]
            ),
        ),
        "from where the path begins",
    ),
}


@pytest.mark.parametrize("name", sorted(REFUSED))
def test_what_makes_no_sense_is_refused_with_value_and_bound(requests: Requests, name: str) -> None:
    request, words = REFUSED[name]
    status = answer(requests, request).status
    assert status.code not in (StatusCode.SUCCESS, StatusCode.FAILURE), status.message
    assert words in status.message


def test_a_radius_longer_than_the_segments_is_half_of_them(requests: Requests) -> None:
    response = answer(requests, asked(*TWO, blending_radius=5.0, tool_speed=0.05))
    assert response.status.code == StatusCode.SUCCESS, response.status.message
    assert any("0.05 m: half of a part" in stage.note for stage in response.info.stages)
    assert response.tool_error <= 1e-4


def test_a_path_of_the_cell_keeps_its_settings_but_for_those_of_the_request(
    requests: Requests,
) -> None:
    named = answer(requests, PlanCartesianMovement.Request(path="seam"))
    faster = answer(requests, PlanCartesianMovement.Request(path="seam", tool_speed=0.25))
    assert named.status.code == faster.status.code == StatusCode.SUCCESS
    assert named.report.duration > 1.2 * faster.report.duration
    assert np.isclose(named.lengths[-1], 0.3)


def test_t1_keeps_250_mm_per_second(requests: Requests) -> None:
    response = answer(requests, asked(LINE, tool_speed=2.0, t1=True))
    assert response.status.code == StatusCode.SUCCESS
    assert [stage.note for stage in response.info.stages if stage.name == "t1"] == [
        "0.2497 m/s, so that the flange keeps 250 mm/s"
    ]
    assert response.report.duration > 0.6 / 0.25


def test_what_a_path_of_the_cell_allows_to_touch_holds_for_it_alone() -> None:
    planner = Planner("kr6_bench", clock=lambda: 0.0)
    own = Requests(
        planner=planner,
        last_state=LastState(),
        now=time.monotonic,
        draw_seed=lambda: 7,
        log=print,
    )
    found = answer(own, PlanCartesianMovement.Request(path="bead"))
    assert found.status.code == StatusCode.SUCCESS, found.status.message
    assert [pair.body_b for pair in found.report.contacts] == ["tray_out_top"]
    refused = planner.plan_cartesian(planner.cell.path("bead"))
    assert "gripper_body and tray_out_top" in refused.status.message


def test_a_program_drives_a_path_that_is_named_as_a_stop() -> None:
    planner = Planner("kr6_bench", clock=lambda: 0.0)
    own = Requests(
        planner=planner,
        last_state=LastState(),
        now=time.monotonic,
        draw_seed=lambda: 7,
        log=print,
    )
    request = PlanProgram.Request(stations=["bead"], savings=False)
    found = own.guarded(own.plan_program)(request, PlanProgram.Response())
    assert found.status.code == StatusCode.SUCCESS, found.status.message
    assert [step.kind for step in found.movements] == ["regional", PlannedMovement.CARTESIAN]
    assert [(step.from_station, step.to_station) for step in found.movements][1] == ("bead", "bead")
