"""The analysis' own torques, bus and derivatives, held against the kernels that they share nothing
with.
"""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import ir_recorder
from ir_description import load_cell, load_power_data
from ir_kernels import DynamicsModel, dc_bus
from ir_kernels.power import DcBusParameters
from ir_recorder.measure.arm import arm_torques
from ir_recorder.measure.power_model import BusFlow, bus_flow
from ir_recorder.measure.samples import BANDWIDTH, differentiated, half_width, samples_of
from ir_recorder.traces import Trace

RECORDER = Path(ir_recorder.__file__).parent


def test_the_measurement_shares_no_formula_with_planner_or_driver() -> None:
    files = [*(RECORDER / "measure").glob("*.py"), RECORDER / "analysis" / "indirect.py"]
    assert len(files) > 4
    for file in files:
        named = {
            name.split(".")[0]
            for node in ast.walk(ast.parse(file.read_text()))
            for name in (
                [alias.name for alias in node.names] if isinstance(node, ast.Import)
                else [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            )
        }  # fmt: skip
        assert not named & {"ir_kernels", "ir_planner", "ir_sim_driver"}, file.name


@given(seed=st.integers(0, 2**32 - 1), turned=st.booleans())
def test_torques_are_those_of_the_kernels(seed: int, turned: bool) -> None:
    cell = load_cell("demo")
    rng = np.random.default_rng(seed)
    q, qd, qdd = rng.uniform(-2.0, 2.0, (3, 5, 6))
    q[:, 1] = rng.uniform(-2.4, -0.1, 5)  # where the gas spring is
    pose = np.eye(4)
    if turned:
        pose[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        pose[:3, 0] *= np.linalg.det(pose[:3, :3])
    loads = cell.loads(cell.parts[0].name)
    own = arm_torques(cell.robot, loads, pose, np.stack([q, qd, qdd]))
    model = DynamicsModel(cell.robot, loads, pose)
    total = own.links + own.loads + own.rotors - own.counterbalance
    robot = cell.robot
    friction = robot.friction_viscous * qd + robot.friction_coulomb * np.sign(qd)
    theirs = model.inverse_dynamics(q, qd, qdd)
    np.testing.assert_allclose(total + friction, theirs, rtol=0.0, atol=1e-9 * np.abs(theirs).max())


@given(st.lists(st.floats(-5e4, 5e4), min_size=1, max_size=60))
def test_the_bus_balances_and_differs_from_the_kernels_by_the_hysteresis_alone(
    watts: list[float],
) -> None:
    link = load_power_data().dc_link
    wanted = np.array(watts)
    step = 1e-3
    own = bus_flow(link, wanted, step)
    theirs = dc_bus(wanted[:, None], step, DcBusParameters(link.capacity_energy))
    assert (own.watts >= 0.0).all()
    assert (own.charge >= 0.0).all()
    assert (own.charge <= link.capacity_energy).all()
    assert own.watts.sum() >= theirs.mains.sum() - 1e-6  # the middle of two voltages keeps less
    flat = replace(link, chopper_off=link.chopper_on)  # without hysteresis both are one
    np.testing.assert_allclose(bus_flow(flat, wanted, step).watts, theirs.mains, atol=1e-6)


@pytest.mark.parametrize("softness", [0.0, 0.3, 10.0])
def test_derivatives_go_through_the_bus(softness: float) -> None:
    link = load_power_data().dc_link
    rng = np.random.default_rng(4)
    wanted = rng.normal(0.0, 4e3, 300)
    slopes = rng.normal(0.0, 1.0, (300, 3))
    flow = bus_flow(link, wanted, 0.01, slopes, softness=softness)
    for p in range(3):
        more = bus_flow(link, wanted + 1e-4 * slopes[:, p], 0.01, softness=softness).watts
        less = bus_flow(link, wanted - 1e-4 * slopes[:, p], 0.01, softness=softness).watts
        np.testing.assert_allclose(flow.slopes[:, p], (more - less) / 2e-4, atol=1e-4)


@pytest.mark.parametrize("softness", [0.0, 0.3, 10.0])
@pytest.mark.parametrize("size", [0.2, 1.0, 4.0])
def test_the_size_of_the_link_has_its_derivative(size: float, softness: float) -> None:
    link = load_power_data().dc_link
    wanted = np.random.default_rng(5).normal(0.0, 4e3, 300)

    def flow(factor: float) -> BusFlow:
        none = np.zeros((300, 1))
        return bus_flow(
            link, wanted, 0.01, none, softness=softness, size=factor, by_size=np.ones(1)
        )

    more, less = (flow(size + shift).watts for shift in (1e-6, -1e-6))
    np.testing.assert_allclose(flow(size).slopes[:, 0], (more - less) / 2e-6, atol=0.1)
    assert flow(1.5 * size).watts.sum() <= flow(size).watts.sum() + 1e-6


@given(st.lists(st.floats(-5e4, 5e4), min_size=1, max_size=60))
def test_a_hard_switch_is_the_limit_of_soft_ones(watts: list[float]) -> None:
    """Each switch is off by S ln 2 at most, and what was given differs by what is held."""
    link = load_power_data().dc_link
    wanted = np.array(watts)
    step = 1e-3
    softness = 1e-3
    hard, soft = (bus_flow(link, wanted, step, softness=s) for s in (0.0, softness))
    apart = 2.0 * np.log(2.0) * softness * np.arange(1, len(watts) + 1)
    assert (np.abs(hard.charge - soft.charge) <= apart).all()
    assert (np.abs(hard.watts - soft.watts) * step <= 2.0 * apart).all()


def test_polynomials_are_differentiated_exactly_and_the_bandwidth_is_as_stated() -> None:
    time = np.arange(0.0, 2.0, 0.002)
    value, speed, acceleration = differentiated((time**3)[:, None], 0.002)
    inner = slice(50, -50)
    np.testing.assert_allclose(value[inner, 0], time[inner] ** 3, atol=1e-9)
    np.testing.assert_allclose(speed[inner, 0], 3.0 * time[inner] ** 2, atol=1e-7)
    np.testing.assert_allclose(acceleration[inner, 0], 6.0 * time[inner], atol=1e-5)
    wave = np.sin(2.0 * np.pi * BANDWIDTH * time)[:, None]
    passed = differentiated(wave, 0.002)[0][inner]
    assert np.std(passed) / np.std(wave) == pytest.approx(np.sqrt(0.5), abs=0.05)  # 3 dB
    assert half_width(100.0) >= 3


MODES = ("STAND_ON_MOTORS", "HIBERNATION")


@pytest.mark.parametrize(("mode", "known"), [("STAND_ON_MOTORS", False), ("HIBERNATION", True)])
def test_a_gap_is_a_rest_only_where_the_drives_are_off(mode: str, known: bool) -> None:
    """With drives on the robot may have moved out and back in it."""
    time = np.concatenate([0.01 * np.arange(100), 3.0 + 0.01 * np.arange(100)])
    inside = (time > 0.5) & (time < 3.5)
    words = tuple(mode if each else MODES[0] for each in inside)
    joints = Trace("log", time, {"a": np.full(200, 0.3)}, {"mode": words})
    samples = samples_of(joints, None, ("a",), MODES, [(-np.inf, np.inf, ())])
    middle = (samples.time > 1.1) & (samples.time < 2.9)
    assert (samples.known[middle] == known).all()


@pytest.mark.parametrize("count", range(4, 14))
def test_a_log_shorter_than_the_filter_is_sampled(count: int) -> None:
    time = 0.008 * np.arange(count)
    joints = Trace("log", time, {"a": 0.1 * time})
    samples = samples_of(joints, None, ("a",), MODES, [(-np.inf, np.inf, ())])
    assert samples.q[:, 0] == pytest.approx(0.1 * samples.time, abs=1e-3)
