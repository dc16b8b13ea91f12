"""The contract of `Search`, for each registered search for free paths."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from ir_kernels.collision import FREE
from ir_planner import CancelledError, Goal, Planner, PlannerSettings, PlanOptions, RequestError
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.scene import TILT_TOLERANCE, PlanningScene, ToolCone, path_cost
from ir_planner.search import SEARCHES, Ends, Found, Search, keeps_upright, repeatable
from ir_values.settings import describe

SEED = 7
WORK = 60_000
LITTLE_WORK = 1_500  # where an edge is asked for in Python: it costs ten times as much
# They share an adapter, which is tested with `kpiece` and `prm`.
ALIKE = ("bkpiece", "lbkpiece", "rrt", "rrt_connect", "aorrtc")
NAMES = [pytest.param(name, marks=pytest.mark.long) if name in ALIKE else name for name in SEARCHES]
INTERPRETED = ("sbl", "kpiece", "prm", *ALIKE)
SAFETY_DISTANCE = 0.02  # m
SAMPLES = 0.01  # rad between the configurations at which distances are computed
# Tasks from easy to hard; a search need not solve all of them, but at least one.
TASKS = (
    ("open", "home->p1"),
    ("table_columns", "tL->tR"),
    ("cnc_door", "cnc->pal"),
    ("deep_box", "tun->bin"),
)
# Tasks for a tool that must stay upright: the straight movement is free in the first, whose goal
# leans by 15 deg, and blocked in the others. Again, at least one must be solved.
UPRIGHT_TASKS = (("open", "home->p1"), ("open", "p1->p2"), ("table_columns", "tL->tR"))
LARGEST_TILT = np.radians(20.0)
UP = np.array([0.0, 0.0, 1.0])
WALLED_IN = """
format: ir_cell/1
name: walled_in
robot: kr210_r2700_extra
equipment:
  - name: wall
    pose: {xyz: [0.0, 0.0, 0.0]}
    bodies:
      - {name: wall_left, kind: box, xyz: [0.0, 2.4, 2.5], size: [0.05, 3.6, 5.0]}
      - {name: wall_right, kind: box, xyz: [0.0, -2.4, 2.5], size: [0.05, 3.6, 5.0]}
      - {name: wall_above, kind: box, xyz: [0.0, 0.0, 3.6], size: [0.05, 4.8, 2.8]}
"""

Answer = tuple[Found, FreeSpace, Ends, int]  # with the work that it took


def unhurried(most: int = WORK, cancelled: Callable[[], bool] = lambda: False) -> Work:
    """Work on a clock that stands still: nothing is cut by time."""
    return Work(most, 1.0, lambda: 0.0, cancelled)


@cache
def scene_of(cell: str) -> PlanningScene:
    planner = Planner(cell, clock=itertools.repeat(0.0).__next__)
    return planner.scene()


@pytest.fixture(params=NAMES)
def search(request: pytest.FixtureRequest) -> Search:
    return SEARCHES[request.param]


def asked(scene: PlanningScene, task: str) -> Ends:
    """The task's start and its one goal."""
    chosen = scene.cell.task(task)
    return Ends(np.array(chosen.start), np.array([chosen.goal]))


def enough_work(search: Search) -> Work:
    """In which a search of this kind solves a task or two within seconds."""
    interpreted = any(search is SEARCHES[name] for name in INTERPRETED)
    return unhurried(LITTLE_WORK if interpreted else WORK)


def upright_cone(scene: PlanningScene, start: np.ndarray) -> ToolCone:
    """In which the axis of the tool stays that points up at the start (n,)."""
    rotation = scene.chain.tcp_poses(start[None])[0, :3, :3]
    return ToolCone(scene.chain, rotation.T @ UP, UP, LARGEST_TILT)


def answers_again(search: Search, seed: int = SEED) -> list[Answer]:
    """The same, searched for once more."""
    found = []
    for cell, task in TASKS:
        scene = scene_of(cell)
        space = FreeSpace.of(scene, SAFETY_DISTANCE, enough_work(search))
        ends = asked(scene, task)
        paths = search.find(ends, space, seed)
        found.append((paths, space, ends, space.work.iterations))
    return found


answers: Any = cache(answers_again)
"""What the search finds for every task."""


def sampled(path: np.ndarray) -> np.ndarray:
    """Configurations (K, n) along a path, no joint moving more than SAMPLES from one to the
    next.
    """
    parts = [
        np.linspace(a, b, 2 + int(np.abs(b - a).max() / SAMPLES))
        for a, b in itertools.pairwise(path)
    ]
    return np.concatenate(parts)


def test_paths_join_the_ends_and_are_free(search: Search) -> None:
    solved = 0
    for found, space, ends, _ in answers(search):
        for path in found.paths:
            solved += 1
            assert np.array_equal(path[0], ends.start)
            assert any(np.array_equal(path[-1], goal) for goal in ends.goals)
            assert (path >= space.low).all()
            assert (path <= space.high).all()
            assert (space.certificates(path[:-1].copy(), path[1:].copy()).verdict == FREE).all()
            assert (space.scene.collision.distances(sampled(path)) > space.threshold - 1e-6).all()
    assert solved > 0


def test_the_cheapest_path_by_w_is_the_first(search: Search) -> None:
    for found, space, _, _ in answers(search):
        costs = [path_cost(space.scene.weights, path) for path in found.paths]
        assert costs == sorted(costs)


