"""Boxes that overlap: the order along x finds what every pair compared with every other finds."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ir_description.shapes import overlapping
from ir_values.arrays import FloatArray

# few different corners, so that boxes touch, coincide and stand for points; a plane has no bounds
CORNERS = st.sampled_from([-np.inf, -1.0, 0.0, 0.25, 0.5, 1.0, np.inf])
BOX = st.tuples(*[st.tuples(CORNERS, CORNERS).map(sorted)] * 3)
BOXES = st.lists(BOX, max_size=12).map(
    lambda boxes: np.array(boxes).reshape(-1, 3, 2).swapaxes(1, 2)
)


@given(BOXES, BOXES)
def test_every_pair_that_overlaps_is_found_once_and_in_order(
    first: FloatArray, second: FloatArray
) -> None:
    expected = [
        (a, b)
        for a, one in enumerate(first)
        for b, other in enumerate(second)
        if (one[0] <= other[1]).all() and (other[0] <= one[1]).all()
    ]
    assert list(overlapping(first, second)) == expected
