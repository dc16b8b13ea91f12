"""The bound of the tool's distance from its path, against dense samples by kinematics of another library."""

from __future__ import annotations

import itertools
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner
from ir_planner.cartesian import arc_through
from ir_planner.cartesian.corners import joined
from ir_planner.cartesian.parts import parts_of
from ir_planner.cartesian.places import Through

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from _tool_path_judge import _tool

RATE = 5000.0  # Hz
ROUNDING = 1e-9  # m
Place = tuple[float, float, float]
coordinate = st.floats(-0.3, 0.3)
places = st.tuples(coordinate, coordinate, coordinate)


@pytest.fixture(scope="module")
def planner() -> Planner:
    planner = Planner(time.monotonic)
    planner.set_cell("", "open")
    return planner


def pose(place: Place, turned: Place = (0.0, 0.0, 0.0)) -> FloatArray:
    result = np.eye(4)
    down = Rotation.from_euler("y", 90.0, degrees=True)
    result[:3, :3] = (down * Rotation.from_rotvec(turned)).as_matrix()
    result[:3, 3] = np.array(place) + np.array([1.8, 0.0, 1.3])
    return result


def from_line(points: FloatArray, start: FloatArray, end: FloatArray) -> FloatArray:
    ahead = (end - start) / np.linalg.norm(end - start)
    return np.asarray(np.linalg.norm(np.cross(points - start, ahead), axis=1))


def from_circle(points: FloatArray, start: FloatArray, via: FloatArray, end: FloatArray) -> FloatArray:
    circle = arc_through(start, via, end)
    assert circle is not None
    axis = np.cross(circle.radius, circle.across)
    axis /= np.linalg.norm(axis)
    out = points - circle.centre
    height = out @ axis
    across = np.linalg.norm(out - height[:, None] * axis, axis=1) - np.linalg.norm(circle.radius)
    return np.asarray(np.hypot(height, across))


@settings(max_examples=6)
@given(first=places, via=places, last=places, turned=places, speed=st.floats(0.05, 0.8), round_=st.booleans())
def test_no_sample_is_farther_from_the_path_than_the_bound(
    planner: Planner,
    first: Place,
    via: Place,
    last: Place,
    turned: Place,
    speed: float,
    round_: bool,
) -> None:
    poses = pose(first), pose(via), pose(last, turned)
    ends = [one[:3, 3] for one in poses]
    if round_ and arc_through(*ends) is None:
        return
    segment = CartesianSegment("circle", poses[1:]) if round_ else CartesianSegment("line", poses[2:])
    if np.linalg.norm(ends[2] - ends[0]) < 0.01:
        return
    plan = planner.plan_cartesian(
        CartesianPath(poses[0], (segment,), speed, speed_tolerance=1.0), PlanOptions()
    )
    if plan.trajectory is None:
        return
    times = np.arange(0.0, plan.trajectory.duration, 1.0 / RATE)
    tool = _tool(plan.trajectory.sample(times).q, planner.scene())[:, :3, 3]
    away = from_circle(tool, *ends) if round_ else from_line(tool, ends[0], ends[2])
    assert away.max() <= plan.tool_error + ROUNDING


@settings(max_examples=40)
@given(st.lists(places, min_size=3, max_size=7))
def test_a_spline_bends_nowhere_more_than_its_bound(through: list[Place]) -> None:
    points = np.array(through)
    if np.linalg.norm(np.diff(points, axis=0), axis=1).min() < 0.01:
        return
    curve = Through(points)
    u = np.linspace(*curve._curve.t[[0, -1]], 2000)
    speed, bent = (curve._curve(u, nu=k) for k in (1, 2))
    length = np.linalg.norm(speed, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        bends = np.linalg.norm(np.cross(speed, bent), axis=1) / length**3
    assert np.nanmax(bends[length > 1e-6]) <= curve.curvature * (1.0 + 1e-9)


@settings(max_examples=25)
@given(places, st.floats(0.005, 0.2))
def test_no_rounded_corner_bends_more_than_its_bound(corner: Place, radius: float) -> None:
    poses = pose((-0.3, 0.0, 0.0)), pose(corner), pose((0.3, 0.1, 0.0))
    steps = [np.linalg.norm(b[:3, 3] - a[:3, 3]) for a, b in itertools.pairwise(poses)]
    if min(steps) < 0.05:
        return
    segments = tuple(CartesianSegment("line", (one,)) for one in poses[1:])
    path = CartesianPath(poses[0], segments, blending_radius=radius)
    whole, _ = joined(path, parts_of(path))
    h = 1e-5
    u = np.linspace(h, whole.corners[-1] - h, 4000)
    tangents = [whole.tangents(u + step) for step in (-h, h)]
    second = np.linalg.norm(tangents[1] - tangents[0], axis=1) / (2.0 * h)
    bounds = whole.bends(np.append(u - h, u[-1] + h))
    stops = np.abs(u[:, None] - whole.corners[whole.radius == 0.0]).min(axis=1) < 2.0 * h
    assert (second <= bounds * (1.0 + 1e-6) + 1e-4)[~stops].all()
