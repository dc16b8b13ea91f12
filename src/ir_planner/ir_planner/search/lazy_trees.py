"""Two trees of configurations whose edges are tested only when they join both (the data of SBL).

A node of tree 0 leads back to the start, one of tree 1 to a goal. An edge that proves blocked moves
what
hangs behind it to the other tree, which is joined to it by the bridge of the path under test:
nothing found is lost.
"""

from __future__ import annotations

import numpy as np

from ir_msgs_py.arrays import FloatArray, IntArray

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
