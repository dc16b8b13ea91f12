"""Stage two: withdrawal by eq. (7) from every station in a zone, certified, ranked, with
reasons.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ir_description import Body, Cell, PowerData, load_cell
from ir_kernels import CollisionModel
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner.checks.evaluation import evaluate_trajectory
from ir_planner.checks.free_space import FreeSpace
from ir_planner.configurations.inverse_kinematics import free_configurations
from ir_planner.errors import CancelledError, RequestError
from ir_planner.planner import Planner
from ir_planner.program.program import ProgramRequest, plan_program
from ir_planner.request.context import Context, Journal, Work
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_planner.service.exit import Exit, WorkArea
from ir_planner.service.exit_paths import exit_searches, withdrawal
from ir_planner.service.service_movement import ServicePlan, ServiceRequest, plan_service
from ir_planner.service.stochastic_withdrawal import (
    ExitPopulation,
    ModifiedGa,
    _Walker,
    accumulated_mass,
    step_weights,
    withdraw,
)
from ir_values.arrays import FloatArray

IN_ZONES = [
    ("cnc_door", "cnc"),
    ("cnc_door", "cncL"),
    ("cnc_door", "press"),
    ("deep_box", "bin"),
    ("deep_box", "binhi"),
    ("deep_box", "tun"),
    ("demo", "infeed_pick"),
    ("demo", "lathe_work"),
    ("demo", "outfeed_place"),
]
SceneOf = Callable[[str], PlanningScene]


def a_budget(edges: int = 60_000) -> Work:
    return Work(edges, 1.0, lambda: 0.0)


def asked(scene: PlanningScene, work: Work, options: PlanOptions | None = None) -> Context:
    options = options or PlanOptions()
    return Context(scene, options, Journal(work, options.seed))


def planned(
    scene: PlanningScene, station: str, direction: str = "exit", **choices: Any
) -> ServicePlan:
    configuration = choices.pop("configuration", None)
    wanted = choices.pop("max_candidates", 2)
    options = PlanOptions(**{"planning_time": 60.0, **choices})
    request = ServiceRequest(
        scene.station(station), direction, configuration, np.array(scene.cell.park), wanted
    )
    return plan_service(request, asked(scene, a_budget(), options))


def problem_at(scene: PlanningScene, name: str, budget: Work) -> Exit:
    station = scene.station(name)
    free = free_configurations(station.pose, scene, scene.thresholds(0.02, name), scene.cell.park)
    return Exit.of(free.q[0], asked(scene, budget).at(name))


# -- eq. (7)


def test_mass_accumulates_from_the_tool_to_the_joint(demo_scene: PlanningScene) -> None:
    mass = demo_scene.cell.robot.link_mass
    total = accumulated_mass(mass, 155.0)
    assert total[-1] == pytest.approx(mass[-1] + 155.0)
    assert total[0] == pytest.approx(mass[1:].sum() + 155.0)
    assert (np.diff(total) < 0.0).all()


def test_literal_weights_grow_towards_the_base_and_inverse_ones_towards_the_tool() -> None:
    mass = np.array([100.0, 300.0, 200.0, 50.0])
    literal = step_weights(mass, 10.0, "literal")
    inverse = step_weights(mass, 10.0, "inverse")
    assert (np.diff(literal) < 0.0).all()
    assert (np.diff(inverse) > 0.0).all()
    assert literal.mean() == pytest.approx(1.0)
    assert inverse.mean() == pytest.approx(1.0)


@pytest.mark.parametrize("weighting", ["literal", "inverse"])
@pytest.mark.parametrize(("cell", "station"), IN_ZONES)
def test_the_modified_ga_leaves_over_certified_steps_while_d_grows(
    cell: str, station: str, weighting: str, scene_of: SceneOf
) -> None:
    scene = scene_of(cell)
    for seed in range(3):
        problem = problem_at(scene, station, a_budget())
        chosen = ModifiedGa(weighting=weighting)
        walk = withdraw(problem, chosen, np.random.default_rng(seed), 1)
        assert walk.paths, walk.rejected.most_common(3)
        path = walk.paths[0]
        assert np.array_equal(path[0], problem.interaction)
        assert problem.inside.edges_free(path[:-1], path[1:]).all()
        total = problem.area.total_distance(path)
        assert total[-1] > total[0]
        assert problem.area.zone_distance(path[-1:])[0] > 0.02


@pytest.fixture
def walker(demo_scene: PlanningScene) -> _Walker:
    """Before its first generation."""
    problem = problem_at(demo_scene, "lathe_work", a_budget())
    return _Walker(problem, ModifiedGa(), np.random.default_rng(3))


def alone(walker: _Walker, total: float = 1.0, sigma: float = 0.2) -> ExitPopulation:
    """A population of the interaction configuration."""
    return ExitPopulation(
        walker.nodes[0][None],
        np.array([total]),
        np.array([sigma]),
        np.full((1, 6), 0.1),
        np.zeros(1, dtype=np.int64),
        np.zeros(1, dtype=bool),
    )


@pytest.mark.parametrize("first", [1.0, 2.5])
def test_the_spread_of_eq_7_shrinks_with_the_relative_gain_of_d_and_grows_where_d_was_lost(
    walker: _Walker, first: float
) -> None:
    total = first * np.array([0.0, 0.9, 1.0, 1.1, 1.25, 3.0])
    q = np.repeat(walker.nodes[0][None], len(total), axis=0)
    children = walker._children(alone(walker, first), q, np.zeros(len(q), dtype=np.int64), total)
    assert children.sigma == pytest.approx([0.26, 0.24, 0.2, 0.16, 0.1, 0.05])


@pytest.mark.parametrize(("sigma", "total", "after"), [(0.9, 0.0, 1.0), (0.02, 3.0, 0.01)])
def test_the_spread_of_eq_7_stays_within_its_bounds(
    walker: _Walker, sigma: float, total: float, after: float
) -> None:
    q = walker.nodes[0][None]
    parents = alone(walker, sigma=sigma)
    children = walker._children(parents, q, np.zeros(1, dtype=np.int64), np.array([total]))
    assert children.sigma == pytest.approx([after])


@pytest.mark.parametrize("reading", ["guided", "printed"])
def test_eq_7_begins_with_copies_of_the_grasp_drawn_as_it_is_read(
    demo_scene: PlanningScene, monkeypatch: pytest.MonkeyPatch, reading: str
) -> None:
    problem = problem_at(demo_scene, "lathe_work", a_budget())
    chosen = ModifiedGa(reading=reading, spread=0.3, generations=1)
    walker = _Walker(problem, chosen, np.random.default_rng(3))
    drawn: dict[str, Any] = {}

    def copies(name: str) -> Any:
        def perturb(parents: ExitPopulation, owner: Any) -> Any:
            drawn[name] = parents
            return parents.q[owner]

        return perturb

    monkeypatch.setattr(walker, "_guided", copies("guided"))
    monkeypatch.setattr(walker, "_as_printed", copies("printed"))
    walker.run(1)
    assert list(drawn) == [reading]
    first = drawn[reading]
    assert np.array_equal(first.q, problem.interaction[None])
    assert first.sigma == pytest.approx([0.3])
    assert not first.step.any()
    assert not first.stuck.any()
    grasp = problem.area.total_distance(problem.interaction[None])
    assert first.total == pytest.approx(grasp)
    assert walker.first_total == pytest.approx(grasp[0])


def test_offspring_beyond_a_limit_are_dropped_by_name(walker: _Walker) -> None:
    joints = walker.scene.cell.robot.joint_names
    q = np.repeat(walker.nodes[0][None], 2 * len(joints), axis=0)
    each = np.arange(len(joints))
    q[each, each] = walker.inside.high + 1e-3
    q[len(joints) + each, each] = walker.inside.low - 1e-3
    free, _, collided = walker._free(q, np.zeros(len(q), dtype=np.int64), 1)
    assert len(free) == 0
    assert collided.all()
    assert walker.walk.rejected == {f"{name} beyond its limit": 2 for name in joints}


def test_offspring_are_ranked_by_d_and_few_of_one_configuration_survive(
    walker: _Walker, monkeypatch: pytest.MonkeyPatch
) -> None:
    """D is the first joint here. Judge: a loop over the ranks."""
    parents = alone(walker).of(np.zeros(16, dtype=np.int64))
    rng = np.random.default_rng(0)
    q = np.repeat(walker.nodes[0][None], 200, axis=0)
    q[:, 0] += 1e-6 * rng.permutation(200)
    owner = rng.integers(0, 5, 200)
    monkeypatch.setattr(WorkArea, "total_distance", lambda area, q: q[:, 0])
    monkeypatch.setattr(walker, "_guided", lambda parents, owner: q)
    monkeypatch.setattr(walker, "_free", lambda *_: (q, owner, np.zeros(16, dtype=bool)))
    children = walker._next(parents, 6)
    survivors: list[int] = []
    for k in np.argsort(-q[:, 0]):
        if len(survivors) < 16 and sum(owner[j] == owner[k] for j in survivors) < 3:
            survivors.append(k)
    assert np.array_equal(children.q, q[survivors])


@pytest.mark.parametrize("proved", [True, False])
def test_only_what_has_no_free_offspring_looks_around_unless_no_step_is_proved(
    walker: _Walker, monkeypatch: pytest.MonkeyPatch, proved: bool
) -> None:
    parents = alone(walker).of(np.zeros(3, dtype=np.int64))
    q = np.repeat(walker.nodes[0][None], 2, axis=0)
    owner = np.array([0, 2])
    collided = np.array([False, True, False])
    rows = np.arange(2 if proved else 0)
    monkeypatch.setattr(walker, "_free", lambda *_: (q, owner, collided))
    monkeypatch.setattr(walker, "_certified", lambda *_: rows)
    monkeypatch.setattr(walker, "_finished", lambda children: children)
    children = walker._next(parents, 6)
    assert children.stuck.tolist() == ([False, False, True] if proved else [True, True, True])


def test_the_search_of_eq_7_goes_on_until_the_paths_that_are_wanted_are_there(
    scene_of: SceneOf,
) -> None:
    for wanted in (1, 3):
        problem = problem_at(scene_of("cnc_door"), "press", a_budget())
        walk = withdraw(problem, ModifiedGa(), np.random.default_rng(0), wanted)
        assert len(walk.paths) >= wanted


def test_where_all_offspring_collide_eq_7_looks_one_radian_around(
    walker: _Walker, monkeypatch: pytest.MonkeyPatch
) -> None:
    def none_free(q: Any, owner: Any, count: int) -> Any:
        return q[:0], owner[:0], np.ones(count, dtype=bool)

    monkeypatch.setattr(walker, "_free", none_free)
    again = walker._next(alone(walker), 6)
    assert again.sigma == pytest.approx([1.0])
    assert not again.step.any()
    assert again.stuck.all()
    assert np.array_equal(again.q, walker.nodes[0][None])


def test_a_way_out_counts_only_where_d_has_grown(walker: _Walker) -> None:
    out = np.repeat(walker.scene.cell.park[None], 2, axis=0)
    children = walker._children(
        alone(walker),
        out,
        np.zeros(2, dtype=np.int64),
        walker.first_total * np.array([0.9, 1.1]),
    )
    assert len(walker._finished(children)) == 0
    assert len(walker.walk.paths) == 1
    assert walker.walk.rejected["outside, but D did not grow"] == 1


def test_link_3_in_the_zone_is_not_outside(demo_scene: PlanningScene) -> None:
    """Judge: a model of the capsules of links 3 and 4 alone, and one of those behind."""
    area = WorkArea.of(demo_scene, demo_scene.station("lathe_work"))
    assert area.zone is not None
    box = [Body("zone", "box", area.zone.pose, area.zone.size)]
    robot = demo_scene.cell.robot
    capsules = [*robot.capsules, *(one for load in demo_scene.loads for one in load.capsules)]
    q = np.random.default_rng(0).uniform(robot.position_min, robot.position_max, (4000, 6))
    arm, tool = (
        CollisionModel(demo_scene.chain, [c for c in capsules if c.link in links], box, ())
        .min_distance(q)
        .distance
        for links in ((3, 4), range(5, 9))
    )
    inside = (arm <= 0.02) & (tool > 0.02)
    assert inside.any()
    assert not area.left(q[inside], 0.02).any()
    assert np.array_equal(area.left(q, 0.02), (arm > 0.02) & (tool > 0.02))


def test_link_2_may_stay_in_the_zone(demo_cell: Cell, power: PowerData) -> None:
    """The zone is put into the upper arm at machine home."""
    machine = demo_cell.machine("lathe")
    home = np.array(demo_cell.machine_home)[None]
    chain = scene_with(demo_cell, load_text(demo_cell), power).chain
    upper_arm = max(
        (one for one in demo_cell.robot.capsules if one.link == 2),
        key=lambda one: float(np.linalg.norm(one.p1 - one.p0)),
    )
    middle = np.eye(4)
    middle[:3, 3] = 0.5 * (upper_arm.p0 + upper_arm.p1)
    inside = np.linalg.inv(machine.pose) @ chain.link_poses(home)[0, 2] @ middle
    zone = replace(machine.zone_in_equipment, pose=inside, size=np.full(3, 0.05))
    moved = replace(machine, zone_in_equipment=zone)
    others = (one for one in demo_cell.equipment if one is not machine)
    cell = replace(demo_cell, equipment=(*others, moved))
    scene = scene_with(cell, load_text(cell), power)
    assert WorkArea.of(scene, scene.station("lathe_work")).left(home, 0.02).all()


@pytest.mark.parametrize("name", ["lathe_work", "gauge_measure"])
def test_outside_is_beyond_the_zone_free_without_contacts_and_as_far_as_the_station_says(
    demo_scene: PlanningScene, name: str
) -> None:
    """Judge: every condition by itself, over drawn configurations."""
    problem = problem_at(demo_scene, name, a_budget())
    robot = demo_scene.cell.robot
    q = np.random.default_rng(1).uniform(robot.position_min, robot.position_max, (4000, 6))
    q[:200] = problem.interaction + np.random.default_rng(2).normal(0.0, 0.05, (200, 6))
    beyond = problem.area.zone_distance(q) > 0.02
    clear = (demo_scene.collision.distances(q) > demo_scene.thresholds(0.02)).all(axis=1)
    station = demo_scene.station(name)
    tool = demo_scene.chain.tcp_poses(q)[:, :3, 3]
    begins_outside = bool(problem.area.left(problem.interaction[None], 0.02)[0])
    assert begins_outside == (name == "gauge_measure")
    assert problem.least_distance == (station.approach_distance if begins_outside else 0.0)
    far = np.linalg.norm(tool - station.pose[:3, 3], axis=1) >= station.approach_distance
    expected = beyond & clear & (far | (not begins_outside))
    assert np.array_equal(problem.is_out(q), expected)
    assert expected.any()
    assert (beyond & ~clear).any()
    assert not begins_outside or (beyond & clear & ~far).any()


@pytest.mark.parametrize("stuck", [False, True])
@pytest.mark.parametrize("weighting", ["literal", "inverse"])
def test_eq_7_as_printed_draws_normal_steps_around_the_mean(
    weighting: str, stuck: bool, demo_scene: PlanningScene
) -> None:
    """Judge: moments of (q' - q) / W over many offspring: mu = step D / D_0 and sigma; after a
    collision 0 and 1 rad, for every joint alike and no two of them correlated.
    """
    problem = problem_at(demo_scene, "lathe_work", a_budget())
    chosen = ModifiedGa(reading="printed", weighting=weighting)
    walker = _Walker(problem, chosen, np.random.default_rng(3))
    sigma = 1.0 if stuck else 0.2
    parents = ExitPopulation(
        problem.interaction[None],
        np.array([1.7 * walker.first_total]),
        np.array([sigma]),
        np.zeros((1, 6)),
        np.zeros(1, dtype=np.int64),
        np.array([stuck]),
    )
    count = 20_000
    q = walker._as_printed(parents, np.zeros(count, dtype=np.int64))
    load = sum(load.mass for load in demo_scene.loads)
    drawn = (q - problem.interaction) / step_weights(
        demo_scene.cell.robot.link_mass, load, weighting
    )
    unsure = 5.0 * sigma / np.sqrt(count)
    assert drawn.mean(axis=0) == pytest.approx(0.0 if stuck else 1.7 * chosen.step, abs=unsure)
    assert drawn.std(axis=0) == pytest.approx(sigma, rel=0.03)
    assert np.corrcoef(drawn.T) == pytest.approx(np.eye(6), abs=0.05)


def drawn_guided(
    problem: Exit, growth: float, last: FloatArray, settings: ModifiedGa
) -> FloatArray:
    """q' - q (K, 6) of an offspring each of 20,000 copies of a configuration whose last step was
    `last` and whose D is `growth` times the first.
    """
    walker = _Walker(problem, settings, np.random.default_rng(3))
    count = 20_000
    parents = ExitPopulation(
        np.repeat(problem.interaction[None], count, axis=0),
        np.full(count, growth * walker.first_total),
        np.full(count, 0.2),
        np.repeat(last[None], count, axis=0),
        np.zeros(count, dtype=np.int64),
        np.zeros(count, dtype=bool),
    )
    return walker._guided(parents, np.arange(count)) - problem.interaction


def test_the_mean_of_eq_7_leads_out_along_the_tool_by_the_step(demo_scene: PlanningScene) -> None:
    """Judge: where the tool goes by finite differences. Half of the mean is drawn on average."""
    problem = problem_at(demo_scene, "lathe_work", a_budget())
    chosen = ModifiedGa(momentum=0.0, step=0.12)
    drawn = drawn_guided(problem, 1.0, np.zeros(6), chosen)
    out = 2.0 * drawn.mean(axis=0) / 0.12  # per metre
    share = 1e-5
    begin, end = demo_scene.chain.tcp_poses(
        np.stack([problem.interaction, problem.interaction + share * out])
    )
    moved = (end - begin) / share
    assert begin[:3, :3].T @ moved[:3, 3] == pytest.approx([-1.0, 0.0, 0.0], abs=0.05)
    assert np.abs(moved[:3, :3]).max() < 0.05


def test_the_mean_of_eq_7_grows_with_d_and_follows_the_last_step(
    demo_scene: PlanningScene,
) -> None:
    """Judge: half of grown ((1 - m/2) out + m/2 last), last as long as out, not weighted."""
    problem = problem_at(demo_scene, "lathe_work", a_budget())
    quiet = ModifiedGa(momentum=0.6, spread_decades=6.0, step=1.0)
    step = np.array([0.3, -0.1, 0.2, 0.1, -0.2, 0.4])
    straight = drawn_guided(problem, 1.0, np.zeros(6), replace(quiet, momentum=0.0))
    out = 2.0 * straight.mean(axis=0)
    last = step / np.linalg.norm(step) * np.linalg.norm(out)
    for growth, grown in ((0.1, 0.25), (1.0, 1.0), (2.0, 2.0), (9.0, 4.0)):
        drawn = drawn_guided(problem, growth, step, quiet)
        expected = 0.5 * grown * (0.7 * out + 0.3 * last)
        assert drawn.mean(axis=0) == pytest.approx(expected, abs=0.01 * max(grown, 1.0))
        assert np.abs(drawn.mean(axis=0) - 0.5 * grown * out).max() > 0.03 * grown


def test_the_spread_of_eq_7_is_weighted_and_of_several_decades(demo_scene: PlanningScene) -> None:
    """Judge: the moments of W s 10^-U n, U uniform up to 1.5, n normal; one U for all joints."""
    problem = problem_at(demo_scene, "lathe_work", a_budget())
    drawn = drawn_guided(problem, 1.0, np.zeros(6), ModifiedGa(step=0.001))
    load = sum(load.mass for load in demo_scene.loads)
    noise = drawn / step_weights(demo_scene.cell.robot.link_mass, load, "literal")
    decades = 3.0 * np.log(10.0)
    assert noise.std(axis=0) == pytest.approx(0.2 * np.sqrt((1.0 - 1e-3) / decades), rel=0.05)
    size = np.log10(np.linalg.norm(noise, axis=1))
    assert np.percentile(size, 97) - np.percentile(size, 3) == pytest.approx(1.5, abs=0.3)
    assert np.corrcoef(np.log(np.abs(noise).T))[0, 1] > 0.1


@pytest.mark.parametrize(("cell", "station"), IN_ZONES)
def test_eq_7_as_printed_leaves_over_certified_steps_or_says_why_not(
    cell: str, station: str, scene_of: SceneOf
) -> None:
    problem = problem_at(scene_of(cell), station, a_budget())
    walk = withdraw(problem, ModifiedGa(reading="printed"), np.random.default_rng(1), 1)
    for path in walk.paths:
        assert problem.inside.edges_free(path[:-1], path[1:]).all()
    assert walk.paths or sum(walk.rejected.values()) > 0


def test_a_walk_whose_candidates_all_collide_ends_without_a_path(demo_scene: PlanningScene) -> None:
    problem = problem_at(demo_scene, "lathe_work", a_budget())
    nowhere = replace(
        problem, inside=FreeSpace.of(demo_scene, 100.0, problem.inside.work, "lathe_work")
    )
    walk = withdraw(nowhere, ModifiedGa(generations=3), np.random.default_rng(0), 1)
    assert walk.paths == []
    assert walk.candidates == sum(walk.rejected.values())


def test_d_counts_only_what_moves_and_this_machine(demo_scene: PlanningScene) -> None:
    area = WorkArea.of(demo_scene, demo_scene.station("lathe_work"))
    q = np.array(demo_scene.cell.park)[None]
    bodies = {body.name for body in demo_scene.cell.machine("lathe").world_bodies()}
    fixed = {capsule.name for capsule in demo_scene.cell.robot.capsules if capsule.link == 0}
    wanted = [
        z
        for z, pair in enumerate(demo_scene.collision.pairs)
        if pair.body_b in bodies and pair.body_a not in fixed
    ]
    assert area.pairs == len(wanted)
    assert area.total_distance(q)[0] == pytest.approx(
        demo_scene.collision.distances(q)[0, wanted].sum(), abs=1e-5
    )


def test_every_candidate_of_the_search_is_kept_or_has_a_reason(scene_of: SceneOf) -> None:
    problem = problem_at(scene_of("deep_box"), "tun", a_budget())
    walk = withdraw(problem, ModifiedGa(), np.random.default_rng(0), 2)
    reasons = Counter(
        reason.split(" beyond")[0] if "beyond" in reason else reason for reason in walk.rejected
    )
    assert 0 < sum(walk.rejected.values()) < walk.candidates
    assert any("too near tun_" in reason for reason in reasons)


# -- the whole movement


@pytest.mark.sampled
@pytest.mark.parametrize("direction", ["exit", "entry"])
@pytest.mark.parametrize(
    ("cell", "station"), [("cnc_door", "cncL"), ("deep_box", "tun"), ("demo", "infeed_pick")]
)
def test_candidates_are_certified_distinct_and_ranked(
    cell: str, station: str, direction: str, scene_of: SceneOf
) -> None:
    scene = scene_of(cell)
    plan = planned(scene, station, direction, max_candidates=3, objective="time")
    assert plan.status.ok, plan.status.message
    times = [candidate.report.duration for candidate in plan.candidates]
    assert times == sorted(times)
    assert plan.info.timing == "synchronous"
    for candidate in plan.candidates:
        trajectory = candidate.trajectory
        assert trajectory is not None
        again = evaluate_trajectory(trajectory, scene, 0.02, station)
        assert again.verification.certified
        ends = (candidate.work, candidate.outside)
        first, last = ends if direction == "exit" else ends[::-1]
        assert np.array_equal(trajectory.positions[0], first)
        assert np.array_equal(trajectory.positions[-1], last)
        pose = scene.chain.tcp_poses(candidate.work[None])[0]
        np.testing.assert_allclose(pose, scene.station(station).pose, atol=1e-8)
    outer = np.array([candidate.outside for candidate in plan.candidates])
    for k in range(1, len(outer)):
        assert np.abs(outer[:k] - outer[k]).max(axis=1).min() > 0.05


def test_the_same_seed_gives_the_same_bytes_and_another_seed_another_path(
    scene_of: SceneOf,
) -> None:
    scene = scene_of("cnc_door")
    ids = [
        tuple(
            candidate.trajectory_id for candidate in planned(scene, "press", seed=seed).candidates
        )
        for seed in (3, 3, 4)
    ]
    assert ids[0] == ids[1]
    assert ids[0] != ids[2]


@pytest.mark.parametrize(("cell", "station"), IN_ZONES)
def test_the_tree_finds_a_path_where_it_is_asked_to(
    cell: str, station: str, scene_of: SceneOf
) -> None:
    plan = planned(scene_of(cell), station, planner_id="tree", max_candidates=1)
    assert plan.status.ok, plan.status.message
    assert plan.candidates[0].method == plan.info.planner_id == "tree"
    assert plan.candidates[0].report.certified


def test_the_tree_takes_over_where_the_modified_ga_gives_up(scene_of: SceneOf) -> None:
    scene = scene_of("deep_box")
    problem = problem_at(scene, "bin", a_budget())
    journal = Journal(problem.inside.work, 0)
    found = withdrawal(problem, 1, "", exit_searches(ModifiedGa(generations=1)), journal)
    assert [path.method for path in found.paths] == ["tree"]
    assert [stage.name for stage in journal.stages] == ["modified GA", "tree", "shorten"]


def test_a_configuration_of_the_request_is_where_the_movement_starts(scene_of: SceneOf) -> None:
    scene = scene_of("cnc_door")
    free = free_configurations(
        scene.station("press").pose, scene, scene.thresholds(0.02, "press"), scene.cell.park
    )
    plan = planned(scene, "press", configuration=free.q[-1])
    assert plan.status.ok, plan.status.message
    assert all(np.array_equal(candidate.work, free.q[-1]) for candidate in plan.candidates)


def test_outside_the_zone_already_the_tool_goes_by_the_approach_distance(
    demo_scene: PlanningScene,
) -> None:
    station = demo_scene.station("gauge_measure")
    plan = planned(demo_scene, station.name)
    assert plan.status.ok, plan.status.message
    for candidate in plan.candidates:
        ends = demo_scene.chain.tcp_poses(np.stack([candidate.work, candidate.outside]))[:, :3, 3]
        assert np.linalg.norm(ends[1] - ends[0]) >= station.approach_distance - 1e-9


def test_a_machine_that_is_switched_off_has_no_zone_to_leave(
    demo_cell: Cell, power: PowerData
) -> None:
    cell = demo_cell.with_equipment("lathe", enabled=False)
    scene = scene_with(cell, load_text(cell), power)
    plan = planned(scene, "lathe_work", max_candidates=1)
    assert plan.status.ok, plan.status.message
    best = plan.candidates[0]
    ends = scene.chain.tcp_poses(np.stack([best.work, best.outside]))[:, :3, 3]
    assert np.linalg.norm(ends[1] - ends[0]) >= scene.station("lathe_work").approach_distance - 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_limits_hold_at_10_khz_and_distances_between_the_points(
    seed: int, scene_of: SceneOf
) -> None:
    scene = scene_of("cnc_door")
    robot = scene_of("cnc_door").cell.robot
    plan = planned(scene, "cncL", seed=seed, max_candidates=1)
    trajectory = plan.candidates[0].trajectory
    assert trajectory is not None
    at = trajectory.sample(np.arange(0.0, trajectory.duration, 1e-4))
    slack = 1.0 + 1e-6
    assert (np.abs(at.qd) <= slack * robot.velocity_max).all()
    assert (np.abs(at.qdd) <= slack * robot.acceleration_max).all()
    assert (np.abs(at.qddd) <= slack * robot.jerk_max).all()
    assert (at.q >= robot.position_min - 1e-9).all()
    assert (at.q <= robot.position_max + 1e-9).all()
    torque = np.abs(scene.dynamics.inverse_dynamics(at.q, at.qd, at.qdd))
    assert (torque <= slack * scene.dynamics.torque_limit(at.qd)).all()
    assert scene.collision.min_distance(at.q).distance.min() > 0.02 - 1e-6


# -- failures


@pytest.fixture(scope="module")
def boxed(power: PowerData) -> PlanningScene:
    """The press with plates before its opening: the hole that is left takes the wrist, not the
    tool.
    """
    cell = load_cell("cnc_door")
    machine = cell.machine("press")
    hole = 0.26

    def plate(name: str, size: tuple[float, float, float], y: float, z: float) -> Body:
        pose = np.eye(4)
        pose[:3, 3] = (-0.5, y, z)
        return Body(name, "box", pose, np.array(size))

    plates = (
        plate("plate_left", (0.02, 0.6, 0.8), hole + 0.3, 1.1),
        plate("plate_right", (0.02, 0.6, 0.8), -hole - 0.3, 1.1),
        plate("plate_top", (0.02, 1.1, 0.6), 0.0, 1.1 + hole + 0.3),
        plate("plate_bottom", (0.02, 1.1, 0.6), 0.0, 1.1 - hole - 0.3),
    )
    closed = replace(machine, bodies=(*machine.bodies, *plates))
    boxed = replace(cell, equipment=tuple(closed if m is machine else m for m in cell.equipment))
    return scene_with(boxed, load_text(boxed), power)


def test_a_box_without_an_exit_is_answered_within_the_budget_and_names_its_walls(
    boxed: PlanningScene,
) -> None:
    request = ServiceRequest(boxed.station("press"), "exit", None, np.array(boxed.cell.park))
    budget = a_budget(3000)
    plan = plan_service(request, asked(boxed, budget))
    assert plan.status.code == StatusCode.PLANNING_FAILED
    assert "to leave the zone of press (clearance there" in plan.status.message
    assert "too near plate_" in plan.status.message
    assert "modified GA (0 paths" in plan.status.message
    assert "tree (no path)" in plan.status.message
    assert budget.iterations < 3200
    assert not budget.truncated
    assert any("plate_" in rejection.reason for rejection in plan.info.rejected)


def test_a_pose_out_of_reach_is_no_ik_solution(demo_scene: PlanningScene) -> None:
    station = demo_scene.station("gauge_measure")
    pose = np.array(station.pose)
    pose[:3, 3] += [3.0, 0.0, 0.0]
    request = ServiceRequest(
        replace(station, pose=pose), "exit", None, np.array(demo_scene.cell.park)
    )
    plan = plan_service(request, asked(demo_scene, a_budget()))
    assert plan.status.code == StatusCode.NO_IK_SOLUTION
    assert "gauge_measure" in plan.status.message


def test_no_free_configuration_says_the_best_clearance(demo_scene: PlanningScene) -> None:
    plan = planned(demo_scene, "lathe_work", safety_distance=0.5)
    assert plan.status.code == StatusCode.GOAL_IN_COLLISION
    assert "the best clearance is" in plan.status.message


def test_a_start_in_collision_is_refused_with_its_pair(scene_of: SceneOf) -> None:
    scene = scene_of("cnc_door")
    plan = planned(scene, "cnc", configuration=np.array([0.0, -0.2, 0.2, 0.0, 0.0, 0.0]))
    assert plan.status.code == StatusCode.START_STATE_IN_COLLISION
    assert "must be more than 20.0 mm" in plan.status.message
    entry = planned(scene, "cnc", "entry", configuration=np.array([0.0, -0.2, 0.2, 0.0, 0.0, 0.0]))
    assert entry.status.code == StatusCode.GOAL_IN_COLLISION


def test_without_an_exit_path_the_answer_says_how_far_it_came_and_what_obstructed(
    scene_of: SceneOf,
) -> None:
    scene = scene_of("cnc_door")
    options = PlanOptions(planning_time=60.0, max_iterations=400, planner_id="modified_ga")
    request = ServiceRequest(scene.station("cnc"), "exit", None, np.array(scene.cell.park), 1)
    searches = exit_searches(ModifiedGa(generations=1))
    plan = plan_service(request, asked(scene, a_budget(400), options), searches)
    assert plan.status.code == StatusCode.PLANNING_FAILED
    assert "lacks" in plan.status.message
    assert "clearance there" in plan.status.message
    assert "tried: " in plan.status.message
    assert not plan.candidates


def test_cancelling_ends_the_search(scene_of: SceneOf) -> None:
    scene = scene_of("deep_box")
    budget = Work(60_000, 1.0, lambda: 0.0, lambda: True)
    request = ServiceRequest(scene.station("tun"), "exit", None, np.array(scene.cell.park))
    with pytest.raises(CancelledError):
        plan_service(request, asked(scene, budget))


def test_unknown_choices_list_the_known(planner: Planner) -> None:
    park = np.array(planner.cell.park)
    for station, fields, word in (
        ("nowhere", {}, "lathe_work"),
        ("lathe_work", {"direction": "sideways"}, "exit, entry"),
        ("lathe_work", {"max_candidates": 0}, r"\[1, 20\]"),
        ("lathe_work", {"planner_id": "magic"}, "modified_ga, tree"),
    ):
        with pytest.raises(RequestError, match=word):
            planner.plan_service(station, near=park, **fields)  # type: ignore[arg-type]


# -- in a program


def test_a_program_withdraws_where_the_straight_line_does_not_leave_the_zone(
    power: PowerData,
) -> None:
    cell = load_cell("cnc_door")
    request = ProgramRequest(
        cell, power, ("cncL", "pal"), np.array(cell.park), PlanOptions(planning_time=60.0)
    )
    plan = plan_program(request, a_budget(), lambda phase, done, total, cost: None)
    assert plan.status.ok, plan.status.message
    exits = [m for m in plan.movements if m.kind == "service_exit"]
    scene = scene_with(cell, load_text(cell), power)
    area = WorkArea.of(scene, scene.station("cncL"))
    assert len(exits) == 1
    trajectory = exits[0].trajectory
    assert trajectory is not None
    assert area.zone_distance(trajectory.positions[-1:])[0] > 0.02
    assert all(m.report.certified for m in plan.movements if not m.is_pause)
