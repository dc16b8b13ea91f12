"""The paper's way to a regional movement: the straight movement, and the genetic correction of what collides.

The movement of least W (eq. 9) is the straight one of all joints. Where its discretised way meets a forbidden
zone, the stretch that collides, and no more, gets vias from a population (genetic.py); what is free before
and after stays. The corrected way is proved step by step and corrected again until it is clean. A stretch
whose population finds nothing is tried again, each time wider and with more samples.
"""

from dataclasses import dataclass, replace

import numpy as np
from ir_kernels.collision import FREE, Certificates
from ir_msgs_py.arrays import FloatArray

from ir_planner.checks import FreeSpace
from ir_planner.scene import path_cost
from ir_planner.search.genetic_settings import SAMPLES_MAX, GeneticSettings
from ir_planner.search.population import Evolution, batch_work, evolve

_SPACING = 0.02  # rad between samples of a way in search of what collides
_WIDER = 4.0  # by how much each further attempt widens the margin
_COMPARED = 16  # places along two ways at which they are compared


@dataclass(frozen=True, eq=False)
class Correction:
    """Ways (M_k, n) of certified straight steps, cheapest by W first.

    Without one: the best individual of a stretch that was given up lacked `shortfall` m of what pair `pair`
    must keep, at `q` (n,); pair -1: there was none. generations: of all populations together.
    """

    ways: list[FloatArray]
    shortfall: float
    pair: int
    q: FloatArray
    generations: int


def corrected(
    start: FloatArray,
    goal: FloatArray,
    space: FreeSpace,
    settings: GeneticSettings,
    rng: np.random.Generator,
) -> Correction:
    """Different ways from start to goal (n,), both free, within the limits; ends with settings or budget.

    Raises CancelledError when asked to stop.
    """
    weights = space.scene.weights
    open_ways = [np.stack([start, goal])]
    clean: list[FloatArray] = []
    missed = Evolution([], np.inf, -1, start, 0)
    generations = 0
    for _ in range(settings.stretches + 1):
        following: list[FloatArray] = []
        wanted = max((settings.ways - len(clean)) // len(open_ways), 1)
        for way in open_ways:
            proof = space.certificates(way[:-1], way[1:])
            if (proof.verdict == FREE).all():
                clean.append(way)
            elif not space.work.exhausted:
                found = _round_stretch(way, proof, space, settings, rng, wanted)
                generations += found.generations
                following.extend(found.ways)
                if not found.ways and found.shortfall < missed.shortfall:
                    missed = found
        open_ways = following
        if not open_ways:
            break
    clean.sort(key=lambda way: path_cost(weights, way))
    ways = different(clean, settings.ways, settings.difference)
    return Correction(ways, missed.shortfall, missed.pair, missed.q, generations)


def _round_stretch(
    way: FloatArray,
    proof: Certificates,
    space: FreeSpace,
    settings: GeneticSettings,
    rng: np.random.Generator,
    wanted: int,
) -> Evolution:
    """Up to `wanted` different forms of the whole way, its first colliding stretch replaced."""
    generations = 0
    best = Evolution([], np.inf, -1, way[0], 0)
    for attempt in range(settings.attempts):
        before, after = colliding_stretch(way, proof, space, settings.margin * _WIDER**attempt)
        finer = replace(settings, samples=min(settings.samples * (attempt + 1), SAMPLES_MAX))
        found = evolve(before[-1], after[0], space, finer, rng)
        generations += found.generations
        if found.ways:
            whole = [np.concatenate([before[:-1], part, after[1:]]) for part in found.ways]
            return replace(found, ways=different(whole, wanted, settings.difference), generations=generations)
        if found.shortfall < best.shortfall:
            best = found
        if space.work.exhausted:
            break
    return replace(best, generations=generations)


def colliding_stretch(
    way: FloatArray, proof: Certificates, space: FreeSpace, margin: float
) -> tuple[FloatArray, FloatArray]:
    """What is kept of a way (M, n) before and after the first stretch of it that collides.

    The last point before and the first after are the stretch's free ends. `proof`: certificates of the M-1
    steps, not all of them free. The stretch is widened at both ends by `margin` times its own length.
    """
    lengths = np.abs(np.diff(way, axis=0)).max(axis=1)
    counts = np.maximum(np.ceil(lengths / _SPACING).astype(int), 1)
    first = np.concatenate([[0], np.cumsum(counts)])  # index of each waypoint among the samples
    step = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(step)) - first[step]) / counts[step]
    points = np.concatenate([way[step] + share[:, None] * (way[step + 1] - way[step]), way[-1:]])
    space.work.spend(batch_work(len(points)))
    free = space.states_free(points)
    blocked = ~(free[:-1] & free[1:])  # (K,): the parts between samples
    unproved = np.flatnonzero(proof.verdict != FREE)
    middle = 0.5 * (proof.t0 + proof.t1)[unproved] * counts[unproved]
    blocked[first[unproved] + np.minimum(middle.astype(int), counts[unproved] - 1)] = True
    begin = int(np.argmax(blocked))
    end = begin + int(np.argmin(np.append(blocked[begin:], False)))
    wider = int(np.ceil(margin * (end - begin)))
    begin, end = max(begin - wider, 0), min(end + wider, len(points) - 1)
    begin -= int(np.argmax(free[begin::-1]))
    end += int(np.argmax(free[end:]))
    before = np.concatenate([way[: step[begin] + 1], points[begin : begin + 1]])
    after = np.concatenate([points[end : end + 1], way[step[end - 1] + 1 :]])
    return _without_repeats(before), _without_repeats(after)


def _without_repeats(points: FloatArray) -> FloatArray:
    keep = np.append(True, np.abs(np.diff(points, axis=0)).max(axis=1) > 0.0)
    return np.ascontiguousarray(points[keep])


def different(ways: list[FloatArray], most: int, difference: float) -> list[FloatArray]:
    """The first `most` ways that differ somewhere by more than `difference` rad at the same share of their
    length.
    """
    chosen: list[FloatArray] = []
    shown: list[FloatArray] = []
    for way in ways:
        if len(chosen) == most:
            break
        mine = _evenly(way)
        if all(np.abs(mine - other).max() > difference for other in shown):
            chosen.append(way)
            shown.append(mine)
    return chosen


def _evenly(way: FloatArray) -> FloatArray:
    """Configurations (_COMPARED, n) at even shares of a way's length."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], _COMPARED)
    return np.stack([np.interp(at, length, joint) for joint in way.T], axis=1)
