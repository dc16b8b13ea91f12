"""A stated gap is true: the best program there is lies above the bound."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import cast

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_planner.program.choice import Choice
from ir_planner.program.cycle_time import cycle_bound, cycle_gap

BASE = 600.0  # W, while a program moves
CAPACITY = 100.0  # J


def choice_with(waiting: float) -> Choice:
    """A choice of nothing, whose wait at the end costs so many watts."""
    bus = SimpleNamespace(capacity_energy=CAPACITY, regeneration="shared")
    scene = SimpleNamespace(base_watts=BASE, dc_bus=bus)
    movements = SimpleNamespace(context=SimpleNamespace(scene=scene))
    return cast(
        Choice, SimpleNamespace(movements=movements, waiting=lambda seconds: waiting * seconds)
    )


@given(st.integers(0, 2**32), st.floats(100.0, 900.0), st.floats(50.0, 5000.0), st.floats(0.0, 3.0))
@settings(deadline=None)
def test_no_program_within_a_cycle_costs_less_than_its_bound(
    seed: int, waiting: float, value: float, more: float
) -> None:
    """Three chains of three movements, each at four speeds: all of them, one by one."""
    rng = np.random.default_rng(seed)
    chains = [
        [
            list(zip(rng.uniform(0.8, 3.0, 4), rng.uniform(300.0, 4000.0, 4), strict=True))
            for _ in range(3)
        ]
        for _ in range(3)
    ]
    programs = [
        (sum(t for t, _ in chosen), sum(e for _, e in chosen))
        for chain in chains
        for chosen in itertools.product(*chain)
    ]
    seconds = min(t for t, _ in programs) + more
    best = min(e + BASE * t + waiting * (seconds - t) for t, e in programs if t <= seconds)
    at_value = min(e + value * t for t, e in programs)
    choice = choice_with(waiting)
    bound = cycle_bound(choice, at_value, value, seconds)
    assert bound <= best + 1e-6
    carried = 2 * CAPACITY  # what charge could save over three movements
    gap = cycle_gap(choice, 3, best, bound)
    assert (1.0 - gap / 100.0) * best <= best - carried + 1e-6 or gap == 0.0
