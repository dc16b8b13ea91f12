"""Two trees over certified edges, written for reading; the compiled search draws other numbers, so
it finds other paths.

The search is a generator that yields how many edges it has certified; `grow` pays for them.
"""

from collections.abc import Generator
from itertools import pairwise
from typing import Any

import numpy as np

from ir_kernels.geometry import FREE
from ir_values.arrays import FloatArray

BATCH = 16  # targets of a round, and configurations looked at for the price of an edge
JOINED = 8  # new nodes of a round that are joined, the nearest to the other tree
BETWEEN_JOINED = 4  # configurations of a join that are looked at before it is certified
STEP = 0.7  # longest extension, weighted rad
KEPT = 0.9  # how much of the proved part of a blocked edge is used
SHORTEST = 0.02  # weighted rad: parts that are shorter aren't worth a node
# shares of targets; the rest: anywhere
AROUND_NODE = 0.62
OTHER_TREE = 0.08
# share of the latter within so many rad of the box around start and a goal
BETWEEN = 0.85
MARGIN = 1.0
SPREADS = (0.1, 0.2, 0.4, 0.8)  # rad, of what is scattered around a node

Work = Generator[int, None, Any]


class Tree:
    """Nodes (n,) with their parents, -1 for roots, and the roots they hang on."""

    def __init__(self, roots: FloatArray, scale: FloatArray) -> None:
        self.scale = scale
        self.nodes = [*roots]
        self.parent = [-1] * len(roots)
        self.root = list(range(len(roots)))
        self.cut: set[int] = set()

    def add(self, q: FloatArray, parent: int) -> int:
        """Append a node at q (n,) below `parent`; its number."""
        self.nodes.append(q)
        self.parent.append(parent)
        self.root.append(self.root[parent])
        return len(self.nodes) - 1

    def remove(self, node: int) -> None:
        """Let nothing grow from a node any more, nor from what hangs on it."""
        self.cut.add(node)
        for k in range(node + 1, len(self.nodes)):
            if self.parent[k] in self.cut:
                self.cut.add(k)

    def nearest(self, q: FloatArray) -> tuple[int, float]:
        """Number of the nearest node to q (n,) and its weighted distance."""
        away = np.linalg.norm((np.array(self.nodes) - q) * self.scale, axis=1)
        away[list(self.cut)] = np.inf
        node = int(np.argmin(away))
        return node, float(away[node])

    def branch(self, node: int) -> list[int]:
        """The nodes from `node` to its root."""
        path = [node]
        while self.parent[path[-1]] >= 0:
            path.append(self.parent[path[-1]])
        return path


