"""The last resort: two trees grow from start and goal towards each other (RRT-Connect), over certified
edges.

J. Kuffner and S. LaValle, "RRT-Connect", ICRA 2000; here in batches: one round draws many targets, extends
the tree towards all of them and tries to join every new node with the other tree, in two calls of the
kernels. An edge that hits something is used as far as it is proved free.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from ir_kernels.collision import FREE
from numpy.typing import NDArray

from ir_planner.free_space import FreeSpace

FloatArray = NDArray[np.float64]
_BATCH = 24
_STEP = 0.8  # longest edge, in weighted rad
_KEEP = 0.9  # how much of the proved part of a blocked edge is used
_SHORTEST = 0.02


@dataclass
class Tree:
    """Nodes (K, n) with their parents; the root is its own."""

    nodes: FloatArray
    parents: list[int] = field(default_factory=lambda: [0])

    def add(self, nodes: FloatArray, parents: list[int]) -> None:
        """Append nodes (M, n)."""
        self.nodes = np.concatenate([self.nodes, nodes])
        self.parents.extend(parents)

    def nearest(self, targets: FloatArray, scale: FloatArray) -> NDArray[np.intp]:
        """Index (M,) of the node nearest to each target (M, n)."""
        a, b = self.nodes * scale, targets * scale
        square = (a**2).sum(axis=1)[None, :] - 2.0 * b @ a.T
        return np.asarray(np.argmin(square, axis=1))

    def branch(self, index: int) -> FloatArray:
        """Path (M, n) from the root to a node."""
        path = [index]
        while path[-1] != 0:
            path.append(self.parents[path[-1]])
        return self.nodes[path[::-1]]


Draw = Callable[[Tree, Tree, FreeSpace, np.random.Generator], FloatArray]


def anywhere(here: Tree, there: Tree, space: FreeSpace, rng: np.random.Generator) -> FloatArray:
    """Targets (B, n) all over the joint range, a quarter of them nodes of the other tree."""
    targets = rng.uniform(space.low, space.high, (_BATCH, here.nodes.shape[1]))
    targets[: _BATCH // 4] = there.nodes[rng.integers(0, len(there.nodes), _BATCH // 4)]
    return targets


def connect(
    start: FloatArray,
    goal: FloatArray,
    space: FreeSpace,
    scale: FloatArray,
    rng: np.random.Generator,
    draw: Draw = anywhere,
) -> FloatArray | None:
    """A free path (M, n) from start to goal, or None when the budget ended before one was found.

    `scale` (n,): how much each joint counts in the distance of configurations. `draw`: where trees grow to.
    """
    trees = (Tree(start[None].copy()), Tree(goal[None].copy()))
    side = 0
    while not space.budget.exhausted:
        here, there = trees[side], trees[1 - side]
        targets = draw(here, there, space, rng)
        begin, new = len(here.nodes), _extend(here, targets, space, scale)
        if new:
            joined = _join(here, there, begin, space, scale)
            if joined is not None:
                mine, other = joined
                path = np.concatenate([here.branch(mine), there.branch(other)[::-1]])
                return path if side == 0 else path[::-1]
        side = 1 - side
    return None


def _extend(tree: Tree, targets: FloatArray, space: FreeSpace, scale: FloatArray) -> int:
    """Add the proved part of the edges towards the targets; the number of new nodes."""
    parents = tree.nearest(targets, scale)
    begin = tree.nodes[parents]
    way = targets - begin
    length = np.linalg.norm(way * scale, axis=1)
    end = begin + way * np.minimum(1.0, _STEP / np.maximum(length, 1e-12))[:, None]
    found = space.certificates(begin, end)
    share = np.where(found.verdict == FREE, 1.0, _KEEP * found.t0)
    keep = share * np.minimum(length, _STEP) > _SHORTEST
    tree.add((begin + share[:, None] * (end - begin))[keep], [int(k) for k in parents[keep]])
    return int(keep.sum())


def _join(here: Tree, there: Tree, begin: int, space: FreeSpace, scale: FloatArray) -> tuple[int, int] | None:
    """The first pair of a new node and a node of the other tree with a free edge between them."""
    new = here.nodes[begin:]
    partner = there.nearest(new, scale)
    found = space.certificates(there.nodes[partner], new)
    free = np.flatnonzero(found.verdict == FREE)
    if len(free):
        return begin + int(free[0]), int(partner[free[0]])
    blocked = found.t0 * np.linalg.norm((new - there.nodes[partner]) * scale, axis=1) > _SHORTEST
    grown = there.nodes[partner] + _KEEP * found.t0[:, None] * (new - there.nodes[partner])
    there.add(grown[blocked], [int(k) for k in partner[blocked]])
    return None
