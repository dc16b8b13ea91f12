"""Two trees: what they call a path is one, however they are asked; and a request that makes no
sense is refused by name.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from _coal_shapes import CoalScene
from builds import every_build, slow_reference
from geometry_cases import (
    CAPSULES,
    COLUMNS,
    FLOOR,
    HOME,
    KR210,
    SELF_PAIRS,
    TCP,
    Body,
    FloatArray,
    box,
)

from ir_kernels import FREE, Chain, CollisionModel, KernelError, compiled
from ir_kernels.search import BidirectionalTree

SAFETY = 0.02
SCALE = np.array([1.0, 0.85, 0.75, 0.68, 0.63, 0.62])
BUDGET = 50_000
COAL = 1e-5  # [m] its distances of cylinders are iterated
# A column between both ends and a beam over them: neither the straight path nor one over the top is
# free.
GATE = (
    box("column", (2.0, 0.0, 1.2), (0.3, 0.3, 2.4)),
    box("beam", (2.0, 0.0, 2.6), (0.4, 2.0, 0.3)),
    FLOOR,
)
# A closed cell around a robot that stands in it.
WALLS = (
    box("left", (0.0, 0.65, 2.0), (8.0, 0.2, 8.0)),
    box("right", (0.0, -0.65, 2.0), (8.0, 0.2, 8.0)),
)


def model(bodies: tuple[Body, ...], capsules: tuple[Any, ...] = CAPSULES) -> CollisionModel:
    names = {capsule.name for capsule in capsules}
    own = [pair for pair in SELF_PAIRS if names.issuperset(pair)]
    return CollisionModel(Chain(KR210, tcp=TCP), capsules, bodies, own)


def turned(angle: float, stretched: bool = True) -> FloatArray:
    """An arm that reaches out, or the named home, turned about the vertical."""
    q = np.deg2rad([0.0, -60.0, 80.0, 0.0, 40.0, 0.0]) if stretched else HOME.copy()
    q[0] = np.deg2rad(angle)
    return q


def tree(
    collision: CollisionModel, start: FloatArray, goals: FloatArray, seed: int = 0, **more: Any
) -> BidirectionalTree:
    low = KR210.position_min
    high = KR210.position_max
    return BidirectionalTree(collision, start, goals, SAFETY, low, high, SCALE, seed, **more)


def grown(*arguments: Any, **more: Any) -> BidirectionalTree:
    found = tree(*arguments, **more)
    assert found.grow(BUDGET)
    return found


LEFT = turned(-60.0)
RIGHT = turned(100.0)


@pytest.fixture
def of_core(core: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Models and searches are made by this build; for the slow one the tool is all there is."""
    monkeypatch.setattr(compiled, "MODULE", core)
    return CAPSULES if core is not None else CAPSULES[9:]


@every_build("bodies, seed", [(bodies, seed) for bodies in (GATE, COLUMNS) for seed in range(3)])
def test_a_path_joins_the_ends_exactly_and_every_step_is_proved(
    of_core: Any, bodies: tuple[Body, ...], seed: int
) -> None:
    collision = model(bodies, of_core)
    found = grown(collision, LEFT, RIGHT[None], seed)
    path = found.path
    assert found.found
    assert found.goal_index == 0
    assert np.array_equal(path[[0, -1]], [LEFT, RIGHT])
    assert len(path) > 2, "the straight path must not be free, else this shows nothing"
    assert (path >= KR210.position_min).all()
    assert (path <= KR210.position_max).all()
    assert (np.abs(np.diff(path, axis=0)).max(axis=1) > 0.0).all()
    assert (
        collision.certify_edges(path[:-1].copy(), path[1:].copy(), SAFETY).verdict == FREE
    ).all()


def test_coal_finds_nothing_too_near_on_a_path() -> None:
    collision = model(COLUMNS)
    coal = CoalScene(CAPSULES, COLUMNS, gjk_tolerance=1e-9)
    for seed in range(2):
        path = grown(collision, LEFT, RIGHT[None], seed).path
        share = np.linspace(0.0, 1.0, 8)[:, None, None]
        q = (path[:-1] + share * np.diff(path, axis=0)).reshape(-1, 6)
        for poses in collision.chain.link_poses(np.ascontiguousarray(q)):
            nearest = min(coal.distance(p.kind, p.body_a, p.body_b, poses) for p in collision.pairs)
            assert nearest > SAFETY - COAL


