"""Every kind of violation is found between the points too, and named with place, limit and
excess.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ir_description import load_cell, load_power_data
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.evaluation import evaluate_trajectory
from ir_planner.checks.verification import verify
from ir_planner.request.context import Context, Work
from ir_planner.scene.allowed_contacts import polynomials_between
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_planner.timing.straight_steps import straight_steps

Degrees = Callable[..., Any]
NAMES = ("joint_a1", "joint_a2", "joint_a3", "joint_a4", "joint_a5", "joint_a6")
HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
ROLLING = np.array([[0.0] * 6, [0.1] * 6])


def moved(joint: int, angle_deg: float, seconds: float, **changes: Any) -> JointTrajectory:
    """From home, one joint by an angle, at rest at both ends."""
    goal = HOME.copy()
    goal[joint] += np.radians(angle_deg)
    rest = np.zeros((2, 6))
    fields = {"positions": [HOME, goal], "velocities": rest, "accelerations": rest, **changes}
    return JointTrajectory.from_seconds(NAMES, [0.0, seconds], **fields)


@pytest.mark.parametrize(
    ("trajectory", "what", "says"),
    [
        (moved(0, 90.0, 1.0), "velocity", "joint_a1"),
        (moved(0, 20.0, 0.45), "acceleration", "joint_a1"),
        (moved(5, 20.0, 0.12), "jerk", "joint_a6"),
        (moved(0, 200.0, 60.0), "position", "[-185, 185] deg (excess 15 deg)"),
        (moved(0, 10.0, 5.0, velocities=ROLLING), "velocity at rest", "ends with"),
        (moved(0, 10.0, 5.0, accelerations=ROLLING[::-1]), "acceleration at rest", "starts with"),
        (moved(1, 70.0, 5.0), "clearance", "must stay"),
    ],
)  # fmt: skip
def test_a_violation_is_found_and_named(
    trajectory: JointTrajectory, what: str, says: str, demo_scene: PlanningScene
) -> None:
    found = verify(trajectory, demo_scene, 0.02)
    assert found.violation is not None
    share = {"velocity": found.velocity, "acceleration": found.acceleration, "jerk": found.jerk}
    if what in share:
        assert share[what].max() > 1.0
        assert "excess" in found.violation.sentence
    else:
        assert found.violation.what == what
        assert says in found.violation.sentence
    assert not found.certified
    assert found.status.code == StatusCode.INVALID_MOTION_PLAN


def test_a_start_that_is_not_at_rest_hides_no_later_collision(demo_scene: PlanningScene) -> None:
    trajectory = moved(1, 70.0, 5.0, accelerations=ROLLING[::-1])
    found = verify(trajectory, demo_scene, 0.02)
    assert found.violation is not None
    assert found.violation.what == "acceleration at rest"
    times = [violation.time for violation in (found.violation, *found.others)]
    assert times == sorted(times)
    clearance = next(violation for violation in found.others if violation.what == "clearance")
    first, also = found.status.message.split("; also: ")
    assert first == found.violation.sentence
    assert clearance.sentence in also
    alone = verify(moved(1, 70.0, 5.0), demo_scene, 0.02)
    assert alone.others == ()
    assert "also" not in alone.status.message


def test_a_collision_between_two_points_is_found() -> None:
    """Both points are free; the pillar stands between them."""
    cell = load_cell("open")
    scene = scene_with(cell, load_text(cell), load_power_data())
    task = cell.task("p1->p2")
    rest = np.zeros((2, 6))
    trajectory = JointTrajectory.from_seconds(
        NAMES, [0.0, 8.0], [task.start, task.goal], rest, rest
    )
    assert scene.collision.is_free(trajectory.positions, 0.02).all()
    violation = verify(trajectory, scene, 0.02).violation
    assert violation is not None
    assert violation.what == "clearance"
    assert violation.pair is not None
    assert violation.excess == pytest.approx(0.02 - violation.pair.distance)
    early = trajectory.sample(np.linspace(0.0, violation.time * 0.999, 400)).q
    assert (scene.collision.distances(early).min(axis=1) > 0.02 - 1e-6).all(), (
        "not the first violation"
    )


def test_missing_velocities_jump_and_are_no_motion_for_a_robot(demo_scene: PlanningScene) -> None:
    line = JointTrajectory.from_seconds(NAMES, [0.0, 1.0, 2.0], [HOME, HOME + 0.01, HOME])
    violation = verify(line, demo_scene, 0.0).violation
    assert violation is not None
    assert violation.what == "velocity at rest"
    cubic = JointTrajectory.from_seconds(
        NAMES, [0.0, 1.0, 2.0], [HOME, HOME + 0.01, HOME], np.zeros((3, 6))
    )
    assert not verify(cubic, demo_scene, 0.0).certified


def test_a_load_that_is_too_much_for_the_speed_is_a_torque_violation(
    demo_scene: PlanningScene, budget: Work
) -> None:
    path = np.stack([HOME, HOME + np.radians([0, 40, -40, 0, 40, 0])])
    light = scene_with(demo_scene.cell, "none", demo_scene.power)
    fast = straight_steps(
        path, Context.of(light, PlanOptions(objective="time", safety_distance=0.0), budget)
    ).trajectory
    assert verify(fast, light, 0.0).certified
    violation = verify(fast, demo_scene, 0.0).violation
    assert violation is not None
    assert violation.what == "torque"
    assert "excess" in violation.sentence


def test_an_allowed_contact_holds_at_its_station_only(demo_cell: Any, power: Any) -> None:
    scene = scene_with(demo_cell, "gripper", power)
    station = scene.station("infeed_pick")
    allowed = {frozenset((c.body_a, c.body_b)) for c in station.allowed_contacts}
    here = scene.thresholds(0.02, "infeed_pick")
    elsewhere = scene.thresholds(0.02)
    for z, pair in enumerate(scene.collision.pairs):
        assert elsewhere[z] == 0.02
        assert (here[z] < 0.02) == (frozenset((pair.body_a, pair.body_b)) in allowed)
    assert (here < 0.02).any()


def test_a_report_of_one_point_is_a_state(demo_scene: PlanningScene) -> None:
    point = JointTrajectory(NAMES, np.array([0]), HOME[None])
    report = evaluate_trajectory(point, demo_scene, 0.02).report
    assert (report.duration, report.energy, report.path_length) == (0.0, 0.0, 0.0)
    assert report.certified
    assert report.min_clearance > 0.02


def test_allowed_contacts_hold_only_while_the_tcp_is_in_the_zone(
    planner: Any, demo_scene: PlanningScene
) -> None:
    """With a zone that ends below the pick, the fingers may not come near the blank at all."""
    plan = planner.plan_program(
        stations=("infeed_pick",), options=PlanOptions(planning_time=60.0), start=HOME
    )
    assert plan.status.ok, plan.status.message
    entry = next(m.trajectory for m in plan.movements if m.kind == "service_entry")
    assert verify(entry, demo_scene, 0.02, "infeed_pick").certified
    assert not verify(entry, demo_scene, 0.02).certified
    cell = demo_scene.cell
    infeed = cell.machine("infeed")
    low = replace(infeed.zone_in_equipment, size=np.array([0.8, 1.2, 0.2]))
    machines = tuple(
        replace(m, zone_in_equipment=low) if m.name == "infeed" else m for m in cell.equipment
    )
    shrunk = replace(demo_scene, cell=replace(cell, equipment=machines))
    violation = verify(entry, shrunk, 0.02, "infeed_pick").violation
    assert violation is not None
    assert violation.what == "clearance"
    assert "gear_lying" in violation.sentence


def test_a_cut_trajectory_is_the_same_motion(demo_scene: PlanningScene, budget: Work) -> None:
    path = np.stack([HOME, HOME + np.radians([40, 10, -10, 0, 20, 0])])
    trajectory = straight_steps(
        path, Context.of(demo_scene, PlanOptions(safety_distance=0.0), budget)
    ).trajectory
    begin = 0.21 * trajectory.duration
    end = 0.77 * trajectory.duration
    coefficients, durations = polynomials_between(trajectory, begin, end)
    assert durations.sum() == pytest.approx(end - begin)
    at = begin
    for c, T in zip(coefficients, durations, strict=True):
        t = np.linspace(0.0, T, 7)
        q = (c[None] * t[:, None, None] ** np.arange(6)).sum(axis=2)
        assert q == pytest.approx(trajectory.sample(at + t).q, abs=1e-9)
        at += T
