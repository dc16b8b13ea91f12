"""Quaternions and rotations against SciPy's, for any quaternion."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ir_values.rotations import quaternions_from_rotations, rotations_from_quaternions

NUMBER = st.floats(-1.0, 1.0).map(lambda value: value if abs(value) > 1e-6 else 0.0)
QUATERNION = st.tuples(NUMBER, NUMBER, NUMBER, NUMBER).filter(lambda q: np.linalg.norm(q) > 1e-3)


@given(QUATERNION)
def test_both_ways_are_scipys(q: tuple[float, ...]) -> None:
    turned = Rotation.from_quat(q)
    matrix = turned.as_matrix()
    assert rotations_from_quaternions(np.array(q)) == pytest.approx(matrix, abs=1e-15)
    found = quaternions_from_rotations(matrix)
    assert found == pytest.approx(Rotation.from_matrix(matrix).as_quat(canonical=True), abs=1e-15)


def test_many_at_once_are_the_same_as_one_by_one() -> None:
    q = np.random.default_rng(3).normal(size=(50, 2, 4))
    R = rotations_from_quaternions(q)
    assert R.shape == (50, 2, 3, 3)
    back = quaternions_from_rotations(R)
    assert np.array_equal(back[7, 1], quaternions_from_rotations(R[7, 1]))
    assert np.array_equal(R[7, 1], rotations_from_quaternions(q[7, 1]))


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -1, 0), (0, -1, 1)])
def test_a_half_turn_has_the_first_component_positive(axis: tuple[int, ...]) -> None:
    unit = np.array(axis) / np.linalg.norm(axis)
    q = quaternions_from_rotations(2.0 * np.outer(unit, unit) - np.eye(3))
    assert q[3] == 0.0
    assert q[np.flatnonzero(q)[0]] > 0.0
