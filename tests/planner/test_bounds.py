"""Lower bounds of movements: below what the planner finds, and below the simplest movement there
is.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import load_cell, load_power_data
from ir_msgs_py.options import PlanOptions
from ir_planner.checks.evaluation import evaluate_trajectory
from ir_planner.program.cost_bounds import (
    COST_MARGIN,
    CoarseCost,
    Rates,
    least_cost,
    least_seconds,
    potential_energy,
)
from ir_planner.regional.regional import plan_to_configurations
from ir_planner.request.context import Context, Journal, Work
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_planner.search.registry import registered

CELL = load_cell("open")
SCENE = scene_with(CELL, load_text(CELL), load_power_data())
ROBOT = CELL.robot


def unhurried() -> Work:
    return Work(10**7, np.inf, lambda: 0.0)


def asked(scene: PlanningScene, options: PlanOptions) -> Context:
    return Context(scene, options, Journal(unhurried(), options.seed))


def configurations(rng: np.random.Generator, count: int) -> np.ndarray:
    """Free ones, with the arm raised."""
    low = ROBOT.position_min
    high = ROBOT.position_max
    drawn = rng.uniform(low, high, (4000, ROBOT.n))
    free = drawn[SCENE.collision.is_free(drawn, SCENE.thresholds(0.02))]
    return np.ascontiguousarray(free[:count])


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "rates", [Rates(1.0, 500.0), Rates(1.0, 5000.0), Rates(0.0, 1.0), Rates(1.0, 0.0)]
)
def test_no_movement_of_the_planner_costs_less(seed: int, rates: Rates) -> None:
    a, b = configurations(np.random.default_rng(seed), 2)
    options = PlanOptions(safety_distance=0.0, time_value=rates.second if rates.joule else 500.0)
    plan = plan_to_configurations(a, b[None], asked(SCENE, options), registered())
    assert plan.trajectory is not None
    report = evaluate_trajectory(plan.trajectory, SCENE, 0.0).report
    cost = rates.joule * (report.energy - report.base_energy) + rates.second * report.duration
    bound = least_cost(a[None], b[None], SCENE, SCENE.limits, rates)[0, 0]
    assert 0.0 <= bound <= cost


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None, max_examples=20)
def test_potential_energy_is_the_work_against_the_static_torque_on_any_path(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b, via = (rng.uniform(ROBOT.position_min, ROBOT.position_max) for _ in range(3))

    def work(p: np.ndarray, q: np.ndarray) -> float:
        share = (np.arange(400) + 0.5)[:, None] / 400
        places = p + share * (q - p)
        still = np.zeros_like(places)
        return float((SCENE.dynamics.inverse_dynamics(places, still, still) @ (q - p)).mean())

    energy = potential_energy(np.stack([a, b]), SCENE)
    assert work(a, via) + work(via, b) == pytest.approx(energy[1] - energy[0], abs=0.5)


def test_least_seconds_are_those_of_a_bang_bang_law() -> None:
    limits = SCENE.limits
    speed = limits.velocity[0]
    acceleration = limits.acceleration[0]
    ramp = speed**2 / acceleration  # rad, up and down
    distance = np.zeros((3, ROBOT.n))
    distance[:, 0] = 0.25 * ramp, ramp, 3.0 * ramp
    expected = np.array([1.0, 2.0, 4.0]) * speed / acceleration
    assert least_seconds(distance, limits) == pytest.approx(expected)


@pytest.mark.parametrize("cell", ["demo", "open"])
def test_a_coarse_solution_less_its_margin_is_below_the_planner_s_movement(
    cell: str, scene_of: Callable[[str], PlanningScene]
) -> None:
    scene = scene_of(cell)
    options = PlanOptions(time_value=500.0)
    coarse = CoarseCost(asked(scene, options), Rates(1.0, options.time_value))
    postures = np.array([scene.cell.park, scene.cell.machine_home])
    turned = postures + np.radians([60.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    for a, b in zip(postures, turned, strict=True):
        plan = plan_to_configurations(a, b[None], asked(scene, options), registered())
        if plan.trajectory is None:
            continue
        report = plan.report
        cost = report.energy - report.base_energy + options.time_value * report.duration
        assert (1.0 - COST_MARGIN) * coarse.between(a, b) <= cost


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_coarse_movement_whose_ends_are_turned_alike_costs_the_same(seed: int) -> None:
    rng = np.random.default_rng(seed)
    whole = 2.0 * np.pi * np.array([0, 0, 0, 1, 0, 1])  # the axes that turn twice
    low, high = (0.8 * bound for bound in (ROBOT.position_min, ROBOT.position_max))
    first, second = rng.uniform(low, high - whole, (2, ROBOT.n))
    coarse = CoarseCost(asked(SCENE, PlanOptions()), Rates(1.0, 500.0))
    turned = coarse.between(first + whole, second + whole)
    assert turned == pytest.approx(coarse.between(first, second), rel=0.1 * COST_MARGIN)
