"""The paper's regional movement: the straight one, and the genetic correction of what collides.

The modified GA of eq. (7) is another: it withdraws, service/stochastic_withdrawal.py.

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
from ir_msgs_py.search_log import CorrectionLog
from ir_planner.checks import FreeSpace, first_too_near
from ir_planner.scene import PlanningScene, path_cost
from ir_planner.search.population import SAMPLES_MAX, Evolution, GeneticSettings, batch_work, evolve
from ir_planner.search.port import Correction, Ends, Found, Stretch
from ir_planner.search.variety import NEAREST_GOALS, evenly, first_different
from ir_values.arrays import FloatArray, IntArray

_SPACING = 0.02  # rad between samples of a path in search of what collides
_WIDER = 4.0  # by how much each further attempt widens the margin


@dataclass(frozen=True)
class Genetic(GeneticSettings):
    """The straight movement with what collides corrected by a population (eqs. 9, 10)."""

    def quick(self) -> "Genetic":
        """Each stretch is tried once."""
        return replace(self, attempts=1)

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """Correct the straight movement to the nearest goal that it succeeds for."""
        rng = np.random.default_rng(seed)
        nearest: tuple[float, str] = (np.inf, "")
        for goal in ends.goals[:NEAREST_GOALS]:
            found = corrected(ends.start, goal, space, self, rng)
            if found.paths:
                return Found(found.paths, correction=found)
            if found.pair >= 0 and found.shortfall < nearest[0]:
                pair = space.scene.collision.pairs[found.pair]
                sentence = (
                    f"the nearest of {found.generations} generations lacks "
                    f"{found.shortfall * 1e3:.1f} mm between {pair.body_a} and {pair.body_b}"
                )
                nearest = (found.shortfall, sentence)
        return Found([], nearest[1])


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


def _sample_counts(path: FloatArray) -> IntArray:
    """Into how many parts each step (M-1,) of a path (M, n) is sampled."""
    lengths = np.abs(np.diff(path, axis=0)).max(axis=1)
    parts: IntArray = np.maximum(np.ceil(lengths / _SPACING).astype(np.int64), 1)
    return parts


def _price(path: FloatArray) -> int:
    """Work that looking for the colliding stretch of a path (M, n) takes."""
    return batch_work(int(_sample_counts(path).sum()) + 1)


def colliding_stretch(
    path: FloatArray, proof: Certificates, space: FreeSpace, margin: float
) -> tuple[FloatArray, FloatArray]:
    """What is kept of a path (M, n) before and after the first stretch of it that collides.

    The last point before and the first after are the stretch's free ends. `proof`: certificates of
    the M-1 steps, not all of them free. The stretch is widened at both ends by `margin` times its
    own length.
    """
    counts = _sample_counts(path)
    first = np.concatenate([[0], np.cumsum(counts)])  # index of each waypoint among the samples
    step = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(step)) - first[step]) / counts[step]
    inner = path[step] + share[:, None] * (path[step + 1] - path[step])
    points = np.concatenate([inner, path[-1:]])
    space.work.spend(batch_work(len(points)))
    free = space.states_free(points)

    # parts between samples (K,): a proof may fail between two samples that are free
    blocked = ~(free[:-1] & free[1:])
    unproved = np.flatnonzero(proof.verdict != FREE)
    middle = 0.5 * (proof.t0 + proof.t1)[unproved] * counts[unproved]
    part_of_step = np.minimum(middle.astype(int), counts[unproved] - 1)
    blocked[first[unproved] + part_of_step] = True
    begin = int(np.argmax(blocked))
    end = begin + int(np.argmin(np.append(blocked[begin:], False)))

    # wider by the margin, and on to the next free samples
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


_SAMPLES = 25  # positions of the tool along a straight step
_SPACING_CORRECTION_LOG = 0.01  # rad between configurations of the straight movement that are asked
_MOST = 24  # stretches whose fitness is kept: more than a picture shows


def correction_log(
    correction: Correction, path: FloatArray, start: FloatArray, space: FreeSpace
) -> CorrectionLog:
    """The correction of the straight movement from start (n,), which became `path` (M, n); without
    the names of its ends. It is no work: what it asks is not counted.
    """
    scene = space.scene
    straight = np.stack([start, path[-1]])
    parts = _colliding_parts(straight, space)
    return CorrectionLog(
        start="",
        goal="",
        generations=correction.generations,
        fitness=tuple(stretch.fitness for stretch in correction.stretches[:_MOST]),
        costs=(float(path_cost(scene.weights, straight)), float(path_cost(scene.weights, path))),
        straight=_tool_along(straight, scene),
        stretches=tuple(_tool_along(part, scene) for part in parts),
        path=_tool_along(path, scene),
        met=first_too_near(straight, space) if parts else "",
    )


def _colliding_parts(straight: FloatArray, space: FreeSpace) -> list[FloatArray]:
    """Ends (2, n) of the parts of a straight movement (2, n) on which something is nearer than it
    may be, or of those that can't be proved free.
    """
    begin = straight[0]
    step = straight[1] - straight[0]
    pieces = int(np.ceil(np.abs(step).max() / _SPACING_CORRECTION_LOG))
    share = np.linspace(0.0, 1.0, max(pieces, 1) + 1)
    blocked = ~space.states_free(begin + share[:, None] * step)
    with_free_ends = np.concatenate([[False], blocked, [False]])
    edges = np.flatnonzero(np.diff(with_free_ends.astype(np.int8)))
    shares = []
    for first, after_last in zip(edges[::2], edges[1::2], strict=True):
        shares.append((share[first], share[after_last - 1]))
    if not shares:
        proof = space.scene.collision.certify_edges(straight[:1], straight[1:], space.threshold)
        if proof.verdict[0] != FREE:
            shares.append((float(proof.t0[0]), float(proof.t1[0])))
    return [begin + np.array(ends)[:, None] * step for ends in shares]


def _tool_along(path: FloatArray, scene: PlanningScene) -> FloatArray:
    """Positions (K, 3) of the tcp along a path (M, n), M >= 2, of straight joint steps."""
    share = np.linspace(0.0, 1.0, _SAMPLES)[:, None, None]
    q = (path[:-1] + share * np.diff(path, axis=0)).transpose(1, 0, 2).reshape(-1, path.shape[1])
    return scene.chain.tcp_poses(np.ascontiguousarray(q))[:, :3, 3]
