"""Shorter paths through the same gap: leave waypoints out, and pull those that stay towards their
neighbours.

Everything is tried in batches of certified edges, so a polished path is as free as the one it came
from.
"""

import numpy as np

from ir_kernels import portable
from ir_planner.checks import FreeSpace
from ir_planner.scene import movement_cost, path_cost
from ir_values.arrays import FloatArray

_POINTS = 16
_PULLS = (1.0, 0.6, 0.3, 0.12)
_ROUNDS = 6
_CORNER = 0.04  # what a corner costs, as a share of the straight movement's W: it takes time


def fewest_corners(
    path: FloatArray, space: FreeSpace, weights: FloatArray, candidates: int = _POINTS
) -> FloatArray:
    """The cheapest path over points of `path` (M, n), `candidates` or as many as it has: all
    shortcuts certified in one call, then shortest path.
    """
    points = densified(path, candidates)
    count = len(points)
    first, last = np.triu_indices(count, 1)
    free = np.full((count, count), False)
    free[first, last] = space.edges_free(points[first], points[last])
    free[np.arange(count - 1), np.arange(1, count)] = True  # steps of the path itself

    # shortest path by dynamic programming: steps lead forward only
    steps = movement_cost(weights, points[:, None], points[None])
    steps = np.where(free, steps + _CORNER * steps[0, -1], np.inf)
    cost = np.zeros(count)
    came = np.zeros(count, dtype=int)
    for k in range(1, count):
        through = cost[:k] + steps[:k, k]
        came[k] = int(np.argmin(through))
        cost[k] = through[came[k]]

    chosen = [count - 1]  # back from the end
    while chosen[-1] != 0:
        chosen.append(int(came[chosen[-1]]))
    return points[chosen[::-1]]


def straight_along(points: FloatArray, space: FreeSpace, weights: FloatArray) -> FloatArray | None:
    """The cheapest path of free straight steps over some of the points (N, n) of a free curve; None
    where they are too few to follow it.
    """
    chosen = np.linspace(0, len(points) - 1, _POINTS).round().astype(int)
    blocked = chosen[:-1][~space.edges_free(points[chosen[:-1]], points[chosen[1:]])]
    while len(blocked):
        following = chosen[np.searchsorted(chosen, blocked) + 1]
        middle = (blocked + following) // 2
        if (middle == blocked).any():
            return None
        chosen = np.union1d(chosen, middle)
        begin = np.concatenate([blocked, middle])
        end = np.concatenate([middle, following])
        blocked = np.sort(begin[~space.edges_free(points[begin], points[end])])
    return fewest_corners(points[chosen], space, weights)


def densified(path: FloatArray, count: int) -> FloatArray:
    """The path (M, n) with points added in its longest steps until there are `count`."""
    points = np.array(path)
    while len(points) < count:
        k = int(np.argmax(np.square(np.diff(points, axis=0)).sum(axis=1)))
        middle = 0.5 * (points[k] + points[k + 1])
        points = np.concatenate([points[: k + 1], middle[None], points[k + 1 :]])
    return points


def pulled(path: FloatArray, space: FreeSpace, weights: FloatArray) -> FloatArray:
    """The path (M, n) with every inner waypoint moved towards the straight line as far as certified
    edges allow.

    W of eq. (9) only asks that a joint does not turn back: so each joint is also moved alone into
    the range of the neighbours.
    """
    path = path.copy()
    for _ in range(_ROUNDS):
        before = path_cost(weights, path)
        for k in range(1, len(path) - 1):
            if space.work.exhausted:
                return path
            path[k] = _best_pull(path[k - 1], path[k], path[k + 1], space, weights)
        if path_cost(weights, path) > 0.995 * before:
            break
    return path


def _best_pull(
    before: FloatArray, via: FloatArray, after: FloatArray, space: FreeSpace, weights: FloatArray
) -> FloatArray:
    """The cheapest free place for a waypoint between its neighbours (n,): where it is, or a part of
    the way to its projection on their straight line, into their range, or there with one joint.
    """
    step = after - before
    square = max(float(portable.matmul(step, step)), 1e-12)
    along = float(np.clip(portable.matmul(via - before, step) / square, 0.05, 0.95))
    inside = np.clip(via, np.minimum(before, after), np.maximum(before, after))
    targets = [before + along * step, inside]
    for joint in range(len(via)):
        alone = via.copy()
        alone[joint] = inside[joint]
        targets.append(alone)
    places: list[FloatArray] = []
    for target in targets:
        places.extend(via + share * (target - via) for share in _PULLS)
    trials = np.array(places)

    # only what costs less is certified
    cost = movement_cost(weights, before, trials) + movement_cost(weights, trials, after)
    now = float(movement_cost(weights, before, via) + movement_cost(weights, via, after))
    cheaper = cost < now - 1e-9
    trials = trials[cheaper]
    cost = cost[cheaper]
    if len(trials) == 0:
        return via
    count = len(trials)
    neighbours = np.repeat(np.stack([before, after]), count, axis=0)
    edges = space.edges_free(neighbours, np.concatenate([trials, trials]))
    free = edges.reshape(2, count).all(axis=0)
    if not free.any():
        return via
    cheapest = int(np.argmin(np.where(free, cost, np.inf)))
    return np.asarray(trials[cheapest])
