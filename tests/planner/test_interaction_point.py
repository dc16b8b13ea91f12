"""Stage one: random starts, metric distances and set-back, acceptance and rejection (eqs. 1 to
6).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_kernels.ccd import CcdSettings, ccd
from ir_planner.configurations.ccd_search import (
    GAIN,
    NONE,
    PRINTED,
    SECANT,
    Descent,
    InteractionSettings,
    _Descent,
    descend,
    increments,
    shares_back,
)
from ir_planner.configurations.interaction_point import (
    branches,
    distinct_configurations,
    random_starts,
    searched_configurations,
)
from ir_planner.configurations.inverse_kinematics import free_configurations
from ir_planner.errors import RequestError
from ir_planner.planner import Planner
from ir_planner.request.context import Work
from ir_planner.request.goals import parse_goal
from ir_planner.scene.planning_scene import PlanningScene
from ir_values.arrays import FloatArray

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
distances = st.floats(0.0201, 1.0)


def test_starts_of_eq_1_fill_the_joint_range_as_a_truncated_normal() -> None:
    low = np.array([-3.0, 0.0])
    high = np.array([3.0, 1.0])
    starts = random_starts(low, high, 20_000, "truncated_normal", np.random.default_rng(0))
    assert (starts > low).all()  # those beyond a limit are drawn again, not put on it
    assert (starts < high).all()
    np.testing.assert_allclose(starts.mean(axis=0), 0.5 * (low + high), atol=0.02)
    # truncated at three sigmas the deviation is 0.9866 sigma, sigma a sixth of the range
    np.testing.assert_allclose(starts.std(axis=0), 0.9866 * (high - low) / 6.0, rtol=0.02)


def test_uniform_starts_are_an_option_and_seeds_repeat() -> None:
    low = np.zeros(6)
    high = np.ones(6)
    first, second = (
        random_starts(low, high, 500, "uniform", np.random.default_rng(4)) for _ in range(2)
    )
    assert np.array_equal(first, second)
    assert abs(first.std() - 1.0 / np.sqrt(12.0)) < 0.01


def test_eq_4_is_the_gain_of_every_metric_distance() -> None:
    before = np.array([[0.1, -0.02]])
    after = np.array([[0.07, 0.01]])
    np.testing.assert_allclose(increments(before, after), [[-0.03, 0.03]])


@given(d=distances, loss=st.floats(1e-3, 2.0))
@settings(max_examples=200, deadline=None)
def test_the_secant_step_of_eq_5_ends_at_the_safety_distance_or_beyond(
    d: float, loss: float
) -> None:
    margin = 0.02
    after = d - loss
    share = shares_back(np.array([[d]]), np.array([[after]]), np.array([margin]), SECANT, 0.05)[0]
    if after > margin:
        assert share == 0.0
    else:  # on the linear distance that the secant assumes
        assert 0.0 < share <= 1.0
        assert after + share * (d - after) > margin or share == 1.0


@pytest.mark.parametrize("starts", [1, 40])
def test_the_work_of_a_search_is_its_sweeps_of_all_starts(
    starts: int, scene_of: Callable[[str], PlanningScene]
) -> None:
    """At a pose out of reach no start arrives or collides there, so that all of them take every
    sweep.
    """
    scene = scene_of("open")
    pose = np.eye(4)
    pose[:3, 3] = 50.0, 0.0, 1.0
    budget = Work(10_000, np.inf, lambda: 0.0)
    chosen = InteractionSettings(sweeps=2)
    nothing = np.full(len(scene.collision.pairs), -np.inf)
    searched_configurations(pose, scene, nothing, HOME, starts, 0, chosen, budget)
    assert budget.iterations == 2 * starts


def test_a_search_ends_when_its_work_is_spent(scene_of: Callable[[str], PlanningScene]) -> None:
    scene = scene_of("demo")
    pose = scene.station("lathe_work").pose
    threshold = scene.thresholds(0.02, "lathe_work")
    budget = Work(30, np.inf, lambda: 0.0)
    searched_configurations(pose, scene, threshold, HOME, 32, 1, InteractionSettings(), budget)
    assert budget.iterations == 30


def test_the_gain_in_metres_hardly_moves_where_bodies_touch() -> None:
    threshold = np.array([0.02])
    far = shares_back(np.array([[0.4]]), np.array([[-0.1]]), threshold, GAIN, 0.05)
    touching = shares_back(np.array([[0.0201]]), np.array([[0.0199]]), threshold, GAIN, 0.05)
    assert far[0] == pytest.approx(0.5)
    assert touching[0] == pytest.approx(0.0002)


@given(before=st.floats(0.021, 2.0), after=st.floats(-2.0, 0.02))
def test_eq_5_as_printed_goes_back_by_the_ratio_of_the_distances(
    before: float, after: float
) -> None:
    """-(d'/d) of the step: nothing at touch, farther in where bodies overlap, at most a step."""
    share = shares_back(np.array([[before]]), np.array([[after]]), np.array([0.02]), PRINTED, 0.05)[
        0
    ]
    assert share == pytest.approx(max(after / before, -1.0), abs=1e-12)


def test_what_collided_before_the_step_is_not_set_back() -> None:
    share = shares_back(np.array([[-0.1]]), np.array([[-0.2]]), np.array([0.02]), SECANT, 0.05)
    assert share[0] == 0.0


@pytest.mark.sampled
@pytest.mark.parametrize("set_back", [SECANT, PRINTED, GAIN, NONE])
@pytest.mark.parametrize(
    ("cell", "station"), [("cnc_door", "cncL"), ("deep_box", "bin"), ("deep_box", "tun")]
)
def test_the_search_finds_a_part_of_the_complete_set(
    cell: str, station: str, set_back: str, scene_of: Callable[[str], PlanningScene], budget: Work
) -> None:
    scene = scene_of(cell)
    pose = scene.station(station).pose
    threshold = scene.thresholds(0.02, station)
    complete = free_configurations(pose, scene, threshold, HOME)
    chosen = InteractionSettings(set_back=set_back)
    found = searched_configurations(pose, scene, threshold, HOME, 32, 1, chosen, budget)
    assert len(found.q) > 0
    for q, branch in zip(found.q, found.branch, strict=True):
        same = np.abs(complete.q - q).max(axis=1)
        assert (
            same.min() < 1e-5
        )  # Newton's steps end at rounding; wrists near singular take more of it
        assert complete.branch[int(np.argmin(same))] == branch
    costs = np.abs(found.q - HOME) @ scene.weights
    assert (np.diff(costs) > -1e-5).all()


def test_without_the_set_back_bodies_are_in_no_step_and_sorted_out_at_the_pose(
    scene_of: Callable[[str], PlanningScene], budget: Work
) -> None:
    """Against the secant with nothing to keep: the same descents, of which the free ones are
    left.
    """
    scene = scene_of("deep_box")
    pose = np.array(scene.station("bin").pose)
    threshold = scene.thresholds(0.02)
    pose[:3, 3] += 0.3, 0.0, 0.0  # a finger in the wall: what arrives collides
    nothing = np.full(len(threshold), -1e3)
    robot = scene.cell.robot
    starts = random_starts(
        robot.position_min, robot.position_max, 40, "uniform", np.random.default_rng(1)
    )
    through = descend(pose, starts, scene, nothing, InteractionSettings(), budget)
    sorted_out = descend(pose, starts, scene, threshold, InteractionSettings(set_back=NONE), budget)
    free = through.q[scene.collision.is_free(through.q, threshold)]
    assert len(free) < len(through.q)
    assert np.array_equal(sorted_out.q, free)


def test_the_same_seed_gives_the_same_configurations(
    scene_of: Callable[[str], PlanningScene], budget: Work
) -> None:
    scene = scene_of("cnc_door")
    pose = scene.station("press").pose
    threshold = scene.thresholds(0.02, "press")
    first, second = (
        searched_configurations(
            pose, scene, threshold, HOME, 32, 5, InteractionSettings(), budget
        ).q
        for _ in range(2)
    )
    assert np.array_equal(first, second)


def test_every_start_is_accepted_or_rejected_with_a_reason(
    scene_of: Callable[[str], PlanningScene], budget: Work
) -> None:
    scene = scene_of("deep_box")
    pose = scene.station("bin").pose
    threshold = scene.thresholds(0.02, "bin")
    found = searched_configurations(
        pose, scene, threshold, HOME, 40, 2, InteractionSettings(), budget
    )
    at_the_pose = sum(n for reason, n in found.rejected.items() if reason.startswith("at the pose"))
    assert found.reached - at_the_pose + sum(found.rejected.values()) == 40
    assert any("too near bin_" in reason for reason in found.rejected)


def test_a_pose_out_of_reach_has_no_solution_and_says_so(planner: Planner) -> None:
    far = planner.compute_ik(
        parse_goal("X 5 Y 0 Z 1 A 0 B 90 C 0", planner.cell),
        method="ccd",
        safety_distance=0.02,
        near=HOME,
    )
    assert not far.solutions
    assert "not converged" in " ".join(rejection.reason for rejection in far.info.rejected)


def test_a_number_of_starts_beyond_its_bound_is_refused(planner: Planner) -> None:
    goal = parse_goal("lathe_work", planner.cell)
    for starts in (0, 1_000_000):
        with pytest.raises(RequestError, match="starts"):
            planner.compute_ik(
                goal, method="ccd", safety_distance=0.02, near=HOME, starts=starts, seed=0
            )


def test_an_unknown_method_lists_both(planner: Planner) -> None:
    with pytest.raises(RequestError, match="analytic, ccd"):
        planner.compute_ik(
            parse_goal("lathe_work", planner.cell), method="guess", safety_distance=0.02, near=HOME
        )


def test_near_twins_are_one_configuration() -> None:
    q = np.array([[0.0, 0.0], [1e-5, 0.0], [0.5, 0.0]])
    assert len(distinct_configurations(q)) == 2


def test_branches_are_those_of_the_closed_form(scene_of: Callable[[str], PlanningScene]) -> None:
    scene = scene_of("cnc_door")
    closed = scene.inverse_kinematics.solve(scene.station("press").pose[None])
    assert np.array_equal(branches(np.ascontiguousarray(closed.q), scene), closed.branch)


def test_a_budget_that_is_spent_ends_the_search(scene_of: Callable[[str], PlanningScene]) -> None:
    scene = scene_of("cnc_door")
    spent = Work(10, time.monotonic() - 1.0, time.monotonic)
    pose = scene.station("press").pose
    threshold = scene.thresholds(0.02, "press")
    found = searched_configurations(
        pose, scene, threshold, HOME, 8, 0, InteractionSettings(), spent
    )
    assert len(found.q) == 0
    assert spent.truncated


def replayed(
    q: FloatArray,
    aimed: float,
    reading: str,
    threshold: FloatArray,
    scene: PlanningScene,
) -> tuple[float, int]:
    """Where A2 ends that is to go from q (n,) to `aimed`, and how often it was set back."""
    before = scene.collision.distances(q[None])[0]
    robot = scene.cell.robot
    at = aimed
    for back in range(3):
        there = q.copy()
        there[1] = at
        after = scene.collision.distances(there[None])[0]
        near = (after <= threshold) & (before > threshold)
        if not near.any():
            return at, back
        d = before[near]
        end = after[near]
        if reading == SECANT:
            share = np.maximum(1.05 * (threshold[near] - end) / (d - end), 0.05)
        else:
            share = np.maximum(end / d, -1.0) if reading == PRINTED else d - end
        at -= min(float(share.max()), 1.0) * (at - q[1])
        at = min(max(at, float(robot.position_min[1])), float(robot.position_max[1]))
    return float(q[1]), 3


@pytest.mark.sampled
@pytest.mark.parametrize("at_a_limit", [False, True])
@pytest.mark.parametrize("reading", [SECANT, PRINTED, GAIN])
def test_a_step_that_collides_is_set_back_twice_at_most_and_else_taken_back(
    reading: str, at_a_limit: bool, scene_of: Callable[[str], PlanningScene]
) -> None:
    """Judge: each start by itself, by the formula of its worst pair."""
    scene = scene_of("demo")
    threshold = scene.thresholds(0.02, "lathe_work")
    robot = scene.cell.robot
    rng = np.random.default_rng(0)
    starts = random_starts(robot.position_min, robot.position_max, 400, "uniform", rng)
    value = rng.uniform(robot.position_min[1], robot.position_max[1], len(starts))
    if at_a_limit:
        ends_of_range = [robot.position_min[1], robot.position_max[1]]
        value = rng.choice(ends_of_range, len(starts))
    pose = np.array(scene.station("lathe_work").pose)
    descent = _Descent(pose, scene, threshold, InteractionSettings(set_back=reading))
    distance = scene.collision.distances(starts)
    found = descent._stepped(starts.copy(), 1, value.copy(), distance)[0]
    ends = set()
    for q, aimed, got in zip(starts, value.tolist(), found, strict=True):
        expected, back = replayed(q, aimed, reading, threshold, scene)
        ends.add(back)
        assert got[1] == pytest.approx(expected, abs=1e-12)
    assert {0, 3} < ends


def test_what_is_set_back_ends_at_the_joint_s_limit() -> None:
    """As printed a joint goes farther in where bodies overlap: here it would come out behind the
    body, beyond its limit.
    """

    def distances(q: FloatArray) -> FloatArray:
        return np.where(np.abs(q - 0.85) < 0.35, -0.9, 1.0)

    robot = SimpleNamespace(
        position_min=np.array([-1.0]), position_max=np.array([1.0]), joint_axis=np.zeros((1, 3))
    )
    scene = SimpleNamespace(
        cell=SimpleNamespace(robot=robot), collision=SimpleNamespace(distances=distances)
    )
    asked = InteractionSettings(set_back=PRINTED)
    descent = _Descent(np.eye(4), cast(PlanningScene, scene), np.array([0.02]), asked)
    start = np.zeros((1, 1))
    aimed = np.array([1.0])
    assert descent._stepped(start.copy(), 0, aimed, distances(start))[0].tolist() == [[0.0]]
    robot.position_max[0] = 3.0
    behind = descent._stepped(start.copy(), 0, aimed, distances(start))[0]
    assert behind == pytest.approx(np.array([[1.9]]))


def starts_for_the_lathe(scene: PlanningScene) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Starts (60, n) [rad], the pose (4, 4) they look for, and what pairs have to keep [m]."""
    robot = scene.cell.robot
    rng = np.random.default_rng(1)
    starts = random_starts(robot.position_min, robot.position_max, 60, "uniform", rng)
    pose = np.array(scene.station("lathe_work").pose)
    return starts, pose, scene.thresholds(0.02, "lathe_work")


def psi_of(q: FloatArray, pose: FloatArray, scene: PlanningScene) -> FloatArray:
    """Psi (N,) of eq. (2) at q (N, n)."""
    tcp = scene.chain.tcp_poses(q)
    place = ((tcp[:, :3, 3] - pose[:3, 3]) ** 2).sum(axis=1)
    turn = ((tcp[:, :3, :3] - pose[:3, :3]) ** 2).sum(axis=(1, 2))
    return np.asarray(place + 0.125 * turn)


def test_what_arrives_is_nearer_than_xi_and_what_does_not_is_not(
    scene_of: Callable[[str], PlanningScene],
) -> None:
    scene = scene_of("demo")
    starts, pose, threshold = starts_for_the_lathe(scene)
    asked = InteractionSettings(set_back=NONE, sweeps=12, finish_every=12, newton_steps=0)

    def search(xi: float) -> Descent:
        work = Work(10_000, np.inf, lambda: 0.0)
        return descend(pose, starts, scene, threshold, replace(asked, xi=xi), work)

    ends = np.array([track[-1] for track in search(1e-16).tracks])
    psi = psi_of(ends, pose, scene)
    ranked = np.sort(psi)
    for k in (5, 20):
        xi = 0.5 * (ranked[k] + ranked[k + 1])
        arrived = [outcome != "not converged" for outcome in search(float(xi)).outcome]
        assert np.array_equal(arrived, psi < xi)


def test_a_start_is_given_up_after_three_sweeps_in_a_row_without_gain(
    scene_of: Callable[[str], PlanningScene],
) -> None:
    """Judge: Psi of eq. (2) of every sweep."""
    scene = scene_of("demo")
    starts, pose, threshold = starts_for_the_lathe(scene)
    asked = InteractionSettings(sweeps=30, newton_steps=0)
    work = Work(10_000, np.inf, lambda: 0.0)
    found = descend(pose, starts, scene, threshold, asked, work)
    given_up = 0
    for track, outcome in zip(found.tracks, found.outcome, strict=True):
        if outcome.startswith("set back for good"):
            psi = psi_of(track, pose, scene)
            left = psi[1:] / psi[:-1]
            assert len(left) >= 3
            assert (left[-3:] > 0.98).all()
            given_up += 1
    assert given_up > 5


@pytest.mark.parametrize(("every", "sweeps"), [(2, 3), (3, 5)])
def test_newtons_steps_are_tried_after_every_so_many_sweeps_and_after_the_last(
    every: int, sweeps: int, scene_of: Callable[[str], PlanningScene]
) -> None:
    """Judge: Newton's steps from what each start has reached by then."""
    scene = scene_of("demo")
    robot = scene.cell.robot
    starts, pose, threshold = starts_for_the_lathe(scene)
    asked = InteractionSettings(sweeps=sweeps, finish_every=every, set_back=NONE)
    newton = CcdSettings(0.5, asked.xi, 0, asked.newton_steps)
    found = descend(pose, starts, scene, threshold, asked, Work(10_000, np.inf, lambda: 0.0))
    tried = sorted({*range(every, sweeps, every), sweeps})
    ended = set()
    for track, outcome in zip(found.tracks, found.outcome, strict=True):
        there = ccd(scene.chain, pose, track, robot.position_min, robot.position_max, newton)
        arrives = [k for k in tried if k < len(track) and there.psi[k] < asked.xi]
        if outcome == "not converged":
            assert not arrives
            assert len(track) == sweeps + 1
        else:
            assert len(track) == arrives[0] + 2  # the start, its sweeps, the pose
            ended.add(arrives[0])
    assert {every, sweeps} <= ended


def test_what_is_accepted_keeps_its_distance(scene_of: Callable[[str], PlanningScene]) -> None:
    """Judge: the distances of all pairs; the margin is moved by 50 um across that of a found
    one.
    """
    scene = scene_of("deep_box")
    pose = np.array(scene.station("bin").pose)
    asked = InteractionSettings(set_back=NONE)  # the descents don't depend on the margin

    def search(threshold: FloatArray) -> FloatArray:
        work = Work(10_000, np.inf, lambda: 0.0)
        return searched_configurations(pose, scene, threshold, HOME, 32, 1, asked, work).q

    threshold = scene.thresholds(0.02, "bin")
    found = search(threshold)
    left = (scene.collision.distances(found) - threshold).min(axis=1)
    least = threshold + left.min()
    assert len(search(least - 5e-5)) == len(found)
    assert len(search(least + 5e-5)) < len(found)
