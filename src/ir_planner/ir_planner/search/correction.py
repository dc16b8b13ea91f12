"""The paper's regional movement: the straight movement, and the genetic correction of what
collides.

The movement of least W (eq. 9) is the straight one of all joints. Where its discretised path meets
a forbidden zone, the stretch that collides, and no more, gets vias from a population
(population.py); what is free before and after stays. The corrected path is proved step by step and
corrected again until it is clean. A stretch whose population finds nothing is tried again, each
time wider and with more samples.
"""

from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_kernels.collision import FREE, Certificates
from ir_msgs_py.arrays import FloatArray, IntArray
from ir_planner.checks import FreeSpace
from ir_planner.scene import path_cost
from ir_planner.search.genetic_settings import SAMPLES_MAX, GeneticSettings
from ir_planner.search.population import Evolution, batch_work, evolve
from ir_planner.search.variety import evenly, first_different

_SPACING = 0.02  # rad between samples of a path in search of what collides
_WIDER = 4.0  # by how much each further attempt widens the margin


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stretch that collided, between its free ends begin and end (n,), and the fitness of the
    best individual of every generation that was bred for it; the straight stretch's cost counts 1.
    """

    begin: FloatArray
    end: FloatArray
    fitness: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Correction:
    """Paths (M_k, n) of certified straight steps, cheapest by W first.

    Without one: the best individual of a stretch that was given up lacked `shortfall` m of what
    pair `pair` must keep, at `q` (n,); pair -1: there was none. generations: of all populations
    together. stretches: those that were corrected, in order.
    """

    paths: list[FloatArray]
    shortfall: float
    pair: int
    q: FloatArray
    generations: int
    stretches: tuple[Stretch, ...] = ()


def corrected(
    start: FloatArray,
    goal: FloatArray,
    space: FreeSpace,
    settings: GeneticSettings,
    rng: np.random.Generator,
) -> Correction:
    """Different paths from start to goal (n,), both free, within the limits; ends with settings or
    budget.

    Raises CancelledError when asked to stop.
    """
    weights = space.scene.weights
    open_paths = [np.stack([start, goal])]
    clean: list[FloatArray] = []
    missed = Evolution([], np.inf, -1, start, 0)
    generations = 0
    stretches: list[Stretch] = []
    for _ in range(settings.stretches + 1):
        following: list[FloatArray] = []
        wanted = max((settings.paths - len(clean)) // len(open_paths), 1)
        for path in open_paths:
            if len(path) - 1 > space.work.left:
                break
            proof = space.certificates(path[:-1], path[1:])
            if (proof.verdict == FREE).all():
                clean.append(path)
            elif _price(path) <= space.work.left:
                found, stretch = _round_stretch(path, proof, space, settings, rng, wanted)
                stretches.extend([stretch] if stretch.fitness else [])
                generations += found.generations
                following.extend(found.paths)
                if not found.paths and found.shortfall < missed.shortfall:
                    missed = found
        open_paths = following
        if not open_paths:
            break
    clean.sort(key=lambda path: path_cost(weights, path))
    paths = first_different(clean, settings.paths, settings.difference, evenly)
    return Correction(paths, missed.shortfall, missed.pair, missed.q, generations, tuple(stretches))


def _round_stretch(
    path: FloatArray,
    proof: Certificates,
    space: FreeSpace,
    settings: GeneticSettings,
    rng: np.random.Generator,
    wanted: int,
) -> tuple[Evolution, Stretch]:
    """Up to `wanted` different forms of the whole path, its first colliding stretch replaced; and
    that stretch.
    """
    generations = 0
    fitness: list[float] = []
    best = Evolution([], np.inf, -1, path[0], 0)
    for attempt in range(settings.attempts):
        if attempt and _price(path) > space.work.left:
            break
        before, after = colliding_stretch(
            path, proof, space, settings.margin * float(portable.power(_WIDER, attempt))
        )
        finer = replace(settings, samples=min(settings.samples * (attempt + 1), SAMPLES_MAX))
        found = evolve(before[-1], after[0], space, finer, rng)
        generations += found.generations
        fitness += found.fitness
        stretch = Stretch(before[-1], after[0], tuple(fitness))
        if found.paths:
            whole = [np.concatenate([before[:-1], part, after[1:]]) for part in found.paths]
            different = first_different(whole, wanted, settings.difference, evenly)
            return replace(found, paths=different, generations=generations), stretch
        if found.shortfall < best.shortfall:
            best = found
    return replace(best, generations=generations), stretch


def _parts(path: FloatArray) -> IntArray:
    """Into how many parts each step (M-1,) of a path (M, n) is sampled."""
    lengths = np.abs(np.diff(path, axis=0)).max(axis=1)
    parts: IntArray = np.maximum(np.ceil(lengths / _SPACING).astype(np.int64), 1)
    return parts


def _price(path: FloatArray) -> int:
    """Work that looking for the colliding stretch of a path (M, n) takes."""
    return batch_work(int(_parts(path).sum()) + 1)


def colliding_stretch(
    path: FloatArray, proof: Certificates, space: FreeSpace, margin: float
) -> tuple[FloatArray, FloatArray]:
    """What is kept of a path (M, n) before and after the first stretch of it that collides.

    The last point before and the first after are the stretch's free ends. `proof`: certificates of
    the M-1 steps, not all of them free. The stretch is widened at both ends by `margin` times its
    own length.
    """
    counts = _parts(path)
    first = np.concatenate([[0], np.cumsum(counts)])  # index of each waypoint among the samples
    step = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(step)) - first[step]) / counts[step]
    points = np.concatenate(
        [path[step] + share[:, None] * (path[step + 1] - path[step]), path[-1:]]
    )
    space.work.spend(batch_work(len(points)))
    free = space.states_free(points)
    blocked = ~(free[:-1] & free[1:])  # (K,): the parts between samples
    unproved = np.flatnonzero(proof.verdict != FREE)
    middle = 0.5 * (proof.t0 + proof.t1)[unproved] * counts[unproved]
    blocked[first[unproved] + np.minimum(middle.astype(int), counts[unproved] - 1)] = True
    begin = int(np.argmax(blocked))
    end = begin + int(np.argmin(np.append(blocked[begin:], False)))
    wider = int(np.ceil(margin * (end - begin)))
    begin = max(begin - wider, 0)
    end = min(end + wider, len(points) - 1)
    begin -= int(np.argmax(free[begin::-1]))
    end += int(np.argmax(free[end:]))
    before = np.concatenate([path[: step[begin] + 1], points[begin : begin + 1]])
    after = np.concatenate([points[end : end + 1], path[step[end - 1] + 1 :]])
    return _without_repeats(before), _without_repeats(after)


def _without_repeats(points: FloatArray) -> FloatArray:
    keep = np.append(True, np.abs(np.diff(points, axis=0)).max(axis=1) > 0.0)
    return np.ascontiguousarray(points[keep])