@pytest.mark.parametrize(
    "name", [name for name in NAMES if not isinstance(name, str) or repeatable(SEARCHES[name])]
)
def test_the_same_seed_gives_the_same_bytes(name: str) -> None:
    search = SEARCHES[name]
    for (one, _, _, spent), (other, _, _, again) in zip(
        answers(search), answers_again(search), strict=True
    ):
        assert [path.tobytes() for path in one.paths] == [path.tobytes() for path in other.paths]
        assert one.note == other.note
        assert spent == again


def paths_keep_the_tool_upright(search: Search) -> None:
    """Fails where a path leaves the cone of its space, or none is found."""
    solved = 0
    for cell, task in UPRIGHT_TASKS:
        scene = scene_of(cell)
        ends = asked(scene, task)
        cone = upright_cone(scene, ends.start)
        space = FreeSpace.of(scene, SAFETY_DISTANCE, enough_work(search), cone=cone)
        for path in search.find(ends, space, SEED).paths:
            solved += 1
            largest = float(cone.tilts(sampled(path)).max())
            assert largest <= LARGEST_TILT + TILT_TOLERANCE, "the tool leans too far"
            assert cone.edges_held(path[:-1].copy(), path[1:].copy()).all()
    assert solved > 0


@pytest.mark.parametrize("name", [name for name in SEARCHES if keeps_upright(SEARCHES[name])])
def test_a_search_that_says_so_keeps_the_tool_in_the_cone(name: str) -> None:
    paths_keep_the_tool_upright(SEARCHES[name])


def test_the_contract_notices_a_search_that_lets_the_tool_lean() -> None:
    with pytest.raises(AssertionError, match="leans too far"):
        paths_keep_the_tool_upright(SEARCHES["genetic"])


def test_work_is_charged(search: Search) -> None:
    assert all(spent > 0 for _, _, _, spent in answers(search))


@pytest.mark.parametrize("most", [1, 300])
def test_it_ends_when_its_work_is_spent(search: Search, most: int) -> None:
    """A batch that has begun may be finished: at most as much again as a first look costs."""
    scene = scene_of("deep_box")
    space = FreeSpace.of(scene, SAFETY_DISTANCE, unhurried(most))
    search.find(asked(scene, "tun->bin"), space, SEED)
    assert space.work.iterations <= most + 2_000


def test_it_stops_when_it_is_asked_to(search: Search) -> None:
    scene = scene_of("deep_box")
    space = FreeSpace.of(scene, SAFETY_DISTANCE, unhurried(cancelled=lambda: True))
    with pytest.raises(CancelledError):
        search.find(asked(scene, "tun->bin"), space, SEED)


def test_it_finds_nothing_where_no_path_leads(search: Search) -> None:
    """The ends lie on different sides of a wall that nothing passes."""
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    planner.set_cell(text=WALLED_IN)
    scene = planner.scene()
    ends = Ends(
        np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]),
        np.radians([[180.0, -90.0, 90.0, 0.0, 0.0, 0.0]]),
    )
    reach = FreeSpace.of(scene, SAFETY_DISTANCE, unhurried())
    assert reach.states_free(np.vstack((ends.start, ends.goals))).all()
    space = FreeSpace.of(scene, SAFETY_DISTANCE, unhurried(2_000))
    assert search.find(ends, space, SEED).paths == []


def test_its_settings_are_fields_with_a_sentence_and_a_range(search: Search) -> None:
    assert dataclasses.is_dataclass(search)
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(search, "anything", 1)  # noqa: B010 - no field of it
    for setting in describe(type(search)):
        assert setting.sentence.endswith(".")
        assert setting.bounds or setting.type is bool, f"{setting.name} has no range"
    assert (type(search).__doc__ or "").split("\n\n")[0].rstrip().endswith(".")


@pytest.mark.parametrize("name", NAMES)
def test_a_request_can_ask_for_it_by_name(name: str) -> None:
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    task = planner.set_cell("open").tasks[0]
    plan = planner.plan_regional(
        start=np.array(task.start),
        goal=Goal(configuration=np.array(task.goal)),
        options=PlanOptions(planner_id=name),
    )
    assert plan.info.planner_id == name
    assert plan.report.certified or not plan.status.ok
    assert plan.info.stages[0].name == name
    assert plan.info.stages[0].note


def test_an_unknown_name_lists_the_known() -> None:
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    task = planner.set_cell("open").tasks[0]
    options = PlanOptions(planner_id="teleport")
    with pytest.raises(RequestError) as refused:
        planner.plan_regional(
            start=np.array(task.start),
            goal=Goal(configuration=np.array(task.goal)),
            options=options,
        )
    assert all(name in str(refused.value) for name in SEARCHES)


def test_the_settings_tree_holds_every_search() -> None:
    searches = PlannerSettings().searches
    assert list(searches) == list(SEARCHES)


@dataclasses.dataclass(frozen=True)
class Careless:
    """Answers with the straight movement, free or not, and looks at nothing."""

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        return Found([np.stack([ends.start, ends.goals[0]])])


@pytest.mark.parametrize(
    "contract",
    [
        test_paths_join_the_ends_and_are_free,
        test_work_is_charged,
        test_it_finds_nothing_where_no_path_leads,
    ],
)
def test_the_contract_notices_a_search_that_breaks_it(contract: Callable[[Search], None]) -> None:
    with pytest.raises(AssertionError):
        contract(Careless())
