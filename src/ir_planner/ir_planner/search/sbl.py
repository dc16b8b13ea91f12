"""Two trees whose edges are tested when they join both (SBL).

Sanchez and Latombe, "A single-query bi-directional probabilistic roadmap planner with lazy
collision checking", 2001: milestones grow where few are (a grid over two joints, which change),
sampled near one of the tree in ever smaller cubes; a new one is joined to the nearest of the other
tree; the path is then tested edge by edge, the least tested one first. A configuration has n
coordinates in the unit cube, one per joint range; distances are the largest difference of a
coordinate.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from ir_planner.checks import FreeSpace
from ir_planner.search.port import Ends, Found
from ir_planner.search.variety import NEAREST_GOALS
from ir_values.arrays import BoolArray, FloatArray, IntArray
from ir_values.settings import check_settings, setting

# Two trees of configurations whose edges are tested only when they join both. A node of tree 0
# leads back to the start, one of tree 1 to a goal. An edge that proves blocked moves the nodes
# behind it to the other tree, which is joined to them by the bridge of the path under test: nothing
# found is lost.

_FIRST = 256  # nodes that space is made for; doubled when they are there
NOBODY = -1


class LazyTrees:
    """Configurations in the unit cube (N, n), each with its parent and its tree; edges with how
    well they were tested.
    """

    def __init__(self, start: FloatArray, goals: FloatArray) -> None:
        n = len(start)
        self._u = np.empty((_FIRST + len(goals), n))
        self._parent = np.full(len(self._u), NOBODY)
        self._tree = np.zeros(len(self._u), dtype=np.int8)
        self.tested = np.zeros(len(self._u), dtype=int)
        """Pieces (N,) by which the edge to the parent was tested, in powers of two."""
        self.count = 0
        self._children: list[list[int]] = []
        self.add(start, NOBODY, 0)
        for goal in goals:
            self.add(goal, NOBODY, 1)

    @property
    def u(self) -> FloatArray:
        """Configurations (N, n)."""
        return self._u[: self.count]

    def add(self, u: FloatArray, parent: int, tree: int) -> int:
        """A new node (n,) of a tree, and its number."""
        if self.count == len(self._u):
            self._u = np.concatenate([self._u, np.empty_like(self._u)])
            self._parent = np.concatenate([self._parent, np.full_like(self._parent, NOBODY)])
            self._tree = np.concatenate([self._tree, np.zeros_like(self._tree)])
            self.tested = np.concatenate([self.tested, np.zeros_like(self.tested)])
        node = self.count
        self._u[node] = u
        self._parent[node] = parent
        self._tree[node] = tree
        self.tested[node] = 0
        self._children.append([])
        if parent != NOBODY:
            self._children[parent].append(node)
        self.count += 1
        return node

    def tree_of(self, node: int) -> int:
        """0 where the node leads back to the start, 1 where it leads to a goal."""
        return int(self._tree[node])

    def members(self, tree: int) -> IntArray:
        """Numbers of the nodes of a tree, oldest first."""
        return np.flatnonzero(self._tree[: self.count] == tree)

    def nearest(self, node: int) -> tuple[int, float]:
        """The node of the other tree that is nearest in the largest difference, and how far it
        is.
        """
        others = self.members(1 - self.tree_of(node))
        far = np.abs(self._u[others] - self._u[node]).max(axis=1)
        k = int(far.argmin())
        return int(others[k]), float(far[k])

    def to_root(self, node: int) -> list[int]:
        """The node and what lies between it and its root, the root last."""
        found = [node]
        while self._parent[found[-1]] != NOBODY:
            found.append(int(self._parent[found[-1]]))
        return found

    def move(self, cut: int, bridge_from: int, bridge_to: int, tested: int) -> None:
        """Take off the branch at `cut`, whose edge to its parent is blocked, and hang it into the
        other tree by the bridge from its node `bridge_from` to `bridge_to`, which was `tested` so
        far.
        """
        self._children[self._parent[cut]].remove(cut)
        self._parent[cut] = NOBODY
        turned = self.to_root(bridge_from)
        levels = [int(self.tested[node]) for node in turned]
        for lower, upper in zip(turned[-2::-1], turned[:0:-1], strict=True):
            self._children[upper].remove(lower)
            self._children[lower].append(upper)
            self._parent[upper] = lower
        for upper, level in zip(turned[1:], levels[:-1], strict=True):
            self.tested[upper] = level
        self._parent[bridge_from] = bridge_to
        self.tested[bridge_from] = tested
        self._children[bridge_to].append(bridge_from)
        tree = self._tree[bridge_to]
        stack = [bridge_from]
        while stack:
            node = stack.pop()
            self._tree[node] = tree
            stack += self._children[node]


# configurations that cost as much as one certified edge, as in the genetic search
_STATES_PER_EDGE = 40
# by which the cube is divided, sample by sample, in batches
_SIZES = np.arange(1, 65).reshape(16, 4)
_CERTIFIED = 64  # level of an edge that is proved: beyond all that pieces are counted by


@dataclass(frozen=True)
class Sbl:
    """Two trees of milestones whose edges are tested only when they join both (SBL)."""

    keeps_upright: ClassVar[bool] = True
    near: float = setting(
        0.15,
        "Size of the cube in which milestones are sampled, and joined; share of the joint range.",
        minimum=0.001,
        maximum=1.0,
    )
    cells: int = setting(
        10, "Cells of the grid along each of its two joints.", minimum=1, maximum=100
    )
    redraw: int = setting(
        50, "Milestones until other joints span the grid.", minimum=1, maximum=100_000
    )
    resolution: float = setting(
        0.05,
        "Pieces that an edge is sampled in before it is proved.",
        unit="rad",
        minimum=0.001,
        maximum=1.0,
    )
    milestones: int = setting(
        100_000, "Milestones before it is given up.", minimum=2, maximum=10_000_000
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """One path, or none."""
        return _Sbl(self, ends, space, np.random.default_rng(seed)).found()


@dataclass
class _Bridge:
    """Nodes of both trees, and how well the edge between them was tested."""

    ends: tuple[int, int]
    tested: int = 0


@dataclass
class _Sbl:
    """One search."""

    settings: Sbl
    ends: Ends
    space: FreeSpace
    rng: np.random.Generator
    _states: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._low = self.space.low
        self._range = self.space.high - self.space.low
        goals = self.ends.goals[:NEAREST_GOALS]
        goals = goals[self.space.states_free(goals)]
        self._roots = np.concatenate([self.ends.start[None], goals])
        self._trees = LazyTrees(self._unit(self.ends.start), self._unit(goals))
        self._grid = _Grid(self.settings.cells, self.rng)

    def found(self) -> Found:
        trees = self._trees
        work = self.space.work
        if trees.count > 1:
            path = self._joined(0)  # start and goal may be near each other
            while path is None and trees.count < self.settings.milestones and not work.exhausted:
                node = self._expanded()
                path = self._joined(node) if node >= 0 else None
            if path is not None:
                return Found([path])
        return Found([], f"{trees.count} milestones were not joined")

    def _unit(self, q: FloatArray) -> FloatArray:
        return np.asarray((q - self._low) / self._range)

    def _q(self, nodes: list[int]) -> FloatArray:
        """Configurations (M, n) rad of a path's nodes; it begins and ends with roots as they were
        given.
        """
        q = self._low + self._trees.u[nodes] * self._range
        q[[0, -1]] = self._roots[[nodes[0], nodes[-1]]]
        return np.asarray(q)

    def _free(self, q: FloatArray) -> BoolArray:
        """Which of q (N, n) are free; charged to the work, and not looked at where that does not
        suffice.
        """
        work = self.space.work
        after = self._states + len(q)
        edges = after // _STATES_PER_EDGE - self._states // _STATES_PER_EDGE
        self._states = after
        if edges > work.left:
            work.spend(work.left)
            return np.zeros(len(q), dtype=bool)
        work.spend(edges)
        return self.space.states_free(q)

    def _expanded(self) -> int:
        """A new milestone near one where few are, in either tree; -1 where no sample was free."""
        trees = self._trees
        self.space.work.spend(1)  # what a milestone costs beside its samples
        if trees.count % self.settings.redraw == 0:
            self._grid.redraw(trees.u.shape[1])
        tree = int(self.rng.integers(2))
        parent = self._grid.picked(trees, tree)
        here = trees.u[parent]
        for parts in _SIZES:
            size = self.settings.near / parts[:, None]
            u = self.rng.uniform(np.maximum(here - size, 0.0), np.minimum(here + size, 1.0))
            free = np.flatnonzero(self._free(self._low + u * self._range))
            if len(free):
                return trees.add(u[free[0]], parent, tree)
            if self.space.work.exhausted:
                break
        return -1

    def _joined(self, node: int) -> FloatArray | None:
        """The path over a bridge from a node to the other tree, where both are near and all of it
        is free.
        """
        other, far = self._trees.nearest(node)
        if far >= self.settings.near:
            return None
        ends = (node, other) if self._trees.tree_of(node) == 0 else (other, node)
        return self._tested(_Bridge(ends))

    def _tested(self, bridge: _Bridge) -> FloatArray | None:
        """The path (M, n) from the start over the bridge to a goal; None where an edge is blocked,
        which is taken out.

        Lazily: the longest piece that isn't checked yet is halved first, as a collision is most
        likely in it. An edge at level L is checked at 2^L - 1 places; trees remember the levels.
        """
        trees = self._trees
        left, right = bridge.ends
        back = trees.to_root(left)
        on = trees.to_root(right)
        nodes = [*back[::-1], *on]
        # the node that an edge belongs to, the one farther from its root; -1 for the bridge
        owners = [*back[-2::-1], -1, *on[:-1]]
        q = self._q(nodes)
        length = np.abs(np.diff(q, axis=0)).max(axis=1)
        levels = [bridge.tested if owner < 0 else trees.tested[owner] for owner in owners]
        level = np.array(levels)
        while not self.space.work.exhausted:
            unchecked = length / (1 << np.minimum(level, 60))
            piece = np.where(level < _CERTIFIED, unchecked, 0.0)
            k = int(piece.argmax())
            if piece[k] <= self.settings.resolution:
                break
            parts = 2 ** (level[k] + 1)
            shares = np.arange(1, parts, 2) / parts
            places = q[k] + shares[:, None] * (q[k + 1] - q[k])
            if not self._free(places).all():
                self._cut(owners[k], bridge)
                return None
            level[k] += 1
            self._note(owners[k], bridge, int(level[k]))
        return q if self._is_proved(q, level, owners, bridge) else None

    def _is_proved(
        self, q: FloatArray, level: FloatArray, owners: list[int], bridge: _Bridge
    ) -> bool:
        """Whether every edge of the path q (M, n) is certified; the first that isn't is taken
        out.
        """
        open_edges = np.flatnonzero(level < _CERTIFIED)
        free = self.space.edges_free(q[open_edges], q[open_edges + 1])
        for k in open_edges[free]:
            self._note(owners[k], bridge, _CERTIFIED)
        if free.all():
            return True
        if not self.space.work.exhausted:
            self._cut(owners[open_edges[~free][0]], bridge)
        return False

    def _note(self, owner: int, bridge: _Bridge, level: int) -> None:
        if owner < 0:
            bridge.tested = level
        else:
            self._trees.tested[owner] = level

    def _cut(self, owner: int, bridge: _Bridge) -> None:
        """Take out a blocked edge: what hangs behind it goes to the other tree, over the bridge."""
        if owner >= 0:
            left, right = bridge.ends
            inside, outside = (left, right) if self._trees.tree_of(owner) == 0 else (right, left)
            self._trees.move(owner, inside, outside, bridge.tested)


class _Grid:
    """Cells over two joints: a milestone is picked from a cell that is picked among those that have
    any.
    """

    def __init__(self, cells: int, rng: np.random.Generator) -> None:
        self._cells = cells
        self._rng = rng
        self._joints = np.array([0, 1])

    def redraw(self, n: int) -> None:
        """Other two of n joints."""
        self._joints = self._rng.choice(n, size=2, replace=False)

    def picked(self, trees: LazyTrees, tree: int) -> int:
        """A node of the tree."""
        members = trees.members(tree)
        place = np.minimum(
            (trees.u[np.ix_(members, self._joints)] * self._cells).astype(int), self._cells - 1
        )
        cell = place[:, 0] * self._cells + place[:, 1]
        cells = np.unique(cell)
        inside = members[cell == cells[self._rng.integers(len(cells))]]
        return int(inside[self._rng.integers(len(inside))])
