"""A proof of the torque limits by interval arithmetic over pieces of the trajectory, halved where
it isn't sharp.

Over a piece the torque lies in its enclosure (`enclosures`).
"""

import numpy as np

from ir_kernels.dynamics_data import DynamicsData
from ir_kernels.reference import dynamics
from ir_kernels.reference.enclosures import Pieces, enclosure, pieces_of
from ir_kernels.reference.limits import derivative, evaluate
from ir_values.arrays import FloatArray, IntArray

FIRST_PIECE = 0.05  # s, longest piece to begin with
FEWEST_PIECES = 8  # of a segment to begin with
SHORTEST = 1e-7  # of a segment: pieces below this are not halved any more
REST = 1e-9  # rad/s: below, a sample lets Coulomb friction have either sign
ROUNDING_MARGIN = 1e-9  # of the limit


def least_limit(
    data: DynamicsData, joint: int, slowest: FloatArray, fastest: FloatArray
) -> FloatArray:
    """Smallest torque available (K,) over the speeds slowest..fastest (K,)."""
    speeds = data.envelope_speed[joint]
    torques = data.envelope_torque[joint]

    def limit(speed: FloatArray) -> FloatArray:
        found: FloatArray = np.where(
            speed < speeds[0], torques[0], np.interp(speed, speeds, torques[1:])
        )
        return found

    least = np.minimum(limit(slowest), limit(fastest))
    for speed, torque in zip(speeds, torques[1:], strict=True):
        least = np.where((slowest <= speed) & (speed <= fastest), np.minimum(least, torque), least)
    return np.asarray(least)


def upper_ratios(
    data: DynamicsData, coefficients: FloatArray, rests: FloatArray, pieces: Pieces
) -> FloatArray:
    """(K, n): |tau| / limit is nowhere in a piece above this."""
    found = enclosure(data, coefficients, rests, pieces)
    ratio = np.empty((len(pieces.segment), data.n))
    for j in range(data.n):
        tau = found.torque[j].v
        friction = found.coulomb[j]
        speed = found.speed[j].v
        still = rests[pieces.segment, j]
        size = np.maximum(np.abs(tau.lo + friction.lo), np.abs(tau.hi + friction.hi))
        ends = np.abs(speed.lo), np.abs(speed.hi)
        slowest = np.where(still | ((speed.lo <= 0.0) & (speed.hi >= 0.0)), 0.0, np.minimum(*ends))
        fastest = np.where(still, 0.0, np.maximum(*ends))
        ratio[:, j] = size / least_limit(data, j, slowest, fastest) + ROUNDING_MARGIN
    return ratio


def sampled_ratios(
    data: DynamicsData,
    coefficients: FloatArray,
    rests: FloatArray,
    segment: IntArray,
    t: FloatArray,
) -> FloatArray:
    """(K, n): |tau| / limit at local times t (K,) of the segments (K,)."""
    c = coefficients[segment]
    motion = []
    for _ in range(3):
        motion.append(evaluate(c, t[:, None, None])[..., 0])
        c = derivative(c) if c.shape[2] > 1 else 0.0 * c
    q, qd, qdd = motion
    smooth = dynamics.inverse_dynamics(data, q, qd, qdd) - data.coulomb * np.sign(qd)
    moving = np.abs(smooth + data.coulomb * np.sign(qd))
    slow = np.where(np.abs(qd) < REST, np.abs(smooth) + data.coulomb, moving)
    size = np.where(rests[segment], np.abs(smooth), slow)
    return np.asarray(size / dynamics.torque_limit(data, qd))


def torque_bounds(
    data: DynamicsData, coefficients: FloatArray, durations: FloatArray, tolerance: float, most: int
) -> tuple[FloatArray, FloatArray, FloatArray, int]:
    """Upper bound, largest sample, its time (n,), and how many intervals were examined."""
    n = data.n
    upper = np.zeros(n)
    sampled = np.full(n, -1.0)
    time = np.zeros(n)
    rests = (coefficients[:, :, 1:] == 0.0).all(axis=2)
    start = np.concatenate([[0.0], np.cumsum(durations)[:-1]])
    counts = np.maximum(FEWEST_PIECES, np.ceil(durations / FIRST_PIECE)).astype(int)
    pieces = pieces_of(durations, counts)
    spent = 0
    while len(pieces.segment):
        bound = upper_ratios(data, coefficients, rests, pieces)
        for t in (pieces.begin, 0.5 * (pieces.begin + pieces.end), pieces.end):
            ratio = sampled_ratios(data, coefficients, rests, pieces.segment, t)
            worst = ratio.argmax(axis=0)
            largest = ratio[worst, np.arange(n)]
            when = (start[pieces.segment] + t)[worst]
            time = np.where(largest > sampled, when, time)
            sampled = np.maximum(sampled, largest)
        spent += len(pieces.segment)
        sharp = (
            (bound <= sampled + tolerance * np.maximum(sampled, 1.0))
            & ~((sampled <= 1.0) & (bound > 1.0))
        ).all(axis=1)
        short = pieces.end - pieces.begin <= SHORTEST * durations[pieces.segment]
        halve = ~sharp & ~short
        halve &= spent + 2 * np.cumsum(halve) <= most
        upper = np.maximum(upper, bound[~halve].max(axis=0, initial=0.0))
        middle = 0.5 * (pieces.begin + pieces.end)
        pieces = Pieces(
            np.repeat(pieces.segment[halve], 2),
            np.stack([pieces.begin[halve], middle[halve]], axis=1).ravel(),
            np.stack([middle[halve], pieces.end[halve]], axis=1).ravel(),
        )
    return upper, sampled, time, spent
