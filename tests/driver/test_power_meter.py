"""The mains meter: energy is the integral of the power, and adds up from its parts."""

from __future__ import annotations

import numpy as np
import pytest

from ir_description import load_power_data
from ir_kernels.power import DcBusParameters, dc_bus
from ir_msgs_py.modes import Mode
from ir_sim_driver.plant import BasePower, PowerMeter, nominal_plant
from ir_sim_driver.plant.backend import MotorWork

DT = 0.001
HOME = np.zeros(6)


@pytest.fixture
def meter(cell):
    return PowerMeter(nominal_plant(cell.robot, load_power_data()), DT)


def test_the_parts_add_up_to_the_mains(make, plan, start, run_out, cell):
    simulation = make("pybullet")
    home = np.array(cell.machine_home)
    for target in (home + np.array([1.0, 0.4, -0.4, 0.5, 0.3, 0.2]), home):
        start(simulation, plan(2.5, simulation.executor.command, target))
        run_out(simulation)
    simulation.mains.settle()
    r = simulation.mains.meter.reading()
    total = r.base_energy + r.axis_energy.sum() + r.burnt_energy + r.capacitor_energy
    assert r.energy == pytest.approx(total, rel=1e-12)
    assert r.time == pytest.approx(simulation.time)
    assert r.burnt_energy >= 0.0


def test_batches_of_any_length_read_the_same(meter, cell):
    generator = np.random.default_rng(1)
    speed = generator.normal(0.0, 1.0, (200, 6))
    torque = generator.normal(0.0, 500.0, (200, 6))
    other = PowerMeter(nominal_plant(cell.robot, load_power_data()), DT)
    for k in range(200):
        meter.add(300.0)
        meter.settle(MotorWork(speed[k : k + 1], torque[k : k + 1]))
        other.add(300.0)
    other.settle(MotorWork(speed, torque))
    assert meter.reading().energy == pytest.approx(other.reading().energy, rel=1e-12)
    power = torque * speed + cell.robot.copper_loss * (torque / cell.robot.gear_ratio) ** 2
    bus = dc_bus(power, DT, DcBusParameters(load_power_data().dc_link_capacity_energy))
    assert other.reading().energy == pytest.approx(DT * (300.0 * 200 + bus.mains.sum()), rel=1e-12)


def test_braking_lifts_the_bus_voltage_up_to_the_chopper(meter):
    data = load_power_data()
    speed = np.full((500, 6), 1.0)
    torque = np.full((500, 6), -500.0)
    assert meter.reading().bus_voltage == pytest.approx(data.dc_link.voltage)
    for _ in range(500):
        meter.add(0.0)
    meter.settle(MotorWork(speed, torque))
    reading = meter.reading()
    assert reading.bus_voltage == pytest.approx(data.dc_link.chopper_on, rel=1e-6)
    assert reading.energy == 0.0
    assert reading.burnt_energy > 100.0


def test_watts_of_the_tool_don_t_grow_with_a_part(make):
    simulation = make()
    assert simulation.mains.base.of(Mode.HIBERNATION) == pytest.approx(105.0)
    assert simulation.mains.base.of(Mode.STAND_ON_BRAKES) == pytest.approx(325.0)


def test_base_power_follows_the_level(cell):
    base = BasePower(nominal_plant(cell.robot, load_power_data()).watts)
    base.set_load(90.0, 100.0, 155.0)
    watts = [
        base.of(Mode[mode])
        for mode in ("HIBERNATION", "BUS_POWER_OFF", "STAND_ON_BRAKES", "STAND_ON_MOTORS")
    ]
    assert watts == pytest.approx([105.0, 205.0, 325.0, 602.16])


def test_entering_costs_the_mode_that_is_left_and_leaving_stands_on_motors(make):
    simulation = make(load="none")
    simulation.run(0.01)

    def mean_power(seconds):
        simulation.mains.settle()
        before = simulation.mains.meter.reading()
        simulation.run(seconds)
        simulation.mains.settle()
        after = simulation.mains.meter.reading()
        return (after.energy - before.energy) / (after.time - before.time)

    simulation.plc.set_bit("ab", True)
    simulation.run(0.1)
    assert simulation.modes.mode is Mode.TO_BUS_POWER_OFF
    assert mean_power(2.0) == pytest.approx(420.0, rel=1e-3)
    simulation.run(3.0)
    assert mean_power(1.0) == pytest.approx(115.0, rel=1e-3)
    simulation.plc.set_bit("ab", False)
    simulation.run(1.0)
    assert simulation.modes.mode is Mode.FROM_BUS_POWER_OFF
    assert mean_power(2.0) == pytest.approx(420.0, rel=1e-3)