def test_the_straight_path_is_taken_where_it_is_free(of_core: Any) -> None:
    collision = model((FLOOR,), of_core)
    found = grown(collision, LEFT, RIGHT[None])
    assert np.array_equal(found.path, [LEFT, RIGHT])
    assert found.edges <= 2
    assert np.array_equal(grown(collision, LEFT, LEFT[None]).path, [LEFT, LEFT])


def test_the_same_seed_gives_the_same_path_and_another_one_another(of_core: Any) -> None:
    collision = model(GATE, of_core)
    first, second, other = (grown(collision, LEFT, RIGHT[None], seed) for seed in (3, 3, 4))
    assert np.array_equal(first.path, second.path)
    assert first.edges == second.edges
    assert not np.array_equal(first.path, other.path)
    largest = grown(collision, LEFT, RIGHT[None], 2**64 - 1)
    assert largest.found


@pytest.mark.parametrize("size", [1, 7, 64])
@slow_reference
def test_slices_give_the_path_of_one_call(of_core: Any, size: int) -> None:
    collision = model(GATE, of_core)
    whole = grown(collision, LEFT, RIGHT[None], 5)
    sliced = tree(collision, LEFT, RIGHT[None], 5)
    granted = 0
    while not sliced.grow(size):
        granted += size
        assert sliced.edges == granted, (
            "no less, or a caller would wait for ever; no more than is allowed"
        )
        assert granted < whole.edges
    assert np.array_equal(sliced.path, whole.path)
    assert sliced.edges == whole.edges
    assert not sliced.nodes[0] == sliced.nodes[1] == 1
    before = sliced.edges
    assert sliced.grow(100)
    assert sliced.edges == before, "a path that is found costs nothing more"


def test_where_no_path_leads_the_budget_is_spent_and_the_gap_stated(of_core: Any) -> None:
    behind = box(
        "behind", (0.0, 0.0, 2.0), (0.2, 1.1, 8.0)
    )  # a tool without an arm could pass over the robot
    collision = model(WALLS if of_core == CAPSULES else (*WALLS, behind), of_core)
    start = turned(0.0, stretched=False)
    goal = turned(180.0, stretched=False)
    search = tree(collision, start, goal[None])
    straight = search.gap
    assert straight == pytest.approx(np.linalg.norm((goal - start) * SCALE), rel=1e-6)
    assert np.array_equal(search.gap_ends, [start, goal])
    budget = 600 if of_core == CAPSULES else 60
    assert not search.grow(budget)
    assert search.edges == budget
    assert not search.found
    assert search.goal_index == -1
    assert search.path.shape == (0, 6)
    assert 0.0 < search.gap < straight
    ends = search.gap_ends
    assert np.linalg.norm((ends[1] - ends[0]) * SCALE) == pytest.approx(search.gap, rel=1e-5)
    assert collision.is_free(ends, SAFETY).all()


def test_of_several_goals_one_that_can_be_reached_is_named(of_core: Any) -> None:
    collision = model(WALLS, of_core)
    start = turned(0.0, stretched=False)
    near = turned(4.0, stretched=False)
    inside = turned(15.0)
    across = turned(180.0, stretched=False)
    assert not collision.is_free(inside[None], SAFETY)[0]
    found = grown(collision, start, np.stack([across, inside, near]))
    assert found.goal_index == 2
    assert np.array_equal(found.path[-1], near)


