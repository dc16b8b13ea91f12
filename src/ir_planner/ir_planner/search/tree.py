"""Two trees grow from start and goals towards each other (RRT-Connect), over certified edges.

The search itself is compiled (`ir_kernels.search`); here it is grown in slices that are charged to
the budget, so that a request can be stopped between them.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from ir_kernels.search import BidirectionalTree
from ir_planner.checks import FreeSpace
from ir_planner.scene import ToolCone
from ir_planner.search.port import Ends, Found
from ir_values.arrays import BoolArray, FloatArray, IntArray
from ir_values.settings import check_settings, setting

# Two trees that grow from start and goals towards each other while the tool stays in its cone.
#
# D. Berenson, S. Srinivasa, J. Kuffner, "Task Space Regions", IJRR 2011 (CBiRRT), in batches:
# targets are brought into the cone, and so is every step towards one. Steps are short where the
# cone is narrow: between two configurations in it a straight step of the joints bulges out of it
# with its square.

_BATCH = 16  # targets of a round
_JOINED = 6  # new nodes of a round from which the other tree is walked to
_STEP = 0.5  # longest step, weighted rad
_SHORTEST_STEP = 0.05
_BULGE = 1.6  # the step is this times the root of the largest tilt
_OUT = 4  # steps towards a target
_ACROSS = 40  # steps towards the other tree
_CLOSER = 0.1  # of a step that it has to get nearer by
_AROUND = 0.55  # share of targets scattered around nodes of the tree that grows
_OTHER = 0.15  # share of targets that are nodes of the other tree; the rest: anywhere
_SPREADS = (0.1, 0.2, 0.4, 0.8)  # rad of what is scattered
_BOXED = 0.7  # of the rest, within a margin of the box around start and goals
_MARGIN = 1.0  # rad
_FIRST = 64  # nodes that a tree has room for at first


class TreeMeeting(NamedTuple):
    """A free path (M, n), or None; then gap [rad]: how near the trees came, each joint by its
    scale.
    """

    path: FloatArray | None
    gap: float


class _Tree:
    """Configurations with their parents, -1 for roots."""

    def __init__(self, roots: FloatArray, scale: FloatArray) -> None:
        self._scale = scale
        self._nodes = np.empty((max(_FIRST, 2 * len(roots)), roots.shape[1]))
        self._nodes[: len(roots)] = roots
        self._parent = [-1] * len(roots)

    def __len__(self) -> int:
        return len(self._parent)

    @property
    def nodes(self) -> FloatArray:
        """(K, n)."""
        return self._nodes[: len(self)]

    def add(self, q: FloatArray, parent: int) -> int:
        """The number of a new node (n,)."""
        if len(self) == len(self._nodes):
            self._nodes = np.concatenate([self._nodes, np.empty_like(self._nodes)])
        self._nodes[len(self)] = q
        self._parent.append(parent)
        return len(self) - 1

    def nearest(self, q: FloatArray) -> tuple[IntArray, FloatArray]:
        """The node nearest to each of q (M, n), and how far it is (M,)."""
        away = np.zeros((len(q), len(self)))
        for j in range(q.shape[1]):
            apart = self._scale[j] * (q[:, j, None] - self.nodes[None, :, j])
            away += apart * apart
        node = np.argmin(away, axis=1)
        return node, np.sqrt(away[np.arange(len(q)), node])

    def branch(self, node: int) -> list[FloatArray]:
        """Configurations from the root to a node."""
        found = []
        while node >= 0:
            found.append(self._nodes[node].copy())
            node = self._parent[node]
        return found[::-1]


def connect_upright(
    start: FloatArray, goals: FloatArray, space: FreeSpace, cone: ToolCone, seed: int, most: int
) -> TreeMeeting:
    """A free path from start (n,) to one of goals (G, n), unless the budget, or `most` edges, end
    before one is found. Raises CancelledError when asked to stop.
    """
    search = _Search(start, goals, space, cone, seed)
    work = space.work
    until = work.iterations + most
    while not work.exhausted and work.iterations < until:
        path = search.round()
        if path is not None:
            return TreeMeeting(path, 0.0)
    return TreeMeeting(None, search.gap)


class _Search:
    def __init__(
        self, start: FloatArray, goals: FloatArray, space: FreeSpace, cone: ToolCone, seed: int
    ) -> None:
        self._space = space
        self._cone = cone
        self._scale = space.scale
        self._random = np.random.default_rng(seed)
        self._trees = (_Tree(start[None], self._scale), _Tree(goals, self._scale))
        self._step = float(np.clip(_BULGE * np.sqrt(cone.most), _SHORTEST_STEP, _STEP))
        ends = np.concatenate([start[None], goals])
        self._box = (
            np.maximum(ends.min(axis=0) - _MARGIN, space.low),
            np.minimum(ends.max(axis=0) + _MARGIN, space.high),
        )
        self.gap = float(self._trees[1].nearest(start[None])[1][0])

    def round(self) -> FloatArray | None:
        """Grow the smaller tree towards targets, and from what is new towards the other one; the
        path (M, n) where they meet.
        """
        first, second = self._trees
        growing = 0 if len(first) <= len(second) else 1
        here = self._trees[growing]
        there = self._trees[1 - growing]
        targets = self._targets(here, there)
        new, _ = self._walked(here, targets, _OUT)
        fresh = [node for node in new if node >= 0]
        if not fresh:
            return None
        nodes = here.nodes[fresh]
        _, away = there.nearest(nodes)
        self.gap = min(self.gap, float(away.min()))
        chosen = np.argsort(away, kind="stable")[:_JOINED]
        ends, met = self._walked(there, nodes[chosen], _ACROSS)
        for k, reached in zip(chosen, met, strict=True):
            if reached:
                other = there.branch(ends[int(np.flatnonzero(chosen == k)[0])])
                own = here.branch(fresh[int(k)])
                return _path_of_branches(own, other, turned=growing == 1)
        return None

    def _targets(self, here: _Tree, there: _Tree) -> FloatArray:
        """Places (16, n) to grow to, in the cone as far as they were led into it."""
        draw = self._random
        space = self._space
        n = here.nodes.shape[1]
        which = draw.uniform(size=_BATCH)
        boxed = draw.uniform(size=_BATCH) < _BOXED
        low = np.where(boxed[:, None], self._box[0], space.low)
        high = np.where(boxed[:, None], self._box[1], space.high)
        anywhere = low + draw.uniform(size=(_BATCH, n)) * (high - low)
        near = here.nodes[draw.integers(len(here), size=_BATCH)]
        spread = draw.choice(_SPREADS, (_BATCH, 1))
        around = near + spread * draw.uniform(-1.0, 1.0, (_BATCH, n)) / np.maximum(self._scale, 0.3)
        other = there.nodes[draw.integers(len(there), size=_BATCH)]
        q = np.where((which < _AROUND)[:, None], np.clip(around, space.low, space.high), anywhere)
        q = self._cone.brought_in(q, space.low, space.high, self._scale)
        return np.where((which > 1.0 - _OTHER)[:, None], other, q)

    def _walked(self, tree: _Tree, targets: FloatArray, steps: int) -> tuple[list[int], BoolArray]:
        """The last new node of a walk from the tree's nearest node to each of targets (M, n), -1
        where it made no step; and which walks arrived. Of a walk that begins at its target it is
        the node there.

        All walks take a step at once: states and edges are checked in batches.
        """
        space = self._space
        nearest, _ = tree.nearest(targets)
        at = [int(node) for node in nearest]
        last = [-1] * len(targets)
        here = tree.nodes[nearest].copy()
        met = np.zeros(len(targets), dtype=bool)
        active = np.arange(len(targets))
        for _ in range(steps):
            if len(active) == 0 or space.work.exhausted:
                break
            gap = targets[active] - here[active]
            length = self._length(gap)
            final = length <= self._step
            share = np.where(final, 1.0, self._step / np.maximum(length, self._step))
            partial = here[active] + share[:, None] * gap
            following = np.where(final[:, None], targets[active], partial)
            following = np.clip(following, space.low, space.high)
            following[~final] = self._cone.brought_in(
                following[~final], space.low, space.high, self._scale
            )

            # walks go on that come closer and whose step is free
            left = self._length(targets[active] - following)
            closer = left < length - _CLOSER * self._step
            going = (final & (length > 0.0)) | closer
            met[active[final & (length == 0.0)]] = True
            going[going] = space.states_free(following[going])
            rows = np.flatnonzero(going)
            going[rows] = space.edges_free(here[active[rows]], following[rows])
            for k in np.flatnonzero(going):
                lane = int(active[k])
                added = tree.add(following[k], at[lane])
                at[lane] = added
                last[lane] = added
                here[lane] = following[k]
                met[lane] = bool(final[k])
            active = active[going & ~final]
        for lane, node in enumerate(last):
            if node < 0 and met[lane]:
                last[lane] = at[lane]
        return last, met

    def _length(self, gap: FloatArray) -> FloatArray:
        scaled = gap * self._scale
        return np.asarray(np.sqrt((scaled * scaled).sum(axis=1)))


def _path_of_branches(
    own: list[FloatArray], other: list[FloatArray], *, turned: bool
) -> FloatArray:
    """One path (M, n) of two branches that end at the same configuration; turned: own is that of a
    goal.
    """
    first, second = (other, own) if turned else (own, other)
    return np.array([*first, *second[-2::-1]])


_SLICE = 256  # edges between two looks at the clock, about 2 ms


@dataclass(frozen=True)
class Tree:
    """Bidirectional trees over certified edges: finds narrow passages, given work."""

    keeps_upright: ClassVar[bool] = True
    edges: int = setting(
        100_000_000,
        "Certified edges before the trees are given up.",
        minimum=1,
        maximum=100_000_000,
    )
    quick_edges: int = setting(
        4000,
        "The same in the portfolio's first look, and for other homotopy classes.",
        minimum=1,
        maximum=100_000_000,
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def quick(self) -> "Tree":
        """Trees that are given up early."""
        return replace(self, edges=min(self.edges, self.quick_edges))

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """Grow until the trees meet."""
        found = connect(ends.start, ends.goals, space, seed, self.edges)
        if found.path is not None:
            return Found([found.path])
        return Found([], f"the trees came within {np.degrees(found.gap):.1f} deg of each other")


def connect(
    start: FloatArray, goals: FloatArray, space: FreeSpace, seed: int, most: int = 2**62
) -> TreeMeeting:
    """A free path from start (n,) to one of goals (G, n), unless the budget, or `most` edges, end
    before one is found.

    Raises CancelledError when asked to stop, ir_kernels.KernelError where start, or every goal,
    isn't free.
    """
    work = space.work
    if space.cone is not None:
        return connect_upright(start, goals, space, space.cone, seed, most)
    search = BidirectionalTree(
        space.scene.collision,
        start,
        goals,
        space.threshold,
        space.low,
        space.high,
        space.scale,
        seed,
    )
    while not work.exhausted and search.edges < most:
        before = search.edges
        found = search.grow(min(_SLICE, work.max_iterations - work.iterations, most - before))
        work.spend(search.edges - before)
        if found:
            return TreeMeeting(search.path, 0.0)
    return TreeMeeting(None, search.gap)
