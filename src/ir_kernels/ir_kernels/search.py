"""A path between configurations found by two trees that grow towards each other over certified
edges.

J. Kuffner and S. LaValle, "RRT-Connect", ICRA 2000, in batches. The search is an object that is
grown in slices, so that the caller can stop between them; what it finds does not depend on the
slices.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ir_kernels import compiled
from ir_kernels.arguments import checked
from ir_kernels.collision import CollisionModel
from ir_kernels.errors import KernelError
from ir_values.arrays import FloatArray


class BidirectionalTree:
    """Searches a path from start (n,) to any of goals (G, n) on which every pair's distance exceeds
    its threshold (one number or (Z,)) [m].

    low, high (n,): limits of the joints [rad]. scale (n,): how much each joint counts in the
    distance of configurations. seed: the same one gives the same path, another one usually another.
    start_line (M, n), goal_lines (one (M_g, n) per goal): free paths that are known already, as a
    straight retraction: the configurations that follow the start, or that goal. They are certified
    like all else, and become the trees' first branches as far as they are free.

    Work is counted in certified edges; sixteen configurations that are only looked at count as one.
    Different objects may be grown in different threads at once.

    Raises KernelError for arguments that make no sense, among them a start that isn't free, and
    goals none of which is. A goal that isn't free, while another one is, is never reached.
    """

    def __init__(
        self,
        collision: CollisionModel,
        start: ArrayLike,
        goals: ArrayLike,
        threshold: ArrayLike,
        low: ArrayLike,
        high: ArrayLike,
        scale: ArrayLike,
        seed: int,
        *,
        start_line: ArrayLike | None = None,
        goal_lines: Sequence[ArrayLike] | None = None,
    ) -> None:
        n = collision.chain.n
        self._n = n
        least = checked("low", low, n)
        most = checked("high", high, n)
        if (least > most).any():
            raise KernelError(
                f"low is {least[least > most][0]} where high is {most[least > most][0]} rad"
            )
        weights = checked("scale", scale, n)
        if (weights <= 0.0).any():
            raise KernelError(f"scale holds {weights.min()}: expected more than 0")
        if not 0 <= seed < 2**64:
            raise KernelError(f"seed is {seed}: expected at least 0 and less than 2^64")
        limits = collision._per_pair(threshold, "threshold")
        first = checked("start", start, n)
        last = checked("goals", goals, None, n)
        line = _line("start_line", np.empty((0, n)) if start_line is None else start_line, n)
        lines = _goal_lines(goal_lines, len(last), n)
        for name, rows in (
            ("start", first[None]),
            ("goals", last),
            ("start_line", line),
            *((f"goal_lines[{g}]", rows) for g, rows in enumerate(lines)),
        ):
            _check_within(name, rows, least, most)
        free = collision.is_free(np.concatenate([first[None], last]), limits)
        if not free[0]:
            raise KernelError("start is not free: a pair is not farther apart than its threshold")
        if not free[1:].any():
            raise KernelError("goals holds no configuration that is free")
        core = _core()
        self._search = core(
            collision._core, first, last, limits, least, most, weights, int(seed), line, lines
        )

    def grow(self, max_edges: int) -> bool:
        """Search on, for at most so many certified edges; whether a path has been found.

        Raises KernelError where max_edges is negative.
        """
        if max_edges < 0:
            raise KernelError(f"max_edges is {max_edges}: expected at least 0")
        return bool(self._search.grow(min(int(max_edges), 2**62)))

    @property
    def found(self) -> bool:
        """Whether there is a path."""
        return bool(self._search.found())

    @property
    def path(self) -> FloatArray:
        """(M, n) from the start to a goal, both exact; every step, in this direction, has a FREE
        certificate. (0, n) while none has been found.
        """
        return np.array(self._search.path(), dtype=np.float64).reshape(-1, self._n)

    @property
    def goal_index(self) -> int:
        """Which of the goals the path ends at; -1 while none has been found."""
        return int(self._search.goal())

    @property
    def edges(self) -> int:
        """The work spent so far."""
        return int(self._search.edges())

    @property
    def nodes(self) -> tuple[int, int]:
        """How many configurations the tree of the start and that of the goals hold."""
        first, second = self._search.nodes()
        return int(first), int(second)

    @property
    def gap(self) -> float:
        """The least weighted distance of two nodes, one of each tree, that were compared so far."""
        return float(self._search.gap()[0])

    @property
    def gap_ends(self) -> FloatArray:
        """(2, n): those nodes; how near a search came that found nothing."""
        return np.array(self._search.gap()[1], dtype=np.float64).reshape(2, self._n)


def _core() -> compiled.Core:
    """The compiled search, or the one in NumPy."""
    if compiled.MODULE is None:
        from ir_kernels.reference.search import Search

        return Search
    return compiled.MODULE.BidirectionalSearch


def _goal_lines(given: Sequence[ArrayLike] | None, goals: int, n: int) -> list[FloatArray]:
    """A line (M, n) for each goal, empty where none is given."""
    lines = [np.empty((0, n))] * goals if given is None else list(given)
    if len(lines) != goals:
        raise KernelError(f"goal_lines has {len(lines)} lines: expected {goals}, one per goal")
    return [_line(f"goal_lines[{g}]", value, n) for g, value in enumerate(lines)]


def _line(name: str, value: ArrayLike, n: int) -> FloatArray:
    """A line (M, n), which may have no configuration at all."""
    rows = np.asarray(value)
    return np.empty((0, n)) if rows.shape == (0, n) else checked(name, value, None, n)


def _check_within(name: str, rows: FloatArray, low: FloatArray, high: FloatArray) -> None:
    """Raise KernelError for configurations (M, n) outside the limits."""
    outside = np.argwhere((rows < low) | (rows > high))
    if len(outside):
        k, j = outside[0]
        raise KernelError(
            f"{name} has joint {j} at {rows[k, j]} rad: expected {low[j]} to {high[j]} rad"
        )
