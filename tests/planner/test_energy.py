"""Joules at the mains: the balance closes for every movement, and standing still costs what Table
II says.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ir_kernels.power import REGENERATIONS
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.energy import holding_watts, movement_energy
from ir_planner.request.context import Context, Work
from ir_planner.scene import Drives
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.timing.blended_steps import standing, stretched
from ir_planner.timing.objective import best_stretch, stretched_costs
from ir_planner.timing.straight_steps import straight_steps

Degrees = Callable[..., Any]


@pytest.fixture
def fast(demo_scene: PlanningScene, degrees: Degrees, budget: Work) -> JointTrajectory:
    path = np.stack([degrees(0, -50, 60, 0, 0, 0), degrees(80, -110, 120, 0, 30, 0)])
    return straight_steps(
        path, Context.of(demo_scene, PlanOptions(objective="time"), budget)
    ).trajectory


@pytest.mark.parametrize("regeneration", REGENERATIONS)
def test_base_axes_brake_resistor_and_capacitor_sum_up(
    fast: JointTrajectory, demo_scene: PlanningScene, regeneration: Any
) -> None:
    energy = movement_energy(fast, replace(demo_scene, drives=Drives(regeneration)))
    parts = energy.base + energy.joints.sum() + energy.dissipated + energy.capacitor
    assert energy.total == pytest.approx(parts, rel=1e-9)
    assert energy.total == pytest.approx(float(np.mean(energy.watts)) * fast.duration, rel=1e-9)
    assert energy.dissipated >= 0.0


def test_sharing_the_bus_costs_no_more_than_burning_and_no_less_than_feeding_back(
    fast: JointTrajectory, demo_scene: PlanningScene
) -> None:
    total = {
        kind: movement_energy(fast, replace(demo_scene, drives=Drives(kind))).total
        for kind in REGENERATIONS
    }
    assert total["fed_back"] < total["shared"] < total["none"]


def test_the_steps_are_fine_enough(fast: JointTrajectory, demo_scene: PlanningScene) -> None:
    coarse, fine = (movement_energy(fast, demo_scene, step).total for step in (1e-3, 1e-4))
    assert coarse == pytest.approx(fine, rel=2e-4)


def test_holding_at_machine_home_is_table_2(demo_scene: PlanningScene) -> None:
    home = np.array(demo_scene.cell.machine_home)
    assert holding_watts(home, demo_scene) == pytest.approx(735.0, rel=0.01)
    assert holding_watts(home, replace(demo_scene, loads=())) == pytest.approx(420.0, rel=0.01)
    second = stretched(standing(home, demo_scene.cell.robot.joint_names), 1000.0)
    assert movement_energy(second, demo_scene).total == pytest.approx(735.0, rel=0.01)


def test_lowering_a_load_gives_energy_back_on_the_bus(
    demo_scene: PlanningScene, degrees: Degrees, budget: Work
) -> None:
    path = np.stack([degrees(0, -90, 60, 0, 0, 0), degrees(0, -40, 60, 0, 0, 0)])
    slow = straight_steps(
        path, Context.of(demo_scene, PlanOptions(duration=4.0, safety_distance=0.0), budget)
    ).trajectory
    down = movement_energy(slow, demo_scene)
    back = movement_energy(
        straight_steps(
            path[::-1],
            Context.of(demo_scene, PlanOptions(duration=4.0, safety_distance=0.0), budget),
        ).trajectory,
        demo_scene,
    )
    assert down.joints.sum() < back.joints.sum()
    assert down.total >= down.base - 1e-9


@pytest.mark.parametrize("regeneration", REGENERATIONS)
def test_many_durations_at_once_cost_what_each_costs_alone(
    fast: JointTrajectory, demo_scene: PlanningScene, budget: Work, regeneration: Any
) -> None:
    scene = replace(demo_scene, drives=Drives(regeneration))
    factors = np.array([1.0, 1.3, 2.2])
    together = stretched_costs(
        fast, factors, Context.of(scene, PlanOptions(objective="energy"), budget)
    )
    for factor, joules in zip(factors, together, strict=True):
        alone = movement_energy(stretched(fast, factor), scene)
        assert joules == pytest.approx(alone.total - alone.base, rel=2e-3)


def test_the_objective_trades_time_for_joules(
    fast: JointTrajectory, demo_scene: PlanningScene, budget: Work
) -> None:
    def factor(objective: str, time_value: float = 500.0) -> float:
        options = PlanOptions(objective=objective, time_value=time_value)
        return best_stretch(fast, Context.of(demo_scene, options, budget))

    assert factor("time") == 1.0
    assert factor("movement_cost") == 1.0
    both = factor("time_and_energy")
    frugal = factor("energy")
    assert 1.0 <= both <= frugal
    slow = movement_energy(stretched(fast, frugal), demo_scene)
    assert slow.total < movement_energy(fast, demo_scene).total
    assert factor("time_and_energy", 1e6) == 1.0
