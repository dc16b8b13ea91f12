"""The genetic correction: what collides gets vias, what is free stays, and what leaves is
proved.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from asking import planned
from numpy.typing import NDArray

from ir_description import cell_from_yaml, load_cell, load_power_data
from ir_kernels.collision import FREE
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner.checks.free_space import FreeSpace
from ir_planner.curves.joint_spline import spline_through, to_ppoly, virtual_knots
from ir_planner.errors import CancelledError
from ir_planner.request.context import Work
from ir_planner.scene.movement_cost import movement_cost, path_cost
from ir_planner.scene.planning_scene import (
    PROOF_TOLERANCE,
    PlanningScene,
    load_text,
    scene_with,
)
from ir_planner.search import genetic_correction
from ir_planner.search.genetic_correction import Genetic, colliding_stretch, corrected
from ir_planner.search.population import Evolution, _Breeder, evolve, path_matrix
from ir_planner.search.registry import SEARCHES
from ir_planner.search.variety import evenly, first_different
from ir_values.errors import InvalidValueError

FloatArray = NDArray[np.float64]
SceneOf = Callable[[str], PlanningScene]
SETTINGS = Genetic()
S_M = 0.02
TASKS = [
    (cell, task.name, flip)
    for cell in ("open", "table_columns")
    for task in load_cell(cell).tasks
    for flip in (False, True)
]


def a_budget(edges: int = 10**9, cancelled: Callable[[], bool] = lambda: False) -> Work:
    return Work(edges, 1.0, lambda: 0.0, cancelled)


def space_of(scene: PlanningScene, budget: Work | None = None) -> FreeSpace:
    return FreeSpace.of(scene, S_M, budget or a_budget())


def ends(scene: PlanningScene, task: str, flip: bool = False) -> tuple[FloatArray, FloatArray]:
    asked = scene.cell.task(task)
    both = np.array(asked.start), np.array(asked.goal)
    return both[::-1] if flip else both  # type: ignore[return-value]


def clearance(path: FloatArray, scene: PlanningScene) -> float:
    """Least distance over places 2 mrad apart; the judge shares no code with the proofs."""
    smallest = np.inf
    for a, b in itertools.pairwise(path):
        count = int(np.ceil(np.abs(b - a).max() / 2e-3)) + 1
        line = np.linspace(a, b, count)
        smallest = min(smallest, float(scene.collision.distances(line).min()))
    return smallest


@pytest.mark.sampled
@pytest.mark.parametrize(("cell", "task", "flip"), TASKS)
@pytest.mark.parametrize(
    "seeds", [range(1), pytest.param(range(1, 30), marks=pytest.mark.long)], ids=str
)
def test_every_task_of_the_open_cells_is_corrected_with_every_seed(
    cell: str, task: str, flip: bool, seeds: range, scene_of: SceneOf
) -> None:
    scene = scene_of(cell)
    start, goal = ends(scene, task, flip)
    for seed in seeds:
        space = space_of(scene)
        found = corrected(start, goal, space, SETTINGS, np.random.default_rng(seed))
        assert found.paths, f"seed {seed}: {found.shortfall} m are missing"
        assert 1 <= len(found.paths) <= SETTINGS.paths
        costs = [path_cost(scene.weights, path) for path in found.paths]
        assert costs == sorted(costs)
        assert costs[0] >= float(movement_cost(scene.weights, start, goal)) * (1.0 - 1e-12)
        for path in found.paths:
            assert np.array_equal(path[[0, -1]], np.stack([start, goal]))
            assert ((path >= space.low) & (path <= space.high)).all()
            assert space.edges_free(path[:-1], path[1:]).all()
        if seed == 0:
            assert min(clearance(path, scene) for path in found.paths) > S_M - PROOF_TOLERANCE


def test_a_free_straight_movement_is_left_as_it_is(scene_of: SceneOf) -> None:
    scene = scene_of("open")
    start, goal = ends(scene, "home->p1")
    found = corrected(start, goal, space_of(scene), SETTINGS, np.random.default_rng(0))
    assert found.generations == 0
    assert np.array_equal(found.paths[0], np.stack([start, goal]))


def test_the_paths_are_different(scene_of: SceneOf) -> None:
    scene = scene_of("open")
    start, goal = ends(scene, "p1->p2")
    found = corrected(start, goal, space_of(scene), SETTINGS, np.random.default_rng(0))
    assert len(found.paths) == SETTINGS.paths
    assert first_different(found.paths, 10, SETTINGS.difference, evenly) == found.paths
    bent = found.paths[0] + np.linspace(0.0, 0.1, len(found.paths[0]))[:, None]
    assert len(first_different([found.paths[0], bent], 10, SETTINGS.difference, evenly)) == 1


def test_only_the_stretch_that_collides_is_taken_out(scene_of: SceneOf) -> None:
    scene = scene_of("open")
    space = space_of(scene)
    start, goal = ends(scene, "p1->p2")
    path = np.stack([start, goal])
    proof = space.certificates(path[:1], path[1:])
    before, after = colliding_stretch(path, proof, space, 0.0)
    assert np.array_equal(before[0], start)
    assert np.array_equal(after[-1], goal)

    def share(q: FloatArray) -> float:
        at = float((q - start) @ (goal - start) / ((goal - start) @ (goal - start)))
        assert np.allclose(q, start + at * (goal - start))
        return at

    begin = share(before[-1])
    end = share(after[0])
    dense = start + np.linspace(0.0, 1.0, 20_001)[:, None] * (goal - start)
    collides = np.flatnonzero(scene.collision.distances(dense).min(axis=1) <= S_M) / 20_000
    spacing = 0.02 / np.abs(goal - start).max()
    assert collides.min() - spacing <= begin < collides.min()
    assert collides.max() < end <= collides.max() + spacing
    wider_before, wider_after = colliding_stretch(path, proof, space, 0.5)
    length = end - begin
    assert share(wider_before[-1]) == pytest.approx(begin - 0.5 * length, abs=1.5 * spacing)
    assert share(wider_after[0]) == pytest.approx(end + 0.5 * length, abs=1.5 * spacing)


def test_what_is_free_before_and_after_stays(scene_of: SceneOf) -> None:
    scene = scene_of("open")
    space = space_of(scene)
    start, goal = ends(scene, "p1->p2")
    settings = replace(SETTINGS, margin=0.0)
    path = np.stack([start, goal])
    before, after = colliding_stretch(path, space.certificates(path[:1], path[1:]), space, 0.0)
    for found in corrected(start, goal, space, settings, np.random.default_rng(3)).paths:
        assert np.array_equal(found[: len(before)], before)
        assert np.array_equal(found[-len(after) :], after)


def test_a_path_with_two_colliding_stretches_gives_the_first(scene_of: SceneOf) -> None:
    scene = scene_of("open")
    space = space_of(scene)
    start, goal = ends(scene, "p1->p2")
    there_and_back = np.stack([start, goal, start])
    proof = space.certificates(there_and_back[:-1], there_and_back[1:])
    assert (proof.verdict != FREE).all()
    before, after = colliding_stretch(there_and_back, proof, space, 0.0)
    assert len(before) == 2
    assert np.array_equal(after[1:], there_and_back[1:])


@pytest.mark.parametrize("shape", ["polyline", "spline"])
@pytest.mark.parametrize("vias", [1, 2, 3])
def test_a_path_runs_from_start_to_end_evenly_and_through_its_vias(shape: str, vias: int) -> None:
    matrix = path_matrix(shape, vias, 25)
    assert matrix.sum(axis=1) == pytest.approx(np.ones(25))
    assert matrix[0] == pytest.approx(np.eye(vias + 2)[0], abs=1e-12)
    assert matrix[-1] == pytest.approx(np.eye(vias + 2)[-1], abs=1e-12)
    line = np.linspace(2.0, 5.0, vias + 2)
    assert matrix @ line == pytest.approx(np.linspace(2.0, 5.0, 25), abs=1e-3)


def test_the_spline_of_an_individual_is_that_of_eq_10() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(-1.0, 1.0, (4, 6))
    times = np.linspace(0.0, 1.0, 4)
    spline = to_ppoly(spline_through(points, times, virtual_knots(times)))
    path = path_matrix("spline", 2, 200) @ points
    fine = spline(np.linspace(0.0, 1.0, 40_001))
    nearest = [np.abs(fine - q).max(axis=1).min() for q in path]
    assert max(nearest) < 1e-3


def test_fitness_is_cost_plus_penalties_and_never_gets_worse(scene_of: SceneOf) -> None:
    scene = scene_of("table_columns")
    space = space_of(scene)
    start, goal = ends(scene, "side1->side2")
    breeder = _Breeder(start, goal, space, SETTINGS, np.random.default_rng(0))
    people = breeder._first()
    k = 7
    path = np.concatenate([start[None], people.vias[k], goal[None]])
    points = path_matrix("polyline", SETTINGS.vias, SETTINGS.samples) @ path
    lack = np.maximum(space.threshold - scene.collision.distances(points[1:-1]), 0.0).max(axis=1)
    cost = path_cost(scene.weights, points) / float(movement_cost(scene.weights, start, goal))
    expected = cost + SETTINGS.clearance_penalty * lack.mean() + (lack.max() > 0.0)
    assert people.fitness[k] == pytest.approx(expected, rel=1e-5)
    assert people.shortfall[k] == pytest.approx(
        float((space.threshold - scene.collision.distances(points[1:-1])).max()), abs=1e-5
    )
    best = people.fitness.reshape(SETTINGS.islands, -1).min(axis=1)
    for _ in range(10):
        people = breeder._next(people)
        now = people.fitness.reshape(SETTINGS.islands, -1)
        assert (np.diff(now, axis=1) >= 0.0).all()
        assert (now.min(axis=1) <= best).all()
        best = now.min(axis=1)


def test_vias_beyond_a_limit_cost(scene_of: SceneOf) -> None:
    scene = scene_of("open")
    start, goal = ends(scene, "p1->p2")
    breeder = _Breeder(start, goal, space_of(scene), SETTINGS, np.random.default_rng(0))
    vias = np.stack([start, goal])[None].copy()
    inside = breeder.evaluated(vias, np.array([0.1]))
    vias[0, 0, 3] = scene.cell.robot.position_max[3] + 0.5
    beyond = breeder.evaluated(vias, np.array([0.1]))
    assert inside.excess[0] == 0.0
    assert beyond.excess[0] > 0.0
    assert beyond.fitness[0] > inside.fitness[0] + SETTINGS.limit_penalty * beyond.excess[0]


def test_the_parting_step_lessens_what_is_missing(scene_of: SceneOf) -> None:
    scene = scene_of("open")
    start, goal = ends(scene, "p1->p2")
    breeder = _Breeder(start, goal, space_of(scene), SETTINGS, np.random.default_rng(0))
    people = breeder._first()
    rows = np.flatnonzero(people.shortfall > 0.01)
    assert len(rows) > 8
    step = breeder._parting(people, rows)
    pushed = breeder.evaluated(people.vias[rows] + 0.1 * step, people.spread[rows])
    assert (pushed.shortfall < people.shortfall[rows]).mean() > 0.7


def test_the_spline_of_eq_10_finds_paths_too(scene_of: SceneOf) -> None:
    scene = scene_of("table_columns")
    settings = replace(SETTINGS, shape="spline")
    start, goal = ends(scene, "tL->tR")
    space = space_of(scene)
    found = evolve(start, goal, space, settings, np.random.default_rng(0))
    assert found.paths
    for path in found.paths:
        assert len(path) == settings.samples
        assert space.edges_free(path[:-1], path[1:]).all()


def test_the_planner_genetic_answers_with_a_certified_movement_and_the_same_bytes(
    scene_of: SceneOf, options: PlanOptions
) -> None:
    scene = scene_of("open")
    start, goal = ends(scene, "p1->p2")

    def plan(seed: int) -> Any:
        return planned(
            start, goal, scene, replace(options, planner_id="genetic", seed=seed), a_budget(60_000)
        )

    first = plan(5)
    second = plan(5)
    other = plan(6)
    assert first.status.ok, first.status.message
    assert first.report.certified
    assert first.info.planner_id == "genetic"
    assert first.info.iterations == second.info.iterations
    assert first.trajectory.trajectory_id == second.trajectory.trajectory_id
    assert first.trajectory.trajectory_id != other.trajectory.trajectory_id


def test_settings_reach_the_planner(scene_of: SceneOf, options: PlanOptions) -> None:
    scene = scene_of("table_columns")
    start, goal = ends(scene, "side1->side2")
    by_name = replace(options, planner_id="genetic")
    few = replace(SETTINGS, population=4, islands=1, first=1, generations=1, attempts=1)
    plan = planned(start, goal, scene, by_name, a_budget(60_000), {**SEARCHES, "genetic": few})
    assert plan.status.code == StatusCode.PLANNING_FAILED
    assert "1 generations" in plan.status.message


CAGE = """
format: ir_cell/1
name: cage
description: Two walls that no path leads around.
robot: kr210_r2700_extra
floor: true
home_deg: [0, -90, 90, 0, 0, 0]
park_deg: [0, -125, 120, 0, 80, 0]
equipment:
  - name: walls
    pose: {xyz: [0, 0, 0]}
    zone: OPEN
    bodies:
      - {name: left, kind: box, size: [8, 0.2, 8], xyz: [0, 0.65, 2]}
      - {name: right, kind: box, size: [8, 0.2, 8], xyz: [0, -0.65, 2]}
