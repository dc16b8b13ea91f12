"""Laws of a limit of tool speed and acceleration, judged by Pinocchio at dense samples."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from ir_description import Cell, cell_from_yaml, cell_to_yaml, load_cell
from ir_description.robot import ToolLimits
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner, RequestError

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of poses
from _pinocchio_arm import pinocchio_arm

CELLS = ("open", "kr6_bench", "ur10e_bench")
MOSTLY_LONG = (
    "kr6_bench",
    *(pytest.param(c, marks=pytest.mark.long) for c in ("open", "ur10e_bench")),
)
SAMPLES = 400  # of a trajectory, at the least
ROUNDING = 1e-6  # relative
CLOSE = 1.04  # 2 % between instants, and what the judge's samples miss


@pytest.fixture(scope="module")
def planners() -> dict[str, Planner]:
    return {name: Planner(name, clock=lambda: 0.0) for name in CELLS}


def judged(
    planner: Planner,
    trajectory: JointTrajectory,
    points: list[np.ndarray] | None = None,
    each: int = 1,
) -> tuple[float, float]:
    """Largest speed and acceleration of points of the last link, the tcp if none are given.

    each: samples of an interval between two points of the trajectory, at the least; its ends are
    among them, where accelerations jump.
    """
    cell = planner.cell
    model = pinocchio_arm(cell.robot, (), cell.base_pose)
    data = model.createData()
    joint = cell.robot.n
    begin = trajectory.times[:-1]
    share = np.linspace(1e-6, 1.0 - 1e-6, max(each, SAMPLES // len(begin), 2))
    motion = trajectory.sample((begin + np.outer(share, np.diff(trajectory.times))).ravel())
    places = np.array(points or [cell.tcp[:3, 3]])
    speed = 0.0
    gain = 0.0
    for q, qd, qdd in zip(motion.q, motion.qd, motion.qdd, strict=True):
        pinocchio.forwardKinematics(model, data, q, qd, qdd)
        v = pinocchio.getVelocity(model, data, joint, pinocchio.ReferenceFrame.LOCAL)
        a = pinocchio.getClassicalAcceleration(model, data, joint, pinocchio.ReferenceFrame.LOCAL)
        lift = np.cross(v.angular, places)
        swing = np.cross(a.angular, places) + np.cross(v.angular, lift)
        speed = max(speed, float(np.linalg.norm(v.linear + lift, axis=1).max()))
        gain = max(gain, float(np.linalg.norm(a.linear + swing, axis=1).max()))
    return speed, gain


def surface(planner: Planner, draw: np.random.Generator) -> list[np.ndarray]:
    """Points on the capsules of what the tool is."""
    found = []
    for load in planner.scene().loads:
        for capsule in load.capsules:
            for _ in range(6):
                away = draw.normal(size=3)
                share = draw.uniform()
                centre = capsule.p0 + share * (capsule.p1 - capsule.p0)
                found.append(centre + capsule.radius * away / np.linalg.norm(away))
    return found


def drawn_goal(planner: Planner, draw: np.random.Generator) -> np.ndarray:
    """A free configuration around home."""
    robot = planner.cell.robot
    home = np.array(planner.cell.machine_home)
    for _ in range(50):
        q = np.clip(home + draw.uniform(-0.7, 0.7, robot.n), robot.position_min, robot.position_max)
        if planner.check_state(q=q).valid:
            return np.asarray(q)
    raise AssertionError("no free configuration around home")


@pytest.mark.parametrize(
    ("cell", "seed"),
    [
        ("open", 0),
        ("kr6_bench", 1),
        ("ur10e_bench", 2),
        *(
            pytest.param(cell, seed, marks=pytest.mark.long)
            for cell in CELLS
            for seed in range(3)
            if seed != CELLS.index(cell)
        ),
    ],
)
def test_no_point_exceeds_its_limit_and_a_looser_one_takes_no_longer(
    planners: dict[str, Planner], cell: str, seed: int
) -> None:
    planner = planners[cell]
    draw = np.random.default_rng([seed, 33])
    goal = drawn_goal(planner, draw)
    whole = bool(seed % 2)
    objective = ("time", "time_and_energy", "energy")[seed]
    free = planner.plan_regional(goal=goal, objective=objective)
    points = surface(planner, draw) if whole else None
    fastest, hardest = judged(planner, free.trajectory, points)
    longer = np.inf
    for share in (0.3, 0.7):
        asked = {"tool_speed": share * fastest, "tool_acceleration": share * share * hardest}
        plan = planner.plan_regional(goal=goal, objective=objective, whole_tool=whole, **asked)
        assert plan.status.ok, plan.status
        assert plan.report.certified
        speed, gain = judged(planner, plan.trajectory, points)
        assert speed <= asked["tool_speed"] * (1.0 + ROUNDING)
        assert gain <= asked["tool_acceleration"] * (1.0 + ROUNDING)
        assert speed <= plan.report.tool_speed * (1.0 + ROUNDING)
        assert gain <= plan.report.tool_acceleration * (1.0 + ROUNDING)
        assert plan.trajectory.positions[-1] == pytest.approx(goal, abs=1e-9)
        if objective == "time":
            assert plan.report.duration <= 1.02 * longer
        longer = plan.report.duration


@pytest.mark.parametrize("cell", MOSTLY_LONG)
def test_only_what_is_too_fast_for_the_tool_is_slowed(
    planners: dict[str, Planner], cell: str
) -> None:
    """Beside the same movement without a bound, stretched until the judge finds the tool within."""
    planner = planners[cell]
    shares = []
    for seed in range(6):
        draw = np.random.default_rng([seed, 34])
        goal = drawn_goal(planner, draw)
        free = planner.plan_regional(goal=goal, objective="time")
        fastest, hardest = judged(planner, free.trajectory)
        share = draw.uniform(0.2, 0.6)
        plan = planner.plan_regional(
            goal=goal,
            objective="time",
            tool_speed=share * fastest,
            tool_acceleration=share * share * hardest,
        )
        assert plan.report.certified
        shares.append(plan.report.duration * share / free.report.duration)
    assert max(shares) <= 1.001, shares
    assert np.median(shares) <= 0.97, shares


def drawn_trajectory(
    planner: Planner, draw: np.random.Generator, count: int, known: int
) -> JointTrajectory:
    """Points around home at uneven times, with `known` derivatives: from linear to quintic."""
    robot = planner.cell.robot
    shape = (count, robot.n)
    times = np.cumsum(draw.uniform(0.1, 1.0, count)) - 0.1
    q = np.array(planner.cell.machine_home) + draw.uniform(-0.5, 0.5, shape)
    scale = 10.0 ** draw.uniform(-2.0, 1.0)
    derivatives = [scale * draw.normal(size=shape) for _ in range(known)]
    return JointTrajectory.from_seconds(robot.joint_names, times, q, *derivatives)


@pytest.mark.sampled
@pytest.mark.parametrize("cell", MOSTLY_LONG)
@pytest.mark.parametrize(("count", "known"), [(2, 2), (3, 1), (6, 0), (6, 2), (60, 1), (60, 2)])
def test_reported_speeds_are_upper_bounds_and_close(
    planners: dict[str, Planner], cell: str, count: int, known: int
) -> None:
    """Also where nobody asks for a limit, of any trajectory."""
    planner = planners[cell]
    draw = np.random.default_rng([count, known, 33])
    drawn = drawn_trajectory(planner, draw, count, known)
    report = planner.evaluate(drawn).report
    speed, gain = judged(planner, drawn, each=40)
    assert speed <= report.tool_speed * (1.0 + ROUNDING)
    assert gain <= report.tool_acceleration * (1.0 + ROUNDING)
    assert report.tool_speed <= CLOSE * speed
    assert report.tool_acceleration <= CLOSE * gain
    points = surface(planner, draw)
    whole = planner.evaluate(drawn, tool_speed=1e-3, whole_tool=True).report
    speed, gain = judged(planner, drawn, points, each=20)
    assert speed <= whole.tool_speed * (1.0 + ROUNDING)
    assert gain <= whole.tool_acceleration * (1.0 + ROUNDING)


@pytest.mark.parametrize("cell", CELLS)
def test_a_limit_that_does_not_bind_changes_nothing(
    planners: dict[str, Planner], cell: str
) -> None:
    planner = planners[cell]
    free = planner.plan_regional(goal="park")
    assert free.status.ok
    loose = planner.plan_regional(goal="park", tool_speed=50.0, tool_acceleration=5000.0)
    assert loose.trajectory.trajectory_id == free.trajectory.trajectory_id


@pytest.mark.parametrize("cell", ["open", pytest.param("ur10e_bench", marks=pytest.mark.long)])
def test_a_trajectory_that_is_too_fast_between_its_points_is_refused(
    planners: dict[str, Planner], cell: str
) -> None:
    """At rest at both of its points, so that only what lies between them tells."""
    planner = planners[cell]
    home = np.array(planner.cell.machine_home)
    goal = home + 0.1
    still = np.zeros((2, len(home)))
    given = JointTrajectory.from_seconds(
        planner.cell.robot.joint_names, np.array([0.0, 2.0]), np.stack([home, goal]), still, still
    )
    fastest, hardest = judged(planner, given)
    assert planner.evaluate(given).status.ok
    kept = planner.evaluate(given, tool_speed=1.001 * fastest, tool_acceleration=1.001 * hardest)
    assert kept.status.ok
    assert fastest <= kept.report.tool_speed * (1.0 + ROUNDING) <= 1.01 * fastest
    beyond = planner.evaluate(given, tool_speed=0.999 * fastest)
    assert "the speed of the tcp comes to" in beyond.status.message
    assert not beyond.report.certified
    hurried = planner.evaluate(given, tool_acceleration=0.999 * hardest)
    assert "the acceleration of the tcp comes to" in hurried.status.message


def test_a_duration_that_the_tool_can_not_keep_is_refused_with_the_shortest() -> None:
    planner = Planner("open", clock=lambda: 0.0)
    with pytest.raises(RequestError, match=r"the tcp at most 0.25 m/s is [0-9.]+ s"):
        planner.plan_regional(goal="park", tool_speed=0.25, duration=1.5)


@pytest.mark.parametrize("value", [-1.0, 1e-9, 1e9, float("nan")])
@pytest.mark.parametrize("name", ["tool_speed", "tool_acceleration"])
def test_limits_that_make_no_sense_are_refused(name: str, value: float) -> None:
    planner = Planner("open")
    with pytest.raises(RequestError, match=name):
        planner.plan_regional(goal="park", **{name: value})


def fragile(cell: Cell, limits: ToolLimits) -> Cell:
    return replace(cell, tool=replace(cell.tool, limits=limits))


def test_what_is_carried_limits_every_movement_with_it() -> None:
    limits = ToolLimits(speed=0.3, acceleration=2.0)
    cell = cell_from_yaml(cell_to_yaml(fragile(load_cell("open"), limits)), "fragile.yaml")
    assert cell.tool.limits == limits
    planner = Planner(cell, clock=lambda: 0.0)
    plan = planner.plan_regional(goal="park")
    speed, gain = judged(planner, plan.trajectory)
    assert speed <= 0.3 * (1.0 + ROUNDING)
    assert gain <= 2.0 * (1.0 + ROUNDING)
    fast = Planner("open", clock=lambda: 0.0).plan_regional(goal="park")
    assert not planner.evaluate(fast.trajectory).report.certified
