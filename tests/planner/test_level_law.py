"""Laws whose ramps step down in levels: exact at both ends, within their bounds, and shorter where
torque binds.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_planner.scene.motion_limits import torque_use
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.timing.jerk_limited_laws import GRID_S, LEVELS, LevelLaw, level_laws
from ir_planner.timing.ptp import fastest, fastest_law, fastest_levels, path_limits

level = st.lists(st.floats(0.3, 12.0), min_size=LEVELS, max_size=LEVELS)


@given(st.floats(0.2, 3.0), level, level, st.floats(20.0, 400.0))
@settings(deadline=None, max_examples=40)
def test_a_law_of_levels_arrives_at_rest_and_integrates(
    speed: float, up: list[float], down: list[float], jerk: float
) -> None:
    laws = level_laws(np.array([speed]), np.array([up]), np.array([down]), jerk)
    law = LevelLaw(
        tuple(int(k) for k in laws.steps[0]), tuple(float(a) for a in laws.accelerations[0])
    )
    s, sd, sdd = law.at(np.arange(law.total + 1))
    assert (s[0], sd[0], sdd[0]) == (0.0, 0.0, 0.0)
    assert (s[-1], sd[-1], sdd[-1]) == (1.0, 0.0, 0.0)
    assert laws.path_parameters[0, -1] == pytest.approx(1.0, abs=1e-12)
    assert laws.speeds[0, -1] == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(s) >= -1e-12).all()
    assert np.diff(sd) / GRID_S == pytest.approx(0.5 * (sdd[:-1] + sdd[1:]), abs=1e-7)


@pytest.mark.parametrize(
    ("start", "goal"),
    [
        ((0, -90, 90, 0, 0, 0), (90, -60, 60, 30, 30, 0)),
        ((0, -90, 90, 0, 0, 0), (60, -90, 90, 0, 0, 0)),
        ((-90, -70, 90, 0, 60, 0), (90, -70, 90, 0, 60, 0)),
    ],
)
def test_levels_are_faster_where_torque_falls_with_speed(
    start: Any, goal: Any, demo_scene: PlanningScene, degrees: Callable[..., Any]
) -> None:
    a = degrees(*start)
    b = degrees(*goal)
    limits = demo_scene.limits
    dynamics = demo_scene.dynamics
    law = fastest(a, b, limits, dynamics)
    assert law.total < 0.97 * fastest_law(a, b, limits, dynamics).total
    s, sd, sdd = (x[:, None] for x in law.at(np.arange(law.total + 1)))
    use = torque_use(dynamics, a + s * (b - a), sd * (b - a), sdd * (b - a))
    assert use.max() <= limits.torque_share + 0.01
    assert (np.abs(sd * (b - a)) <= limits.velocity * (1 + 1e-9)).all()
    assert (np.abs(sdd * (b - a)) <= limits.acceleration * (1 + 1e-9)).all()


def test_a_load_beyond_the_torque_has_no_levels(
    demo_scene: PlanningScene, degrees: Callable[..., Any]
) -> None:
    a = degrees(0, -90, 90, 0, 0, 0)
    b = degrees(0, -40, 40, 0, 0, 0)
    bounds = path_limits(b - a, demo_scene.limits)
    assert fastest_levels(a, b - a, bounds, 0.01, demo_scene.dynamics) is None
