"""The planner as a whole, without ROS: snapshots, ids, bounds, configurations, service lines."""

from __future__ import annotations

import re
from collections import Counter
from typing import Any

import numpy as np
import pytest

from ir_description import load_cell
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.free_space import FreeSpace, too_near
from ir_planner.errors import RequestError
from ir_planner.planner import Planner
from ir_planner.request.context import Context, Journal, Work
from ir_planner.request.goals import Goal, parse_goal
from ir_planner.request.request_bounds import PLANNING_TIME_MAX
from ir_planner.scene.planning_scene import scene_with, with_parts
from ir_planner.service.service_lines import line_poses, service_lines
from ir_planner.store import trajectory_store
from ir_planner.trajectories.through_points import Reference

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


def test_without_a_cell_every_question_is_answered_by_a_sentence() -> None:
    planner = Planner(clock=lambda: 0.0)
    with pytest.raises(RequestError, match="set_cell first"):
        planner.scene()
    with pytest.raises(RequestError, match="neither is"):
        planner.set_cell()
    with pytest.raises(RequestError, match="both are"):
        planner.set_cell("b", text="a")


def test_a_scene_does_not_change_with_the_cell(planner: Planner) -> None:
    before = planner.scene()
    distances = before.collision.distances(HOME[None])
    planner.set_equipment("lathe", enabled=False)
    assert np.array_equal(before.collision.distances(HOME[None]), distances)
    assert planner.scene().collision.distances(HOME[None]).shape != distances.shape


def test_loads_are_named_as_people_write_them(planner: Planner) -> None:
    assert planner.scene().load_text == "gripper"
    held = planner.scene("gripper+gear")
    assert {pair.body_a for pair in held.collision.pairs} >= {"gear_held", "t_f1"}
    assert not any(body.name == "gear_lying" for body in held.cell.bodies())
    assert planner.scene("none").loads == ()
    with pytest.raises(RequestError, match="gripper, gear, none"):
        planner.scene("gripper+anvil")
    with pytest.raises(RequestError, match="each load once"):
        planner.scene("gripper+gripper")


def test_a_lying_part_is_a_body_and_a_held_one_a_load(demo_cell: Any, power: Any) -> None:
    start = demo_cell.parts_at_start()
    assert any(body.name == "gear_lying" for body in with_parts(demo_cell, start).bodies())
    held = scene_with(demo_cell, "gripper+gear", power)
    assert held.weights[-1] > scene_with(demo_cell, "gripper", power).weights[-1]


def test_every_configuration_reaches_the_pose_with_its_branch_and_turns(planner: Planner) -> None:
    goal = parse_goal("X 1.6 Y 0.4 Z 1.5 A 0 B 60 C 0", planner.cell)
    answer = planner.compute_ik(goal, method="analytic", safety_distance=0.02, near=HOME)
    assert answer.status.ok
    assert len(answer.solutions) > 2
    for solution in answer.solutions:
        assert solution.position_error < 1e-9
        assert solution.rotation_error < 1e-9
        assert solution.clearance > 0.02 - 1e-6
        principal = solution.q - 2 * np.pi * np.array(solution.turns)
        assert (principal > -np.pi - 1e-9).all()
        assert (principal <= np.pi + 1e-9).all()
    assert len({tuple(np.round(s.q, 6)) for s in answer.solutions}) == len(answer.solutions)


def test_an_unreachable_pose_and_an_occupied_one_are_distinguished(planner: Planner) -> None:
    far = planner.compute_ik(
        parse_goal("X 5 Y 0 Z 1 A 0 B 90 C 0", planner.cell),
        method="analytic",
        safety_distance=0.02,
        near=HOME,
    )
    assert far.status.code == StatusCode.NO_IK_SOLUTION
    inside = parse_goal("X 1.88 Y 0.5 Z 0.4 A 0 B 90 C 0", planner.cell)
    occupied = planner.compute_ik(inside, method="analytic", safety_distance=0.02, near=HOME)
    assert occupied.status.code == StatusCode.GOAL_IN_COLLISION
    assert "gauge_table" in occupied.status.message
    assert re.search(
        r"come to -?[\d.]+ mm, they must keep more than 20.0 mm", occupied.status.message
    )
    assert occupied.info.rejected