"""


def caged(budget: Work, degrees: Any, options: PlanOptions) -> Any:
    cell = cell_from_yaml(CAGE)
    scene = scene_with(cell, load_text(cell), load_power_data())
    home = degrees(0, -90, 90, 0, 0, 0)
    across = degrees(180, -90, 90, 0, 0, 0)
    return planned(home, across, scene, replace(options, planner_id="genetic"), budget)


@pytest.mark.long
def test_a_failure_says_how_near_it_came_and_which_pair_blocks(
    degrees: Any, options: PlanOptions
) -> None:
    plan = caged(a_budget(60_000), degrees, options)
    assert plan.status.code == StatusCode.PLANNING_FAILED
    sentence = plan.status.message.partition("genetic (")[2].partition(")")[0]
    assert float(sentence.partition("lacks ")[2].split()[0]) > 0.0
    assert any(wall in sentence for wall in ("left", "right"))
    generations = SETTINGS.attempts * SETTINGS.generations
    assert f"the nearest of {generations} generations lacks" in sentence
    assert plan.info.iterations > generations


@pytest.mark.sampled
@pytest.mark.parametrize("most", [1, 2, 5, 50, 100, 300, 1000, 3333])
def test_work_is_charged_and_never_more_than_there_is(
    most: int, degrees: Any, options: PlanOptions
) -> None:
    generation = SETTINGS.population * SETTINGS.samples // 40 + SETTINGS.islands * (
        SETTINGS.vias + 1
    )
    plan = caged(a_budget(most), degrees, options)
    assert plan.status.code == StatusCode.PLANNING_FAILED
    assert most - SETTINGS.first * generation <= plan.info.iterations <= most


def test_a_cancel_is_heard_between_generations(degrees: Any, options: PlanOptions) -> None:
    asked = iter([False] * 6 + [True] * 1000)
    with pytest.raises(CancelledError):
        caged(a_budget(60_000, lambda: next(asked)), degrees, options)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        ({"population": 2}, "population is 2: it must be 4 .. 1000"),
        ({"shape": "arc"}, "known are spline, polyline"),
        (
            {"population": 8, "islands": 4},
            "elite is 2: it must be less than population / islands, which is 2",
        ),
        (
            {"spread_least": 2.0},
            "spread_least is 2 rad: it must be at most spread_most, which is 1.2 rad",
        ),
        (
            {"mutation": 0.005},
            "mutation_least is 0.01 rad: it must be at most mutation, which is 0.005 rad",
        ),
        ({"margin": float("nan")}, "margin is nan: it must be finite"),
    ],
)
def test_settings_that_make_no_sense_are_refused_with_a_sentence(
    values: Any, sentence: str
) -> None:
    with pytest.raises(InvalidValueError, match=sentence.replace(".", r"\.")):
        Genetic(**values)


def test_each_further_attempt_takes_four_times_the_margin(
    scene_of: SceneOf, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = scene_of("open")
    start, goal = next(
        ends(scene, task.name)
        for task in scene.cell.tasks
        if not space_of(scene).edges_free(*(end[None] for end in ends(scene, task.name)))[0]
    )
    margins: list[float] = []

    def stretch(path: FloatArray, proof: Any, space: FreeSpace, margin: float) -> Any:
        margins.append(margin)
        return path[:1], path[-1:]

    def nothing(a: FloatArray, *_: Any) -> Evolution:
        return Evolution([], 0.1, 0, a, 1)

    monkeypatch.setattr(genetic_correction, "colliding_stretch", stretch)
    monkeypatch.setattr(genetic_correction, "evolve", nothing)
    chosen = replace(SETTINGS, margin=0.5, attempts=3)
    corrected(start, goal, space_of(scene), chosen, np.random.default_rng(0))
    assert margins == pytest.approx([0.5, 2.0, 8.0])


def breeder(scene: PlanningScene, settings: Genetic) -> _Breeder:
    """Of the first task of `open` whose straight movement is not free."""
    space = space_of(scene)
    for task in scene.cell.tasks:
        a, b = ends(scene, task.name)
        if not space.edges_free(a[None], b[None])[0]:
            return _Breeder(a, b, space, settings, np.random.default_rng(0))
    raise AssertionError("all tasks are free")


def test_children_are_parted_from_the_worst_pair_by_what_is_missing(scene_of: SceneOf) -> None:
    """Judge: the pair's distance at the worst sample, before and after; small steps only."""
    scene = scene_of("open")
    one = breeder(scene, replace(SETTINGS, population=400))
    people = one._first()
    rows = np.flatnonzero((people.shortfall > 1e-3) & (people.shortfall < 0.03))
    assert len(rows) > 3
    steps = one._parting(people, rows)
    sample = people.sample[rows]
    which = np.arange(len(rows))

    def distance(vias: FloatArray) -> FloatArray:
        q = one.samples(vias)[sample, which]
        return scene.collision.distances(q)[which, people.pair[rows]]

    gained = distance(people.vias[rows] + steps) - distance(people.vias[rows])
    share = gained / people.shortfall[rows]
    assert 0.8 < np.median(share) < 2.2
    assert (share > 0.0).mean() > 0.9


@pytest.mark.parametrize("parting", [0.0, 1.0])
def test_a_share_of_the_children_is_parted(
    scene_of: SceneOf, monkeypatch: pytest.MonkeyPatch, parting: float
) -> None:
    """Nothing else changes a child here."""
    still = replace(SETTINGS, crossover=0.0, mutated_share=0.0, parting=parting)
    one = breeder(scene_of("open"), still)
    people = one._first()
    monkeypatch.setattr(one, "_parting", lambda _, rows: np.full_like(people.vias[rows], 1e-3))
    made: list[FloatArray] = []
    evaluated = one.evaluated

    def noted(vias: FloatArray, spread: FloatArray) -> Any:
        made.append(vias)
        return evaluated(vias, spread)

    monkeypatch.setattr(one, "evaluated", noted)
    one._next(people)
    parents = np.clip(people.vias + parting * 1e-3, one.space.low, one.space.high)
    known = {row.tobytes() for row in parents}
    assert all(row.tobytes() in known for row in made[0])
