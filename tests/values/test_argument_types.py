"""Arguments of the types in their annotations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from numpy.typing import ArrayLike

from ir_values.argument_types import typed
from ir_values.arrays import IntArray
from ir_values.errors import InvalidValueError


@typed(InvalidValueError)
def given(
    values: ArrayLike | None = None,
    counts: IntArray | None = None,
    names: Sequence[str] = (),
    rows: Sequence[ArrayLike] | None = None,
    limits: Mapping[str, float] | None = None,
    later: Later | None = None,
) -> tuple[object, ...]:
    return values, counts, names, rows, limits, later


class Later:
    """What an annotation names before it is there."""


def test_a_list_for_an_array_is_converted_once_and_nothing_else_is() -> None:
    """An array of whole numbers stays one, a list of lists for a list as it is."""
    counts = np.array([2**60 + 1])
    rows = [[1.0], [2.0]]
    limits = {"a": 1.0}
    values, *others = given([1, 2], counts, ["x"], rows, limits, Later())
    assert isinstance(values, np.ndarray)
    assert values.dtype == np.float64
    assert others[0] is counts
    assert others[2] is rows
    assert others[3] is limits
    own = np.zeros(3)
    assert given(own)[0] is own
    assert given(values=None)[0] is None


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"values": [[1.0], [1.0, 2.0]]}, "values is .*: it must be an array of numbers or None"),
        ({"values": "x"}, "values is 'x'"),
        ({"names": "x"}, "names is 'x': it must be a list"),
        ({"names": [1]}, r"names is \[1\]"),
        ({"rows": [1.0, "x"]}, "rows is"),
        ({"limits": {"a": "x"}}, "limits is .*: it must be a mapping or None"),
        ({"later": 1}, "later is 1: it must be a Later or None"),
    ],
)
def test_what_does_not_fit_is_one_sentence(arguments: dict[str, object], sentence: str) -> None:
    with pytest.raises(InvalidValueError, match=sentence):
        given(**arguments)  # type: ignore[arg-type]