def test_service_lines_follow_the_approach_axis_in_one_branch(planner: Planner) -> None:
    scene = planner.scene()
    station = scene.station("lathe_work")
    poses = line_poses(station)
    assert np.linalg.norm(poses[-1, :3, 3] - poses[0, :3, 3]) == pytest.approx(
        station.approach_distance
    )
    work = scene.inverse_kinematics.solve(np.asarray(station.pose)[None]).q
    rejected: Counter[str] = Counter()
    context = Context(scene, PlanOptions(), Journal(Work(1000, np.inf, lambda: 0.0), 0))
    lines = service_lines(work, context.at("lathe_work"), rejected)
    assert lines
    for line in lines:
        assert scene.chain.tcp_poses(line.points) == pytest.approx(poses, abs=1e-9)
        assert np.abs(np.diff(line.points, axis=0)).max() < 0.35
    assert len(lines) + sum(rejected.values()) == len(work)


def test_a_pose_goal_takes_the_cheapest_configuration_that_can_be_reached(planner: Planner) -> None:
    goal = parse_goal("gauge_measure", planner.cell)
    plan = planner.plan_regional(start=HOME, goal=goal, options=PlanOptions(planning_time=60.0))
    assert plan.status.ok
    assert plan.trajectory is not None
    end = planner.scene().chain.tcp_poses(plan.trajectory.positions[-1:])[0]
    assert end == pytest.approx(np.asarray(goal.pose), abs=1e-9)
    assert planner.trajectories.get(plan.trajectory.trajectory_id) == plan.trajectory


def test_a_long_planning_time_is_capped_and_said(planner: Planner) -> None:
    plan = planner.plan_regional(
        start=HOME, goal=parse_goal("park", planner.cell), options=PlanOptions(planning_time=1e9)
    )
    assert plan.status.ok
    assert (
        plan.info.stages[-1].note == f"planning_time 1e+09 s is capped to {PLANNING_TIME_MAX:g} s"
    )


@pytest.mark.parametrize("times", [None, np.array([0.0, 3.0, 4.0, 7.0])])
def test_reference_points_are_passed_with_the_requested_proportions(
    planner: Planner, times: Any
) -> None:
    points = HOME + np.radians(
        [[0] * 6, [10, 5, 5, 0, 10, 0], [30, 0, 5, 0, 0, 10], [40, 0, 0, 0, 0, 0]]
    )
    plan = planner.plan_trajectory(Reference(points, times))
    assert plan.status.ok, plan.status.message
    trajectory = plan.trajectory
    assert trajectory is not None
    passed = [int(np.abs(trajectory.positions - q).max(axis=1).argmin()) for q in points]
    assert np.abs(trajectory.positions[passed] - points).max() < 1e-9
    if times is not None:
        assert trajectory.times[passed] == pytest.approx(times, abs=0.01)


@pytest.mark.parametrize(("requested", "taken"), [(8.0, 8.0), (0.01, None)])
def test_two_reference_points_take_their_time_or_the_shortest(
    requested: float, taken: float | None, planner: Planner
) -> None:
    points = HOME + np.radians([[0] * 6, [40, 10, 0, 0, 20, 0]])
    plan = planner.plan_trajectory(Reference(points, np.array([0.0, requested])))
    fastest = planner.plan_trajectory(Reference(points), options=PlanOptions(objective="time"))
    assert plan.status.ok, plan.status.message
    assert plan.report.duration == pytest.approx(taken or fastest.report.duration, abs=1e-5)


def test_a_state_in_collision_names_pair_value_and_bound(planner: Planner) -> None:
    check = planner.check_state(
        np.radians([0.0, -20, 60, 0, 0, 0]), safety_distance=0.02, max_pairs=3
    )
    assert not check.valid
    pair = check.pairs[0]
    assert f"{pair.body_a} and {pair.body_b}" in check.status.message
    assert f"in penetration: distance {pair.distance * 1e3:.1f} mm" in check.status.message
    assert check.status.message.endswith("it must be more than 20.0 mm")


def test_the_bound_of_an_allowed_contact_is_its_own(planner: Planner) -> None:
    scene = planner.scene("gripper+gear")
    station = scene.station("lathe_work")
    contact = station.allowed_contacts[0]
    closer = np.array(station.pose)
    closer[:3, 3] += (
        closer[:3, 0] * 0.0045
    )  # towards the spindle: 0.5 mm are left where 1 mm must be
    q = scene.inverse_kinematics.solve(closer[None]).q
    space = FreeSpace.of(scene, 0.02, Work(1, 1.0, lambda: 0.0), "lathe_work")
    sentences = [
        too_near(at, space, "start", 0.02) for at in q if not space.states_free(at[None])[0]
    ]
    own = [text for text in sentences if contact.body_a in text and contact.body_b in text]
    assert own
    assert all(text.endswith("it must be more than 1.0 mm") for text in own)


