"""The cheapest chains of configurations along a path: edges from sample to sample where no axis
jumps.

Complete up to its resolution: what passes no sample without a jump isn't found. Joules of an edge
are those of its even motion at the tool's speed; accelerations are left out, they come with the
timing.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from ir_kernels import portable
from ir_msgs_py.arrays import BoolArray, FloatArray, IntArray
from ir_planner.cartesian.layers import Layers
from ir_planner.cartesian.refusal import NoChainError
from ir_planner.cartesian.whole_turns import TURN, difference, without_turns
from ir_planner.checks import FreeSpace
from ir_planner.scene import PlanningScene

JUMP = 0.35  # rad from sample to sample: more is another branch, or a singularity
# rad that a chain may jump where samples can be closer: many and few edges
_WIDE = 1.0
_WIDE_FEW = 3.3
_SAME = 1e-6  # relative cost of chains that differ by whole turns only
_APART = 0.3  # rad: ends of chains with a free angle that are nearer are smoothed to one
_OVERSPEED_WATTS = 2000.0  # what an axis at its speed limit costs in the search; far more beyond
_FEW = 100  # configurations of a layer, up to which all pairs are compared
_LAYER = 10.0  # between layers in the tree of neighbours, further than any jump


@dataclass(frozen=True, eq=False)
class Chain:
    """Configurations q (N, n) and angles (N,) rad about the tool's axis at the samples s (N,) m;
    joules as estimated.
    """

    s: FloatArray
    q: FloatArray
    angles: FloatArray
    joules: float


def chains(
    layers: Layers,
    speed: float,
    space: FreeSpace,
    most: int,
    *,
    by_start: bool = False,
    wide: float = 0.0,
) -> list[Chain]:
    """The cheapest chains through all layers, at most `most`, each with another end, or start
    (whole turns apart count once), at the tool's speed [m/s]. Raises NoChainError where none leads
    through.

    wide: samples that are farther apart than this [m] may be joined by far larger steps, 0: none.
    """
    nodes = np.flatnonzero(layers.free)
    scene = space.scene
    q = layers.q[nodes]
    layer = layers.layer[nodes]
    turning = layers.turning
    before, after = _neighbours(q, layer, turning, np.diff(layers.s) > wide if wide else None)
    family = _families(len(q), before, after)
    seconds = (np.diff(layers.s) / speed)[layer[before]]
    joules = _edge_joules(q[before], difference(q[before], q[after], turning), seconds, scene)
    apart = _SAME if len(np.unique(layers.angle)) == 1 else _APART
    if by_start:  # the same edges from the end
        before, after, layer = after, before, len(layers.s) - 1 - layer
        order = np.lexsort((before, after, layer[after]))
        before = before[order]
        after = after[order]
        joules = joules[order]
    cost, parent = _cheapest(layer, before, after, joules, len(layers.s))
    last = np.flatnonzero((layer == len(layers.s) - 1) & np.isfinite(cost))
    if len(last) == 0:
        raise NoChainError(nodes[np.isfinite(cost)])
    found: list[Chain] = []
    for node in _different(last, cost, q, family, scene, (apart, most)):
        trace = [int(node)]
        while parent[trace[-1]] >= 0:
            trace.append(int(parent[trace[-1]]))
        order = nodes[trace if by_start else trace[::-1]]
        found.append(Chain(layers.s, layers.q[order], layers.angle[order], float(cost[node])))
    return found


def _neighbours(
    q: FloatArray, layer: IntArray, turning: BoolArray, wide: BoolArray | None
) -> tuple[IntArray, IntArray]:
    """Edges (E,) from one layer to the next with no axis beyond JUMP, ordered by where they lead.
    wide (N - 1,): where they may be longer.
    """
    few = int(np.bincount(layer).max(initial=0)) <= _FEW
    jump = JUMP if wide is None else _WIDE_FEW if few else _WIDE
    before, after = (_by_pairs if few else _by_tree)(q, layer, turning, jump)
    if wide is not None:
        kept = wide[layer[before]] | (
            np.abs(difference(q[before], q[after], turning)).max(axis=1) <= JUMP
        )
        before = before[kept]
        after = after[kept]
    order = np.lexsort((before, after))
    return before[order], after[order]


def _families(count: int, before: IntArray, after: IntArray) -> IntArray:
    """Which of `count` configurations are joined (M,), by the number of their family."""
    edges = coo_array((np.ones(len(before), dtype=bool), (before, after)), shape=(count, count))
    return np.asarray(connected_components(edges, directed=False)[1])


def _by_pairs(
    q: FloatArray, layer: IntArray, turning: BoolArray, jump: float
) -> tuple[IntArray, IntArray]:
    """The same in any order, all pairs compared axis by axis: quicker where layers are small."""
    count = np.bincount(layer)
    begin = np.cumsum(count) - count
    number = np.full((len(count), count.max(initial=0)), -1)
    number[layer, np.arange(len(layer)) - begin[layer]] = np.arange(len(layer))
    axes = np.argsort(-q.std(axis=0))
    first = np.where(number >= 0, q[number, axes[0]], np.nan)
    step = difference(first[:-1, :, None], first[1:, None, :], turning[axes[0]])
    k, i, j = np.nonzero(np.abs(step) <= jump)
    before = number[k, i]
    after = number[k + 1, j]
    for axis in axes[1:]:
        near = np.abs(difference(q[before, axis], q[after, axis], turning[axis])) <= jump
        before = before[near]
        after = after[near]
    return before, after


def _by_tree(
    q: FloatArray, layer: IntArray, turning: BoolArray, jump: float
) -> tuple[IntArray, IntArray]:
    """The same by a tree of all configurations: where layers are large."""
    box = np.append(np.where(turning, TURN / jump, 0.0), 0.0)  # 0: not periodic
    ahead, place = (
        cKDTree(np.column_stack([without_turns(q, turning) / jump, number * _LAYER]), boxsize=box)
        for number in (layer + 1, layer)
    )
    near = ahead.sparse_distance_matrix(place, 1.0, p=np.inf, output_type="ndarray")
    return near["i"].astype(np.int64), near["j"].astype(np.int64)


def _edge_joules(
    q: FloatArray, steps: FloatArray, seconds: FloatArray, scene: PlanningScene
) -> FloatArray:
    """What the drives take along edges (E,) from q (E, n) by steps (E, n) in seconds (E,) [J], and
    what keeps the search from too fast ones.
    """
    if len(q) == 0:
        return np.zeros(0)
    qd = steps / seconds[:, None]
    power = scene.dynamics.drive_power(q + 0.5 * steps, qd, np.zeros_like(qd)).sum(axis=1)
    share = (np.abs(qd) / scene.limits.velocity).max(axis=1)
    return np.asarray(
        (np.maximum(power, 0.0) + _OVERSPEED_WATTS * portable.power(share, 8)) * seconds
    )


def _cheapest(
    layer: IntArray, before: IntArray, after: IntArray, joules: FloatArray, count: int
) -> tuple[FloatArray, IntArray]:
    """Least joules (M,) to each node, inf where none leads there, and the node before (M,), -1:
    none.
    """
    cost = np.where(layer == 0, 0.0, np.inf)
    parent = np.full(len(layer), -1, dtype=np.int64)
    bounds = np.searchsorted(layer[after], np.arange(count + 1))
    for k in range(1, count):
        edges = slice(bounds[k], bounds[k + 1])
        if edges.start == edges.stop:
            break
        to = after[edges]
        total = cost[before[edges]] + joules[edges]
        order = np.lexsort((before[edges], total, to))
        first = order[np.concatenate([[True], np.diff(to[order]) > 0])]
        kept = first[np.isfinite(total[first])]
        cost[to[kept]] = total[kept]
        parent[to[kept]] = before[edges][kept]
    return cost, parent


def _different(
    last: IntArray,
    cost: FloatArray,
    q: FloatArray,
    family: IntArray,
    scene: PlanningScene,
    bounds: tuple[float, int],
) -> IntArray:
    """Ends (K,) of chains: the cheapest of each family, then the others, cheapest first; of those
    that differ by whole turns, the one most within the axis limits. bounds: about how many rad they
    are apart, and how many at most.
    """
    robot = scene.cell.robot
    middle = 0.5 * (robot.position_min + robot.position_max)
    away = (np.abs(q[last] - middle) / (robot.position_max - robot.position_min)).max(axis=1)
    digits = np.round(portable.log(np.maximum(cost[last], 1e-12)) / _SAME)
    order = last[np.lexsort((away, digits))]
    firsts = np.sort(np.unique(family[order], return_index=True)[1])
    (apart, most), kept = bounds, list[int]()
    for node in [*order[firsts], *np.delete(order, firsts)]:
        if len(kept) == most:
            break
        if all(np.abs(portable.sin(0.5 * (q[node] - q[other]))).max() > apart for other in kept):
            kept.append(int(node))
    return np.array(kept, dtype=np.int64)
