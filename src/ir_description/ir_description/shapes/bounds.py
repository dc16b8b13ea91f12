"""Which boxes along the axes overlap: by their order along x, so that few of many pairs are looked
at.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ir_msgs_py.arrays import FloatArray


def overlapping(first: FloatArray, second: FloatArray) -> Iterator[tuple[int, int]]:
    """Numbers of the boxes of `first` (A, 2, 3) and `second` (B, 2, 3), lowest and highest corner,
    that
    overlap or touch: a in order, and for each a its b in order.
    """
    order = np.argsort(second[:, 0, 0], kind="stable")
    low = second[order, 0]
    high = second[order, 1]
    highest = np.maximum.accumulate(high[:, 0]) if len(order) else np.zeros(0)
    begins = np.searchsorted(highest, first[:, 0, 0])  # all before end too soon
    ends = np.searchsorted(low[:, 0], first[:, 1, 0], side="right")  # all after begin too late
    for a, (begin, end) in enumerate(zip(begins, ends, strict=True)):
        near = slice(begin, end)
        apart = (low[near] > first[a, 1]) | (high[near] < first[a, 0])
        for b in np.sort(order[near][~apart.any(axis=1)]):
            yield a, int(b)
