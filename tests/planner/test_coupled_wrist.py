"""A wrist whose motors turn with other joints: plans against the measurement's own arithmetic, and
the laws of plans.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from ir_description import load_cell
from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, MovementPlan, Planner
from ir_planner.checks import movement_energy
from ir_planner.checks.intervals import Sampled, energy_and_slope
from ir_planner.program.cost_bounds import Rates, least_cost
from ir_planner.request import Context, Work
from ir_planner.scene import Drives
from ir_planner.timing import baseline
from ir_recorder.measure import PowerModel, planned_samples

CELLS = ("kr6_bench", "open")


@cache
def planner(name: str) -> Planner:
    cell = load_cell(name)
    turns = np.eye(6)
    turns[4, 3] = -0.3
    turns[5, 3] = 0.2
    turns[5, 4] = 1.0
    robot = replace(cell.robot, motor_turns=turns)
    return Planner(replace(cell, robot=robot), clock=itertools.repeat(0.0).__next__)


@cache
def plan(name: str) -> MovementPlan:
    start, goal = ends(name)
    options = PlanOptions(load="none")
    found = planner(name).plan_regional(start=start, goal=Goal(configuration=goal), options=options)
    assert found.status.ok, found.status.message
    return found


def ends(name: str) -> tuple[np.ndarray, np.ndarray]:
    home = np.array(planner(name).cell.park)
    return home, home + np.array([0.2, 0.05, -0.05, 0.4, -0.3, 0.5])


@pytest.mark.parametrize("name", CELLS)
def test_planned_joules_are_those_of_the_measurement(name: str) -> None:
    """Which knows nothing of the kernels."""
    scene = planner(name).scene("none")
    trajectory = plan(name).trajectory
    assert trajectory is not None
    robot = scene.cell.robot
    model = PowerModel(robot, robot.controller.dc_link, scene.cell.base_pose, scene.parameters)
    samples = planned_samples(trajectory, (), scene.parameters.modes)
    watts = model.watts(scene.parameters.mean, model.prepare(samples))
    measured = float(watts.sum()) * samples.step
    planned = movement_energy(trajectory, scene).total
    assert planned == pytest.approx(measured, rel=0.01)
    uncoupled = replace(scene.cell, robot=replace(robot, motor_turns=np.eye(6)))
    other = movement_energy(trajectory, Planner(uncoupled).scene("none")).total
    assert abs(other / measured - 1.0) > 5.0 * abs(planned / measured - 1.0)


@pytest.mark.parametrize("name", CELLS)
def test_limits_hold_for_the_motors_and_the_plan_is_no_dearer_than_ptp(name: str) -> None:
    found = plan(name)
    assert found.report.certified
    scene = planner(name).scene("none")
    trajectory = found.trajectory
    assert trajectory is not None
    at = trajectory.sample(np.linspace(0.0, trajectory.duration, 500))
    motion = (np.ascontiguousarray(each) for each in (at.q, at.qd, at.qdd))
    used = np.abs(scene.dynamics.inverse_dynamics(*motion))
    used /= scene.dynamics.torque_limit(np.ascontiguousarray(at.qd))
    assert used.max() <= 1.0
    start, goal = ends(name)
    timed = PlanOptions(load="none", duration=found.report.duration)
    context = Context.of(scene, timed, Work(100_000, 1.0, lambda: 0.0))
    ptp = baseline(start, goal, context)
    assert ptp is None or found.report.energy <= ptp.report.energy * (1.0 + 1e-3)
    price = scene.cell.robot.time_value
    base = scene.base_watts * found.report.duration
    cost = found.report.energy - base + price * found.report.duration
    least = least_cost(start[None], goal[None], scene, context.limits, Rates(1.0, price))
    assert float(least[0, 0]) <= cost * (1.0 + 1e-6)


@pytest.mark.parametrize("name", CELLS)
def test_the_slopes_of_intervals_are_those_of_differences(name: str) -> None:
    scene = planner(name).scene("none")
    trajectory = plan(name).trajectory
    assert trajectory is not None
    at = Sampled.of(trajectory)
    _, slope = energy_and_slope(at, scene)
    parameters = scene.parameters
    for term in ("viscous.joint_a6", "coulomb.joint_a6", "rotor_inertia", "link_mass"):
        k = parameters.index(term)
        energies = []
        h = 1e-4 * parameters.mean[k]
        for sign in (1.0, -1.0):
            mean = parameters.mean.copy()
            mean[k] += sign * h
            there = replace(scene, drives=Drives(parameters=replace(parameters, mean=mean)))
            energies.append(energy_and_slope(at, there)[0])
        difference = (energies[0] - energies[1]) / (2.0 * h)
        assert slope[k] == pytest.approx(difference, rel=0.02, abs=1e-8 * abs(energies[0]) / h)
