"""The population of a withdrawal: configurations on their paths out, with what the next generation
needs.
"""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray, IntArray


@dataclass(eq=False)
class ExitPopulation:
    """Configurations (N, n) with D (N,), spread (N,) rad, the step (N, n) that led here, index of
    their node.
    """

    q: FloatArray
    total: FloatArray
    sigma: FloatArray
    step: FloatArray
    node: IntArray

    def of(self, rows: IntArray) -> "ExitPopulation":
        """Those of the `rows` (M,)."""
        return ExitPopulation(
            self.q[rows], self.total[rows], self.sigma[rows], self.step[rows], self.node[rows]
        )

    def __len__(self) -> int:
        return len(self.q)


def joined(a: ExitPopulation, b: ExitPopulation) -> ExitPopulation:
    """The configurations of both."""
    both = ((getattr(a, name), getattr(b, name)) for name in a.__dataclass_fields__)
    return ExitPopulation(*(np.concatenate(pair) for pair in both))


def counted(numbers: IntArray) -> list[tuple[int, int]]:
    """Every one of the numbers (N,), none negative, and how often it is there, in order."""
    counts = np.bincount(numbers)
    return [(z, int(counts[z])) for z in np.flatnonzero(counts).tolist()]