class Search:
    """One search; arguments as search.BidirectionalTree has checked them: start (n,), goals (G,
    n).
    """

    def __init__(
        self,
        model: Any,
        start: FloatArray,
        goals: FloatArray,
        threshold: FloatArray,
        low: FloatArray,
        high: FloatArray,
        scale: FloatArray,
        seed: int,
        start_line: FloatArray,
        goal_lines: list[FloatArray],
    ) -> None:
        self._model = model
        self._threshold = threshold
        self._low = low
        self._high = high
        self._scale = scale
        self._start = start
        self._goals = goals
        self._rng = np.random.default_rng(seed)
        self._trees = (Tree(start[None], scale), Tree(goals, scale))
        self._lines = [(0, 0, start_line), *((1, g, line) for g, line in enumerate(goal_lines))]
        self._path = np.empty((0, len(start)))
        self._goal = -1
        self._spent = 0
        self._owed = 0
        node, self._gap = self._trees[1].nearest(start)
        self._gap_ends = np.stack([start, goals[node]])
        self._work = self._rounds()

    def grow(self, max_edges: int) -> bool:
        """Spend at most that much; whether a path has been found."""
        left = max_edges
        while not self.found():
            paid = min(left, self._owed)
            self._spent = self._spent + paid
            self._owed = self._owed - paid
            left = left - paid
            if self._owed > 0:
                return False
            self._owed = next(self._work, 0)
        return True

    def found(self) -> bool:
        """Whether there is a path."""
        return len(self._path) > 0

    def path(self) -> FloatArray:
        """(M, n), or (0, n)."""
        return self._path

    def goal(self) -> int:
        """Which goal was reached, or -1."""
        return self._goal

    def edges(self) -> int:
        """Work spent."""
        return self._spent

    def nodes(self) -> tuple[int, int]:
        """Sizes of both trees."""
        return len(self._trees[0].nodes), len(self._trees[1].nodes)

    def gap(self) -> tuple[float, FloatArray]:
        """The least distance of the trees so far, and where it was (2, n)."""
        return self._gap, self._gap_ends

    def _rounds(self) -> Generator[int, None, None]:
        """Yields the price of what it has just done, until a path is found."""
        verdict, _ = yield from self._certified([(self._start, goal) for goal in self._goals])
        for g in np.flatnonzero(verdict == FREE):
            if (yield from self._confirmed(0, int(g))):
                return
        for side, root, line in self._lines:
            yield from self._add_line(self._trees[side], root, line)
        while True:
            side = 0 if len(self._trees[0].nodes) <= len(self._trees[1].nodes) else 1
            new = yield from self._extend(side)
            for mine, other in (yield from self._join(side, new)):
                if (yield from self._confirmed(*((mine, other) if side == 0 else (other, mine)))):
                    return

    def _certified(self, steps: list[tuple[FloatArray, FloatArray]]) -> Work:
        """Verdicts (N,) of straight movements, and the share (N,) of each that is proved."""
        if not steps:
            return np.zeros(0), np.zeros(0)
        q0, q1 = (np.ascontiguousarray(ends) for ends in zip(*steps, strict=True))
        verdict, t0, _, _ = self._model.certify_edges(q0, q1, self._threshold)
        yield len(steps)
        return verdict, np.where(verdict == FREE, 1.0, KEPT * t0)

    def _add_line(self, tree: Tree, root: int, line: FloatArray) -> Work:
        """A line as a branch, as far as it is proved."""
        points = [tree.nodes[root], *line]
        verdict, _ = yield from self._certified(list(pairwise(points)))
        node = root
        for q, is_free in zip(line, verdict == FREE, strict=True):
            if not is_free:
                break
            node = tree.add(q, node)

    def _target(self, here: Tree, there: Tree) -> FloatArray:
        """A place to grow to."""
        rng = self._rng
        low = self._low
        high = self._high
        which = rng.uniform()
        if which < OTHER_TREE:
            return np.asarray(there.nodes[rng.integers(len(there.nodes))])
        if which < OTHER_TREE + AROUND_NODE:
            node = here.nodes[rng.integers(len(here.nodes))]
            scattered = node + rng.choice(SPREADS) * rng.standard_normal(len(low))
            return np.asarray(np.clip(scattered, low, high))
        if rng.uniform() < BETWEEN:
            ends = np.stack([self._start, self._goals[rng.integers(len(self._goals))]])
            low = np.maximum(low, ends.min(axis=0) - MARGIN)
            high = np.minimum(high, ends.max(axis=0) + MARGIN)
        return np.asarray(rng.uniform(low, high))

    def _extend(self, side: int) -> Work:
        """New nodes of one tree, a step towards each target or as far as that is proved."""
        here = self._trees[side]
        there = self._trees[1 - side]
        tried = []
        for _ in range(BATCH):
            target = self._target(here, there)
            parent, length = here.nearest(target)
            if length >= SHORTEST:
                begin = here.nodes[parent]
                share = STEP / length
                end = begin + share * (target - begin) if share < 1.0 else target
                tried.append((parent, begin, end, min(length, STEP)))
        yield 1
        if tried:  # ends that aren't free are dropped at once
            free = self._model.is_free(np.array([end for _, _, end, _ in tried]), self._threshold)
            tried = [edge for edge, is_free in zip(tried, free, strict=True) if is_free]
        _, share = yield from self._certified([(begin, end) for _, begin, end, _ in tried])
        return [
            here.add(begin + part * (end - begin) if part < 1.0 else end, parent)
            for (parent, begin, end, length), part in zip(tried, share, strict=True)
            if part * length >= SHORTEST
        ]

    def _join(self, side: int, new: list[int]) -> Work:
        """Pairs of a new node and one of the other tree with a free movement between them; where
        there are none, the other tree grows as far as its movements are proved.
        """
        here = self._trees[side]
        there = self._trees[1 - side]
        pairs = [(*there.nearest(here.nodes[mine]), mine) for mine in new]
        pairs = sorted(pairs, key=lambda pair: pair[1])[:JOINED]
        if pairs:
            other, distance, mine = pairs[0]
            if distance < self._gap:
                ends = [here.nodes[mine], there.nodes[other]]
                self._gap = distance
                self._gap_ends = np.array(ends if side == 0 else ends[::-1])
        pairs = yield from self._maybe_free(pairs, here, there)
        steps = [(there.nodes[other], here.nodes[mine]) for other, _, mine in pairs]
        verdicts, shares = yield from self._certified(steps)
        free = []
        for (other, _, mine), verdict in zip(pairs, verdicts, strict=True):
            if verdict == FREE:
                free.append((mine, other))
        if not free:
            for (other, length, _), (begin, end), share in zip(pairs, steps, shares, strict=True):
                if share * length >= SHORTEST:
                    there.add(begin + share * (end - begin), other)
        return free

    def _maybe_free(self, pairs: list[tuple[int, float, int]], here: Tree, there: Tree) -> Work:
        """The pairs without those whose movement isn't free at a place in between: dropped at once,
        like extensions.
        """
        if not pairs:
            return []
        shares = np.arange(1, BETWEEN_JOINED + 1)[:, None] / (BETWEEN_JOINED + 1.0)
        ends = [(there.nodes[other], here.nodes[mine]) for other, _, mine in pairs]
        between = np.concatenate([a + shares * (b - a) for a, b in ends])
        yield -(-len(between) // BATCH)
        free = self._model.is_free(between, self._threshold).reshape(len(pairs), -1).all(axis=1)
        return [pair for pair, is_free in zip(pairs, free, strict=True) if is_free]

    def _confirmed(self, at_start: int, at_goal: int) -> Work:
        """Whether every step of a path is proved as it will be driven; what isn't is cut off."""
        first, second = self._trees
        out = first.branch(at_start)[::-1]
        back = second.branch(at_goal)
        points = [*(first.nodes[k] for k in out), *(second.nodes[k] for k in back)]
        verdict, _ = yield from self._certified(list(pairwise(points)))
        if (verdict == FREE).all():
            kept = [True, *(not np.array_equal(a, b) for a, b in pairwise(points))]
            path = [q for q, keep in zip(points, kept, strict=True) if keep]
            self._path = np.array(path if len(path) > 1 else points[:2])
            self._goal = second.root[at_goal]
            return True
        for k in np.flatnonzero(verdict != FREE):
            if k < len(out) - 1:
                first.remove(out[k + 1])
            elif k >= len(out):
                second.remove(back[k - len(out)])
        return False
