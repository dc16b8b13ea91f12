"""Two arms that are proved to keep apart do so at every pair of instants, by Coal; what meets is
found.
"""

import coal
import numpy as np
import pytest
from _coal_shapes import along_z, transform
from geometry_cases import CAPSULES, KR210, shift

from ir_kernels import COLLIDES, FREE, Chain
from ir_kernels.swept import SweptArm, meeting
from ir_values.arrays import FloatArray

THRESHOLD = 0.02  # m
LOW = np.radians([-90.0, -120.0, 0.0, -90.0, -90.0, -90.0])
HIGH = np.radians([90.0, -30.0, 130.0, 90.0, 90.0, 90.0])


def motion(rng: np.random.Generator, segments: int = 3) -> tuple[FloatArray, FloatArray]:
    """A movement of cubics through drawn points, at rest at each."""
    points = rng.uniform(LOW, HIGH, (segments + 1, 6))
    seconds = rng.uniform(0.5, 2.0, segments)
    step = np.diff(points, axis=0)
    c = np.zeros((segments, 6, 4))
    c[:, :, 0] = points[:-1]
    c[:, :, 2] = 3.0 * step / seconds[:, None] ** 2
    c[:, :, 3] = -2.0 * step / seconds[:, None] ** 3
    return c, seconds


def joints(c: FloatArray, seconds: FloatArray, shares: FloatArray) -> FloatArray:
    """(N, 6): the movement at shares (N,) of each of its segments in turn."""
    segment = np.minimum((shares * len(c)).astype(int), len(c) - 1)
    t = (shares * len(c) - segment) * seconds[segment]
    return np.ascontiguousarray(sum(c[segment, :, k] * t[:, None] ** k for k in range(4)))


def judged(chains: tuple[Chain, Chain], q: tuple[FloatArray, FloatArray]) -> float:
    """The least distance [m] of the capsules of two arms over all pairs of rows, by Coal."""
    shapes = [coal.Capsule(c.radius, float(np.linalg.norm(c.p1 - c.p0))) for c in CAPSULES]
    frames = [along_z(c.p0, c.p1) for c in CAPSULES]
    placed = [
        [
            [transform(links[c.link] @ local) for c, local in zip(CAPSULES, frames, strict=True)]
            for links in chain.link_poses(rows)
        ]
        for chain, rows in zip(chains, q, strict=True)
    ]
    moving = [k for k, c in enumerate(CAPSULES) if c.link > 0]
    request = coal.DistanceRequest()
    return min(
        coal.distance(shapes[a], one[a], shapes[b], other[b], request, coal.DistanceResult())
        for one in placed[0]
        for other in placed[1]
        for a in moving
        for b in moving
    )


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(6))
def test_what_is_proved_free_is_free_at_drawn_pairs_of_instants(seed: int) -> None:
    rng = np.random.default_rng(seed)
    chains = Chain(KR210), Chain(KR210, shift((rng.uniform(1.5, 4.0), 0.5, 0.0), np.pi))
    motions = motion(rng), motion(rng)
    arms = [SweptArm(chain, CAPSULES, *each) for chain, each in zip(chains, motions, strict=True)]
    found = meeting(*arms, THRESHOLD)
    shares = [np.sort(rng.uniform(0.0, 1.0, 9)) for _ in range(2)]
    q = [joints(*each, share) for each, share in zip(motions, shares, strict=True)]
    least = judged(chains, (q[0], q[1]))
    if found.verdict == FREE:
        assert least > THRESHOLD - 1e-6
        return
    assert found.verdict == COLLIDES
    at = [
        joints(*each, np.array([share_of(each[1], time)]))
        for each, time in zip(motions, found.times, strict=True)
    ]
    assert found.distance <= THRESHOLD
    assert judged(chains, (at[0], at[1])) <= THRESHOLD + 1e-6


def share_of(seconds: FloatArray, time: float) -> float:
    """The share of the segments in turn at a time."""
    begins = np.concatenate([[0.0], np.cumsum(seconds)])
    return float(np.interp(time, begins, np.linspace(0.0, 1.0, len(begins))))


@pytest.mark.long
def test_the_order_of_arms_and_their_speed_change_nothing() -> None:
    rng = np.random.default_rng(11)
    chains = Chain(KR210), Chain(KR210, shift((2.6, 0.0, 0.0), np.pi))
    for _ in range(4):
        motions = [motion(rng), motion(rng)]
        arms = [SweptArm(c, CAPSULES, *each) for c, each in zip(chains, motions, strict=True)]
        slower = [
            SweptArm(c, CAPSULES, each[0] * 0.5 ** np.arange(4), 2.0 * each[1])
            for c, each in zip(chains, motions, strict=True)
        ]
        verdict = meeting(arms[0], arms[1], THRESHOLD).verdict
        assert meeting(arms[1], arms[0], THRESHOLD).verdict == verdict
        assert meeting(slower[0], arms[1], THRESHOLD).verdict == verdict


def test_standing_arms_are_movements_of_no_length() -> None:
    chains = Chain(KR210), Chain(KR210, shift((6.0, 0.0, 0.0), np.pi))
    q = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
    arms = [SweptArm.standing(chain, CAPSULES, q) for chain in chains]
    free = meeting(arms[0], arms[1], THRESHOLD)
    assert free.verdict == FREE
    distance = judged(chains, (q[None], q[None]))
    assert meeting(arms[0], arms[1], distance - 1e-5).verdict == FREE
    assert meeting(arms[0], arms[1], distance + 1e-5).verdict == COLLIDES