def test_a_reference_beyond_a_limit_names_the_point(planner: Planner) -> None:
    points = np.stack([HOME, HOME + np.radians([200.0, 0, 0, 0, 0, 0])])
    with pytest.raises(RequestError, match="point 1: joint_a1 is 200 deg") as caught:
        planner.plan_trajectory(Reference(points))
    assert caught.value.code == StatusCode.INVALID_MOTION_PLAN


@pytest.mark.parametrize("name", ["genetic", "kpiece", ""])
def test_a_planner_named_for_a_trajectory_through_points_is_said_to_be_unused(
    planner: Planner, name: str
) -> None:
    points = np.stack([HOME, HOME + 0.1, HOME + 0.05])
    plain = planner.plan_trajectory(Reference(points))
    plan = planner.plan_trajectory(Reference(points), options=PlanOptions(planner_id=name))
    assert plan.status.ok
    assert plan.trajectory == plain.trajectory
    said = [stage.note for stage in plan.info.stages if stage.name == "options"]
    assert said == (
        [f"planner_id {name} is not used: nothing is searched between given points"] if name else []
    )


def test_an_unknown_planner_of_a_trajectory_through_points_is_refused(planner: Planner) -> None:
    with pytest.raises(RequestError, match=r"planner_id 'rrt_conect' is unknown.*rrt_connect"):
        planner.plan_trajectory(
            Reference(np.stack([HOME, HOME + 0.1])), options=PlanOptions(planner_id="rrt_conect")
        )


def test_a_state_that_is_not_free_names_the_pair(planner: Planner) -> None:
    check = planner.check_state(
        np.radians([0.0, -20, 60, 0, 0, 0]), safety_distance=0.02, max_pairs=3
    )
    assert not check.valid
    assert check.min_distance < 0.0
    assert check.pairs[0].body_a in check.status.message
    with pytest.raises(RequestError, match="safety_distance is nan"):
        planner.check_state(HOME, safety_distance=float("nan"), max_pairs=3)


def test_the_store_forgets_the_oldest_and_says_so() -> None:
    store = trajectory_store(2, megabytes=1)
    ids = [
        store.add(JointTrajectory(("a",), np.array([0]), np.array([[float(k)]]))) for k in range(3)
    ]
    assert len(store) == 2
    assert store.get(ids[2]).positions[0, 0] == 2.0
    with pytest.raises(RequestError, match="the last 2 are kept, at most 2 and 1 MB"):
        store.get(ids[0])


def test_the_memory_of_trajectories_is_bounded_in_bytes_too() -> None:
    store = trajectory_store(500, megabytes=1)
    # of points: 55 numbers with the polynomials, 0.44 MB
    rng = np.random.default_rng(1)
    count = 1000
    times = np.arange(count)
    ids = [
        store.add(JointTrajectory(JOINT_NAMES, times, rng.normal(size=(count, 6))))
        for _ in range(5)
    ]
    assert len(store) == 2
    store.add(store.get(ids[4]))  # the same again takes no more
    assert len(store) == 2
    with pytest.raises(RequestError, match="the last 2 are kept, at most 500 and 1 MB"):
        store.get(ids[2])
    large = JointTrajectory(JOINT_NAMES, np.arange(9000), rng.normal(size=(9000, 6)))
    assert store.get(store.add(large)) is large
    assert len(store) == 1


def test_a_goal_configuration_beyond_the_limits_of_start_is_refused(planner: Planner) -> None:
    with pytest.raises(RequestError, match="start: joint_a2") as caught:
        planner.plan_regional(start=np.zeros(6), goal=Goal(configuration=HOME))
    assert caught.value.code == StatusCode.START_STATE_INVALID


def test_the_demo_of_two_planners_is_the_same() -> None:
    """Nothing of a planner's past changes an answer."""
    ids = []
    for warm in (False, True):
        planner = Planner("demo", clock=lambda: 0.0)
        if warm:
            planner.plan_regional(
                start=HOME,
                goal=parse_goal("gauge_measure", planner.cell),
                options=PlanOptions(seed=9),
            )
        plan = planner.plan_regional(start=HOME, goal=parse_goal("lathe_work", load_cell("demo")))
        ids.append(plan.trajectory.trajectory_id if plan.trajectory else plan.status.message)
    assert ids[0] == ids[1]
