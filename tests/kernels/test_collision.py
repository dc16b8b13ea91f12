"""Laws that distances, witnesses, gradients and checks obey for every configuration and scene."""

import numpy as np
import pytest
from geometry_cases import (
    AT_ZERO,
    CAPSULES,
    COLUMNS,
    FLOOR,
    KR210,
    OPEN,
    SELF_PAIRS,
    TCP,
    Body,
    FloatArray,
    Robot,
    box,
    cylinder,
    every_kind,
    probe,
    random_pose,
    sample,
    shift,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_kernels import Chain, CollisionModel, compiled
from ir_kernels.reference import chain as chain_reference
from ir_kernels.reference.model import Model

EXACT = 1e-9  # [m] double precision on lengths of some metres
IN_FLOATS = 2e-6  # [m] where lanes of floats choose between pairs
SCENES = [OPEN, COLUMNS, *(every_kind(np.random.default_rng(seed)) for seed in range(3))]


def kr210(bodies: tuple[Body, ...]) -> CollisionModel:
    return CollisionModel(Chain(KR210, tcp=TCP), CAPSULES, bodies, SELF_PAIRS)


@pytest.mark.sampled
@pytest.mark.parametrize("bodies", SCENES)
def test_compiled_and_reference_agree(bodies: tuple[Body, ...]) -> None:
    if compiled.MODULE is None:
        pytest.skip("nothing compiled to compare with")
    model = kr210(bodies)
    plain = Model(model._geometry)
    q = sample(np.random.default_rng(1), 20)
    np.testing.assert_allclose(model.distances(q), plain.distances(q), atol=EXACT)
    zero = np.zeros(len(model.pairs))
    near = model.min_distance(q)
    expected = plain.min_distance(q, zero)
    np.testing.assert_allclose(near.distance, expected[0], atol=IN_FLOATS)
    clear = np.abs(expected[0] - 0.05) > IN_FLOATS
    assert (model.is_free(q, 0.05) == plain.is_free(q, zero + 0.05))[clear].all()
    own = plain.witnesses(q, near.pair, True)
    np.testing.assert_allclose(near.distance, own[0], atol=EXACT)
    np.testing.assert_allclose(near.normal, own[3], atol=1e-5)
    np.testing.assert_allclose(model.gradients(q, near.pair), own[4], atol=1e-5)


@pytest.mark.parametrize("bodies", SCENES)
def test_points_normal_and_distance_fit_together(bodies: tuple[Body, ...]) -> None:
    model = kr210(bodies)
    q = sample(np.random.default_rng(2), 64)
    near = model.min_distance(q)
    np.testing.assert_allclose(np.linalg.norm(near.normal, axis=1), 1.0, atol=EXACT)
    np.testing.assert_allclose(
        near.point_a - near.point_b, near.distance[:, None] * near.normal, atol=1e-8
    )
    np.testing.assert_allclose(near.distance, model.distances(q).min(axis=1), atol=IN_FLOATS)


@pytest.mark.parametrize("bodies", SCENES)
def test_gradients_agree_with_finite_differences(bodies: tuple[Body, ...]) -> None:
    model = kr210(bodies)
    rng = np.random.default_rng(3)
    q = sample(rng, 100)
    pair = rng.integers(0, len(model.pairs), len(q))
    step = 1e-6 * np.eye(6)
    difference = np.stack(
        [
            model.witnesses(q + h, pair).distance - model.witnesses(q - h, pair).distance
            for h in step
        ],
        axis=1,
    )
    error = np.abs(model.gradients(q, pair) - difference / 2e-6).max(axis=1)
    assert np.median(error) < 1e-8
    assert (error < 1e-4).mean() > 0.95, "a kink now and then, no more"


@pytest.mark.parametrize("bodies", SCENES)
def test_a_lane_does_not_depend_on_its_neighbours(bodies: tuple[Body, ...]) -> None:
    model = kr210(bodies)
    q = sample(np.random.default_rng(4), 23)
    together = model.min_distance(q)
    for k, row in enumerate(q):
        alone = model.min_distance(row[None])
        assert alone.distance[0] == together.distance[k]
        assert alone.pair[0] == together.pair[k]
        assert (alone.point_a[0] == together.point_a[k]).all()


def test_moving_robot_and_scene_together_changes_no_distance() -> None:
    rng = np.random.default_rng(5)
    bodies = every_kind(rng)
    moved = random_pose(rng)
    here = CollisionModel(Chain(KR210, tcp=TCP), CAPSULES, bodies, SELF_PAIRS)
    carried = [Body(b.name, b.kind, moved @ b.pose, b.size, b.vertices) for b in bodies]
    there = CollisionModel(Chain(KR210, moved, TCP), CAPSULES, carried, SELF_PAIRS)
    q = sample(rng, 50)
    np.testing.assert_allclose(here.distances(q), there.distances(q), atol=EXACT)


def test_thousands_of_boxes_give_what_all_pairs_give() -> None:
    rng = np.random.default_rng(6)
    bodies = [
        Body(f"b{k}", "box", random_pose(rng, 3.0), rng.uniform(0.02, 0.3, 3)) for k in range(1500)
    ]
    model = CollisionModel(Chain(KR210, tcp=TCP), CAPSULES, bodies, SELF_PAIRS)
    q = sample(rng, 40)
    np.testing.assert_allclose(
        model.min_distance(q).distance, model.distances(q).min(axis=1), atol=IN_FLOATS
    )
    lowest = model.distances(q).min(axis=1)
    for threshold in (-0.3, -0.1, 0.0):
        decided = np.abs(lowest - threshold) > IN_FLOATS
        assert (model.is_free(q, threshold) == (lowest > threshold))[decided].all()


def test_a_hall_too_large_for_floats_is_computed_in_doubles() -> None:
    bodies = (
        box("hall", (0.0, 0.0, -30.0), (200.0, 200.0, 60.0)),
        box("far", (60.0, 0.0, 1.0), (1.0, 1.0, 2.0)),
    )
    model = CollisionModel(Chain(KR210, tcp=TCP), CAPSULES, bodies, ())
    q = sample(np.random.default_rng(9), 50)
    np.testing.assert_allclose(
        model.min_distance(q).distance, model.distances(q).min(axis=1), atol=EXACT
    )


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_no_translation_shorter_than_the_depth_parts_two_bodies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for body in every_kind(rng)[:4] + every_kind(rng)[5:]:
        centre = body.pose[:3, 3]
        p0, p1 = centre + rng.normal(0.0, 0.15, (2, 3))
        radius = float(rng.uniform(0.0, 0.1))
        near = probe(p0, p1, radius, body).witnesses(AT_ZERO, [0])
        depth = -float(near.distance[0])
        normal = near.normal[0]
        if depth <= 1e-6:
            continue

        def after(translation: FloatArray, body: Body = body) -> float:
            moved = probe(p0 + translation, p1 + translation, radius, body)  # noqa: B023
            return float(moved.witnesses(AT_ZERO, [0]).distance[0])

        assert after((depth + 1e-6) * normal) >= 0.0, f"the {body.kind} holds on"
        assert abs(after(0.5 * depth * normal) + 0.5 * depth) < 1e-6, "the depth shrinks in between"
        for direction in rng.normal(size=(40, 3)):
            shorter = 0.999 * depth * direction / np.linalg.norm(direction)
            assert after(shorter) < 0.0, f"a shorter translation out of the {body.kind} exists"


def test_a_threshold_per_pair_counts_for_its_pair_only() -> None:
    model = kr210(OPEN)
    q = sample(np.random.default_rng(10), 200)
    d = model.distances(q)
    rng = np.random.default_rng(11)
    threshold = rng.uniform(-0.2, 0.1, len(model.pairs))
    threshold[rng.random(len(threshold)) < 0.4] = -np.inf
    assert (model.is_free(q, threshold) == (d > threshold).all(axis=1)).mean() == 1.0
    near = model.min_distance(q, threshold)
    rows = np.arange(len(q))
    np.testing.assert_allclose(
        (d - threshold)[rows, near.pair], (d - threshold).min(axis=1), atol=IN_FLOATS
    )
    np.testing.assert_allclose(near.distance, d[rows, near.pair], atol=EXACT)


def test_without_a_pair_that_counts_there_is_no_nearest() -> None:
    model = CollisionModel(Chain(KR210), CAPSULES[:1], (FLOOR,), ())
    near = model.min_distance(np.zeros((3, 6)))
    assert model.pairs == ()
    assert (near.distance == np.inf).all()
    assert (near.pair == -1).all()
    assert model.is_free(np.zeros((3, 6)), 1.0).all()
    ignored = kr210(OPEN).min_distance(np.zeros((3, 6)), -np.inf)
    assert (ignored.pair == -1).all()


def test_the_base_and_ignored_pairs_are_not_kept() -> None:
    model = CollisionModel(
        Chain(KR210),
        CAPSULES,
        OPEN,
        SELF_PAIRS,
        [("t_part", "rack"), ("rack", "t_bar"), ("l4", "base")],
    )
    names = {pair[1:] for pair in model.pairs}
    assert not any(pair.kind == "ENVIRONMENT" and pair.body_a == "base" for pair in model.pairs)
    assert ("t_part", "rack") not in names
    assert ("t_bar", "rack") not in names
    assert ("l4", "base") not in names
    assert ("t_f1", "rack") in names
    kinds = [pair.kind for pair in model.pairs]
    assert kinds == sorted(kinds), "environment before self"


def test_a_chain_of_any_axes_agrees_with_the_product_of_transforms() -> None:
    rng = np.random.default_rng(12)
    axis = rng.normal(size=(7, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    robot = Robot(
        np.array([random_pose(rng, 0.5) for _ in range(7)]), axis, np.zeros(7), np.zeros(7)
    )
    base = random_pose(rng)
    tcp = random_pose(rng, 0.3)
    chain = Chain(robot, base, tcp)
    q = rng.uniform(-9.0, 9.0, (21, 7))
    q[3] = 3e5  # far beyond any joint, still an angle
    expected = chain_reference.link_poses(chain.joint_origin, chain.joint_axis, base, q)
    np.testing.assert_allclose(chain.link_poses(q), expected, atol=1e-9)
    h = 1e-6
    jacobian = chain.jacobian(q[4:])
    for j in range(7):
        step = h * np.eye(7)[j]
        moved = chain.tcp_poses(q[4:] + step) - chain.tcp_poses(q[4:] - step)
        np.testing.assert_allclose(jacobian[:, :3, j], moved[:, :3, 3] / (2 * h), atol=1e-7)
        turn = moved[:, :3, :3] @ chain.tcp_poses(q[4:])[:, :3, :3].transpose(0, 2, 1) / (2 * h)
        np.testing.assert_allclose(
            jacobian[:, 3:, j],
            np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], 1),
            atol=1e-7,
        )


def test_a_column_and_a_table_at_known_distances() -> None:
    up = np.array([0.0, 0.0, 1.0])
    column = cylinder("column", (1.0, 0.0, 0.5), 0.2, 1.0)
    assert probe(0.2 * up, 0.8 * up, 0.1, column).distances(AT_ZERO)[0, 0] == pytest.approx(0.7)
    table = box("table", (0.0, 0.0, -1.0), (2.0, 2.0, 1.0))
    assert probe(0.0 * up, up, 0.1, table).distances(AT_ZERO)[0, 0] == pytest.approx(0.4)
    assert probe(-0.6 * up, up, 0.1, table).distances(AT_ZERO)[0, 0] == pytest.approx(-0.2)
    sphere = Body("ball", "sphere", shift((0.0, 3.0, 0.0)), np.array([0.5, 0.0, 0.0]))
    assert probe(0.0 * up, 0.0 * up, 0.0, sphere).distances(AT_ZERO)[0, 0] == pytest.approx(2.5)
