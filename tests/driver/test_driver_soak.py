"""An hour of simulated shift: energy is the integral of the published power, and nothing grows."""

from __future__ import annotations

import resource

import numpy as np
import pytest

from ir_msgs_py.modes import Mode
from ir_sim_driver.controller.driver import Driver

HOUR = 360_000  # ticks of 10 ms
SETTLED = 60_000
GROWTH = 20_000  # kB of the largest resident size
MINUTE = 6_000
BLOCK = 5 * MINUTE


@pytest.mark.long
def test_an_hour_of_shift(make, plan, start, cell):
    simulation = make("pybullet")
    driver = Driver(simulation, steps=10)
    home = np.array(cell.machine_home)
    work = home + np.array([1.0, 0.3, -0.3, 0.5, -0.4, 0.6])
    total = 0.0
    last = 0.0
    at_work = False
    levels = set()
    settled = 0
    for k in range(1, HOUR):
        within = k % BLOCK
        if within % (MINUTE // 2) == 100 and within < 4 * MINUTE:
            at_work = not at_work
            start(simulation, plan([2.5], work if at_work else home))
        if within == 4 * MINUTE:
            simulation.plc.set_bit("ab", True)
        if within == 4 * MINUTE + 2_500:
            simulation.plc.set_bit("ab", False)
        frame = driver.tick(k * 10_000_000)
        assert frame.power is not None
        total += frame.power.power * 0.01
        last = frame.power.energy
        levels.add(frame.power.mode)
        if k == SETTLED:
            settled = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - settled < GROWTH
    assert total == pytest.approx(last, rel=1e-6)
    assert {Mode.MOVING, Mode.STAND_ON_BRAKES, Mode.BUS_POWER_OFF} <= levels
    driver.close()
