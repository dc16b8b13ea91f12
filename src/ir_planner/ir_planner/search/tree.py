"""Two trees grow from start and goals towards each other (RRT-Connect), over certified edges.

The search itself is compiled (`ir_kernels.search`); here it is grown in slices that are charged to
the budget, so that a request can be stopped between them.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from ir_kernels.search import BidirectionalTree
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.upright_tree import TreeMeeting, connect_upright
from ir_values.arrays import FloatArray
from ir_values.settings import check_settings, setting

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

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
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

    Raises CancelledError when asked to stop, ir_kernels.InputError where start, or every goal,
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