@slow_reference
def test_lines_become_branches_as_far_as_they_are_free(of_core: Any) -> None:
    collision = model(GATE, of_core)
    a = grown(collision, LEFT, RIGHT[None], 1).path
    back = np.ascontiguousarray(a[1:-1][::-1])
    given = tree(collision, LEFT, RIGHT[None], 2, start_line=a[1:2], goal_lines=[back])
    assert given.grow(BUDGET)
    assert given.nodes[0] > 1
    assert given.nodes[1] >= len(a) - 1
    assert given.edges < 100, "the goal's line passes the gate: what is left is short"
    blocked = tree(
        collision, LEFT, RIGHT[None], 2, start_line=RIGHT[None], goal_lines=[np.empty((0, 6))]
    )
    assert blocked.grow(BUDGET)
    path = blocked.path
    assert np.array_equal(path[[0, -1]], [LEFT, RIGHT])
    assert (
        collision.certify_edges(path[:-1].copy(), path[1:].copy(), SAFETY).verdict == FREE
    ).all()


def test_threads_give_the_paths_of_one_thread() -> None:
    collision = model(COLUMNS)
    alone = [grown(collision, LEFT, RIGHT[None], seed).path for seed in range(8)]
    with ThreadPoolExecutor(2) as pool:
        beside = list(
            pool.map(lambda seed: grown(collision, LEFT, RIGHT[None], seed).path, range(8))
        )
    assert all(np.array_equal(a, b) for a, b in zip(alone, beside, strict=True))


def test_one_search_may_be_grown_by_two_threads_one_after_the_other() -> None:
    collision = model(COLUMNS)
    whole = grown(collision, LEFT, RIGHT[None], 1)
    shared = tree(collision, LEFT, RIGHT[None], 1)
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda _: shared.grow(20), range(whole.edges // 20 + 2)))
    assert np.array_equal(shared.path, whole.path)


def test_the_model_lives_as_long_as_its_search() -> None:
    collision = model(COLUMNS)
    expected = grown(collision, LEFT, RIGHT[None]).path
    search = tree(collision, LEFT, RIGHT[None])
    del collision
    assert search.grow(BUDGET)
    assert np.array_equal(search.path, expected)


FIRST = LEFT
GOALS = RIGHT[None]
NAN = np.full(6, np.nan)
FOLDED = turned(0.0) + np.deg2rad([0.0, 50.0, 0.0, 0.0, 0.0, 0.0])  # into the floor


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"start": LEFT[:5]}, "start has shape"),
        ({"start": NAN}, r"start\[0\] is nan"),
        ({"start": FOLDED}, "start is not free"),
        ({"start": LEFT + 4.0}, "start has joint"),
        ({"goals": RIGHT}, "goals has shape"),
        ({"goals": np.empty((0, 6))}, "goals is empty"),
        ({"goals": FOLDED[None]}, "goals holds no configuration that is free"),
        ({"goals": GOALS - 4.0}, "goals has joint"),
        ({"threshold": np.zeros(3)}, "threshold has shape"),
        ({"threshold": np.nan}, "threshold holds nan"),
        ({"low": np.zeros(5)}, "low has shape"),
        ({"low": KR210.position_max, "high": KR210.position_min}, "low is"),
        ({"high": NAN}, "high"),
        ({"scale": np.zeros(6)}, "scale holds 0.0"),
        ({"seed": -1}, "seed is -1"),
        ({"seed": 2**64}, "seed is 18446744073709551616"),
        ({"start_line": np.zeros((2, 5))}, "start_line has shape"),
        ({"start_line": LEFT[None] + 4.0}, "start_line has joint"),
        ({"goal_lines": []}, "goal_lines has 0 lines"),
        ({"goal_lines": [NAN[None]]}, r"goal_lines\[0\]"),
    ],
)
def test_arguments_that_make_no_sense_are_named(changed: dict[str, Any], said: str) -> None:
    usual = {
        "collision": model(GATE), "start": LEFT, "goals": GOALS, "threshold": SAFETY, "seed": 0,
        "low": KR210.position_min, "high": KR210.position_max, "scale": SCALE,
    }  # fmt: skip
    with pytest.raises(KernelError, match=said):
        BidirectionalTree(**{**usual, **changed})


def test_a_negative_budget_is_refused() -> None:
    with pytest.raises(KernelError, match="max_edges is -1"):
        tree(model(GATE), LEFT, GOALS).grow(-1)
    untouched = tree(model(GATE), LEFT, GOALS)
    assert not untouched.grow(0)
    assert untouched.edges == 0
