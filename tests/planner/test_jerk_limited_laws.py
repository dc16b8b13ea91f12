"""Seven-phase laws: they close at 1 and at rest, keep their limits, and use the distance up."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_planner.timing.jerk_limited_laws import (
    GRID_S,
    LawLimits,
    TimeLaw,
    law_states,
    phase_steps,
    reached_speed,
)

positive = st.floats(0.05, 20.0)


def limits(speed: float, acceleration: float, braking: float, jerk: float) -> LawLimits:
    return LawLimits(*(np.array([value]) for value in (speed, acceleration, braking, jerk)))


@given(positive, positive, positive, st.floats(1.0, 500.0))
@settings(max_examples=200, deadline=None)
def test_a_law_arrives_at_rest_within_its_limits(
    speed: float, acceleration: float, braking: float, jerk: float
) -> None:
    steps = phase_steps(limits(speed, acceleration, braking, jerk))
    law = TimeLaw(tuple(int(k) for k in steps[0]))
    s, sd, sdd = law.at(np.arange(law.total + 1))
    assert (s[0], sd[0], sdd[0]) == (0.0, 0.0, 0.0)
    assert (s[-1], sd[-1], sdd[-1]) == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)
    assert (np.diff(s) >= -1e-15).all()
    states = law_states(steps)
    assert sd.max() <= speed * (1 + 1e-9)
    assert sdd.max() <= acceleration * (1 + 1e-9)
    assert -sdd.min() <= braking * (1 + 1e-9)
    assert np.abs(states.jerk).max() <= jerk * (1 + 1e-9)


@given(positive, positive, st.floats(1.0, 500.0))
@settings(max_examples=100, deadline=None)
def test_the_reached_speed_fills_the_distance(
    speed: float, acceleration: float, jerk: float
) -> None:
    bounds = limits(speed, acceleration, acceleration, jerk)
    reached = float(reached_speed(bounds)[0])

    def ramp(v: float) -> float:
        return (
            v / acceleration + acceleration / jerk
            if v * jerk >= acceleration**2
            else 2 * np.sqrt(v / jerk)
        )

    assert reached <= speed
    covered = reached * ramp(reached)
    assert covered <= 1.0 + 1e-9
    if reached < speed * (1 - 1e-9):
        assert covered == pytest.approx(1.0, rel=1e-9)


def test_acceleration_and_speed_are_the_integrals_of_the_jerk() -> None:
    law = TimeLaw((20, 100, 20, 55, 30, 40, 30))
    t = np.arange(law.total + 1)
    s, sd, sdd = law.at(t)
    assert np.diff(sd) / GRID_S == pytest.approx(0.5 * (sdd[:-1] + sdd[1:]), abs=1e-9)
    simpson = (sd[:-2:2] + 4 * sd[1:-1:2] + sd[2::2]) * GRID_S / 3
    assert s[2::2] - s[:-2:2] == pytest.approx(simpson, abs=1e-12)


def test_switches_have_no_doubles_where_a_phase_is_empty() -> None:
    assert TimeLaw((5, 0, 5, 0, 5, 0, 5)).switches().tolist() == [0, 5, 10, 15, 20]
