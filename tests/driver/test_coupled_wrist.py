"""A wrist whose motors turn with other joints: the plant against the kernels, and a movement
driven.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ir_sim_driver.controller.simulation import make_simulation

TURNS = np.eye(6)
TURNS[5, 4] = 1.0
TURNS[4, 3] = -0.4
TURNS[5, 3] = 0.2


@pytest.fixture(scope="module")
def coupled(cell):
    return replace(cell, robot=replace(cell.robot, motor_turns=TURNS))


def test_torques_are_those_of_the_motors(coupled):
    simulation = make_simulation(coupled, backend="pybullet")
    backend = simulation.backend
    dynamics = simulation.dynamics
    generator = np.random.default_rng(1)
    robot = coupled.robot
    for _ in range(20):
        q = generator.uniform(robot.position_min, robot.position_max)
        qd = generator.uniform(0.1, 1.0, 6)
        qdd = generator.normal(0.0, 2.0, 6)
        backend.reset(q)
        expected = dynamics.inverse_dynamics(q[None], qd[None], qdd[None])[0]
        assert np.abs(backend.required_torque(q, qd, qdd) - expected).max() < 1e-6


def test_a_movement_is_tracked_and_costs_what_the_model_says(coupled, plan, start, run_out, cell):
    q0 = np.array(cell.machine_home)
    there = plan(1.5, q0, q0 + np.array([0.4, 0.2, -0.2, 0.6, -0.5, 0.9]))
    energies = {}
    for name, where in (("pybullet", coupled), ("ideal", coupled), ("without", cell)):
        simulation = make_simulation(where, backend="pybullet" if name == "pybullet" else "ideal")
        start(simulation, there)
        outcome = run_out(simulation)
        assert outcome.code == 0
        assert outcome.max_tool_deviation < 0.001
        energies[name] = outcome.energy
    assert energies["pybullet"] == pytest.approx(energies["ideal"], rel=0.002)
    assert energies["without"] != pytest.approx(energies["ideal"], rel=0.002)


@pytest.mark.parametrize("stop", ["brake", "halt", "coast"])
def test_it_stops_and_stays_whole(coupled, stop):
    simulation = make_simulation(coupled, backend="pybullet")
    backend = simulation.backend
    q = np.array(coupled.machine_home)
    for k in range(60):
        backend.track(q + 0.5e-6 * k**2)
    for _ in range(200):
        getattr(backend, stop)()
    assert np.isfinite(backend.q).all()
    assert backend.standing or stop == "coast"
