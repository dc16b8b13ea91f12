"""The best chain of a small program is that of an enumeration, and lower bounds are never
undercut.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from _program_chains import Chains, least_cost, least_times, least_travel, potential_gain

from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, Planner
from ir_planner.timing.jerk_limited_laws import GRID_S
from ir_planner.timing.ptp import free_law, path_limits

OBJECTIVES = ("time_and_energy", pytest.param("movement_cost", marks=pytest.mark.long))


@pytest.fixture(scope="module")
def planner() -> Planner:
    return Planner("open", clock=lambda: 0.0)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_the_cheapest_chain_is_that_of_an_enumeration(planner: Planner, objective: str) -> None:
    options = PlanOptions(objective=objective, planning_time=60.0, max_iterations=200)
    start = np.array(planner.cell.machine_home)
    chains = Chains.of(planner, ("p1", "conv"), start, options, {})
    _, best, proved = chains.cheapest()
    assert proved
    every = itertools.product(*(range(len(layer)) for layer in chains.layers))
    costs = {chain: chains.cost_along(list(chain)) for chain in every}
    assert len(costs) == chains.count
    assert best == pytest.approx(min(costs.values()), rel=1e-12)


def test_no_movement_undercuts_its_lower_bounds(planner: Planner) -> None:
    scene = planner.scene()
    for task in planner.cell.tasks:
        start = np.array(task.start)
        goal = np.array(task.goal)
        options = PlanOptions(planning_time=60.0, max_iterations=2000)
        report = planner.plan_regional(
            start=start, goal=Goal(configuration=goal), options=options
        ).report
        J = report.energy - report.base_energy + 500.0 * report.duration
        assert least_cost(scene, start, goal[None], 500.0)[0] <= J
        assert report.movement_cost >= least_travel(scene, start, goal[None])[0] - 1e-9


def test_least_times_are_those_of_the_phase_law(planner: Planner) -> None:
    """One joint alone: the closed form against the planner's law, whose phases are rounded up to
    its grid.
    """
    limits = planner.scene().limits
    rng = np.random.default_rng(0)
    for size in 10.0 ** rng.uniform(-3.0, 0.5, 50):
        for joint in range(6):
            delta = np.zeros(6)
            delta[joint] = size
            law = GRID_S * free_law(path_limits(delta, limits)).total
            bounds = [
                np.array([x[joint]]) for x in (limits.velocity, limits.acceleration, limits.jerk)
            ]
            least = float(least_times(np.array([size]), *bounds)[0])
            assert least <= law * (1.0 + 1e-9)
            assert law <= 1.02 * least + 0.02


def test_potential_does_not_depend_on_the_path(planner: Planner) -> None:
    scene = planner.scene()
    rng = np.random.default_rng(1)
    a, b, c = rng.uniform(-1.0, 1.0, (3, 6)) + np.array(planner.cell.machine_home)
    direct = potential_gain(scene, a, c[None])[0]
    around = potential_gain(scene, a, b[None])[0] + potential_gain(scene, b, c[None])[0]
    assert around == pytest.approx(direct, abs=0.01)
