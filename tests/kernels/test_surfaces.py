"""Surfaces of triangles against Coal, which finds distances and contacts of meshes by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_kernels import KernelError
from ir_kernels.surfaces import Surface, core_of
from ir_values.arrays import FloatArray

coal = pytest.importorskip("coal")

CLEAR = 1e-6  # m: nearer to the limit Coal's distances decide nothing
PLENTY = 10**9


def soup(draw: np.random.Generator, count: int) -> FloatArray:
    """Triangles (count, 3, 3) of sizes from 1 mm to 0.3 m; flat, thin and long ones among them."""
    size = 10.0 ** draw.uniform(-3.0, -0.5, (count, 1, 1)) * draw.choice([1.0, 1e-3], (count, 1, 3))
    return np.asarray(
        draw.uniform(-0.3, 0.3, (count, 1, 3)) + size * draw.normal(size=(count, 3, 3))
    )


def pose_of(draw: np.random.Generator, away: float) -> FloatArray:
    q, r = np.linalg.qr(draw.normal(size=(3, 3)))
    turn = q * np.sign(np.diag(r))
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    pose = np.eye(4)
    pose[:3, :3] = turn
    pose[:3, 3] = draw.uniform(-away, away, 3)
    return pose


def coal_model(triangles: FloatArray) -> Any:
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), 3 * len(triangles))
    model.addVertices(triangles.reshape(-1, 3))
    model.addTriangles(np.arange(3 * len(triangles)).reshape(-1, 3))
    model.endModel()
    return model


def coal_distance(first: FloatArray, second: FloatArray, pose: FloatArray) -> float:
    there = coal.Transform3s(pose[:3, :3], pose[:3, 3])
    result = coal.DistanceResult()
    return float(
        coal.distance(
            coal_model(first),
            there,
            coal_model(second),
            coal.Transform3s(),
            coal.DistanceRequest(),
            result,
        )
    )


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 40))
def test_surfaces_meet_where_coal_finds_them_so_near(seed: int, count: int) -> None:
    draw = np.random.default_rng(seed)
    first = soup(draw, count)
    second = soup(draw, int(draw.integers(1, 40)))
    pose = pose_of(draw, 0.5)
    one, other = (Surface(each, np.zeros(len(each))) for each in (first, second))
    distance = max(coal_distance(first, second, pose), 0.0)
    for near in (distance - CLEAR, distance + CLEAR, 0.03):
        if near < 0.0 or abs(near - distance) < 0.5 * CLEAR:
            continue
        met, _ = one.meets(other, pose[None], near, PLENTY)
        assert met[0] == (distance <= near)
        assert one.touching(other, pose, near).any() == met[0]


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(4))
def test_the_compiled_core_finds_the_triangles_of_the_reference(
    compiled_core: Any, seed: int
) -> None:
    """Also of those that stand for something beside them, points and segments among them."""
    draw = np.random.default_rng(seed)
    first = soup(draw, 60)
    first[:10] = first[:10, :1]
    first[10:20, 1] = first[10:20, 2]
    second = soup(draw, 30)
    beside = [draw.uniform(0.0, 0.02, len(each)) for each in (first, second)]
    poses = np.array([pose_of(draw, 0.4) for _ in range(5)])
    found = []
    for module in (None, compiled_core):
        one = core_of(first, beside[0], module)
        other = core_of(second, beside[1], module)
        touching = np.array([one.touching(other, pose, 0.001) for pose in poses])
        assert (one.meets(other, poses, 0.001, PLENTY)[0] == touching.any(axis=1)).all()
        found.append(touching)
    assert (found[0] == found[1]).all()


def test_surfaces_that_are_looked_at_too_long_are_taken_to_meet() -> None:
    flat = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    surface = Surface(flat, np.zeros(1))
    away = np.repeat(np.eye(4)[None], 3, axis=0)
    away[:, 2, 3] = 0.1
    met, looked_at = surface.meets(surface, away, 0.05, 3)
    assert not met.any()
    assert looked_at == 3
    met, looked_at = surface.meets(surface, away, 0.05, 2)
    assert met.tolist() == [False, False, True]


def test_what_is_no_surface_is_refused() -> None:
    with pytest.raises(KernelError, match="expected"):
        Surface(np.zeros((2, 3, 3)), np.zeros(3))
    with pytest.raises(KernelError, match="not finite"):
        Surface(np.full((1, 3, 3), np.nan), np.zeros(1))
    empty = Surface(np.zeros((0, 3, 3)), np.zeros(0))
    assert not empty.meets(empty, np.eye(4)[None], 1.0, PLENTY)[0].any()
