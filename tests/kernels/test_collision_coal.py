"""Our distances against Coal's: equal where bodies are apart, of the same sign everywhere."""

import numpy as np
import pytest
from _coal_shapes import CoalScene
from geometry_cases import CAPSULES, COLUMNS, KR210, OPEN, SELF_PAIRS, TCP, Body, every_kind, sample

from ir_kernels import Chain, CollisionModel

AGREEMENT = 1e-6  # [m] both are exact; Coal iterates to this


@pytest.mark.parametrize(
    "bodies", [OPEN, COLUMNS, *(every_kind(np.random.default_rng(seed)) for seed in range(4))]
)
def test_distances_agree_with_coal_and_so_do_their_signs(bodies: tuple[Body, ...]) -> None:
    chain = Chain(KR210, tcp=TCP)
    model = CollisionModel(chain, CAPSULES, bodies, SELF_PAIRS)
    theirs = CoalScene(CAPSULES, bodies, gjk_tolerance=1e-9)
    q = sample(np.random.default_rng(7), 40)
    ours = model.distances(q)
    poses = chain.link_poses(q)
    expected = np.array(
        [[theirs.distance(*pair, links) for pair in model.pairs] for links in poses]
    )
    apart = expected > 0.0
    np.testing.assert_allclose(ours[apart], expected[apart], rtol=0.0, atol=AGREEMENT)
    assert not ((ours > AGREEMENT) & (expected < -AGREEMENT)).any()
    assert not ((ours < -AGREEMENT) & (expected > AGREEMENT)).any()


def test_the_nearest_pair_is_the_nearest_of_coal() -> None:
    chain = Chain(KR210, tcp=TCP)
    model = CollisionModel(chain, CAPSULES, COLUMNS, SELF_PAIRS)
    theirs = CoalScene(CAPSULES, COLUMNS, gjk_tolerance=1e-9)
    q = sample(np.random.default_rng(8), 60)
    near = model.min_distance(q)
    for row in np.flatnonzero(near.distance > 0.0):
        links = chain.link_poses(q[row : row + 1])[0]
        expected = min(theirs.distance(*pair, links) for pair in model.pairs)
        assert near.distance[row] == pytest.approx(expected, abs=AGREEMENT)
