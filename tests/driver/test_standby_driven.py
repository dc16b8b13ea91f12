"""What standby advice predicts is what the simulated controller measures, stepped without real
time.

Modes, postures, loads, lengths and times of the controller are drawn by seed. The prediction is the
planner's, the measurement the plant's meter: two codes that share the data files alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ir_description import load_cell, load_power_data
from ir_msgs_py.modes import Mode, TransitionTimes
from ir_msgs_py.names import NO_LOAD
from ir_planner.program.pause_lengths import lengths_of
from ir_planner.program.rests import RestStep, rests_at
from ir_planner.program.standby import plan_standby
from ir_planner.scene import scene_with
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.controller.simulation import Simulation, make_simulation
from ir_sim_driver.power import IdleTimes
from ir_values.arrays import FloatArray

CELL = load_cell("demo")
POWER = load_power_data()
LOADS = (NO_LOAD, CELL.tool.name, f"{CELL.tool.name}+{CELL.parts[0].name}")
# whichever is larger
SHARE = 0.03
JOULES = 20.0
DT = 0.01  # s: nothing moves, and no time of the controller is shorter
DEBOUNCE = 0.02  # s: how long a level has to stay
BITS = {"STAND_ON_BRAKES": "drives_off", "BUS_POWER_OFF": "ab", "HIBERNATION": "hib"}


def posture(rng: np.random.Generator) -> FloatArray:
    """Joint values (n,) [rad], not near a limit."""
    robot = CELL.robot
    share = rng.uniform(0.2, 0.8, robot.n)
    return robot.position_min + share * (robot.position_max - robot.position_min)


class Case:
    """A controller that stands at a posture with a load, and the planner's scene of it."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        load = LOADS[seed % len(LOADS)]
        free = scene_with(CELL, load, POWER).collision
        self.q = posture(rng)
        while free.distances(self.q[None]).min() <= 0.0:
            self.q = posture(rng)
        self.times = TransitionTimes()
        self.timer = 20.0
        if seed % 2:
            drawn = {name: float(round(rng.uniform(0.05, 40.0), 2)) for name in vars(self.times)}
            self.times = TransitionTimes(**drawn)
            self.timer = float(round(rng.uniform(1.0, 40.0), 2))
        power = replace(POWER, motors_to_brakes_in_program=self.timer)
        self.scene = scene_with(CELL, load, power)
        idle = IdleTimes(motors_to_brakes_in_program=self.timer)
        settings = SimulationSettings(dt=DT, transitions=self.times, idle=idle)
        self.plant = make_simulation(CELL, load, "ideal", settings, POWER)
        self.plant.backend.reset(self.q)
        self.plant.executor.hold(self.q)
        self.rng = rng

    def ready(self) -> float:
        """Step until motors are on; the seconds it took."""
        begun = self.plant.time
        while not self.plant.modes.motors_on:
            self.plant.step()
            assert self.plant.time - begun < 1000.0
        return self.plant.time - begun


def close(measured: float, planned: float) -> None:
    assert abs(measured - planned) <= max(JOULES, SHARE * planned), (measured, planned)


@pytest.mark.sampled
@pytest.mark.parametrize(
    "seed", [*range(6), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(6, 24))]
)
def test_a_pause_of_known_length_costs_what_was_planned(seed: int) -> None:
    """PROFIenergy's start and end; the driver goes through the modes by itself."""
    case = Case(seed)
    pause = float(round(10.0 ** case.rng.uniform(0.0, 3.0), 2))
    planned = plan_standby(pause, case.q, case.scene, case.times)
    plant = case.plant
    begun = plant.mains.energy()
    assert plant.pauses.start(pause, executing=False).name == planned.chosen.name
    plant.run(planned.wake_at)
    assert plant.modes.level in (Mode[planned.chosen.name], Mode.STAND_ON_MOTORS)
    if plant.modes.mode is Mode.HIBERNATION:
        plant.wake()
    else:
        plant.pauses.end()
    late = planned.wake_at + case.ready() - pause
    assert abs(late - planned.late) < 0.1
    plant.run(max(-late, 0.0))
    close(plant.mains.energy() - begun, planned.energy)


@pytest.mark.sampled
@pytest.mark.parametrize(
    "seed",
    [*range(24, 34), *(pytest.param(seed, marks=pytest.mark.long) for seed in range(34, 60))],
)
def test_a_policy_costs_what_was_planned_whenever_the_pause_ends(seed: int) -> None:
    """A PLC asks for each mode at its switch time, while the pause is on, and wakes the robot at
    its end.
    """
    case = Case(seed)
    samples = np.round(10.0 ** case.rng.uniform(-0.5, 2.6, 12), 2)
    planned = plan_standby(lengths_of(0.0, samples), case.q, case.scene, case.times)
    rests = rests_at(case.q, case.scene, case.times)
    steps = tuple(
        RestStep(rests.named(mode), at)
        for mode, at in zip(planned.modes, planned.switch_times, strict=True)
        if mode in BITS
    )
    pause = float(samples[case.rng.integers(len(samples))])
    energy, late = rests.cost(steps, pause)
    measured, delay = followed(case, steps, pause)
    assert abs(delay - late) < 0.2
    close(measured, energy)


def followed(case: Case, steps: tuple[RestStep, ...], pause: float) -> tuple[float, float]:
    """Energy [J] and delay [s] of the plant when a PLC sets its bits at the switch times and at the
    end.
    """
    plant = case.plant
    begun = plant.mains.energy()
    bits = [BITS[step.rest.name] for step in steps if step.at < pause]
    for k, bit in enumerate(bits):
        plant.run(steps[k].at - plant.time)
        plant.plc.set_bit(bit, True)
        if k and bits[k - 1] != "drives_off":  # one power bit at a time
            plant.plc.set_bit(bits[k - 1], False)
    plant.run(pause - plant.time)
    for bit in bits:
        plant.plc.set_bit(bit, False)
    if bits or not plant.modes.motors_on:
        plant.plc.set_bit("drives_on", True)  # its edge asks for motors
        plant.run(DEBOUNCE)
    while not plant.modes.motors_on:
        plant.wake()
        plant.step()
        assert plant.time - pause < 1000.0, plant.fault
    delay = plant.time - pause
    return plant.mains.energy() - begun, delay if delay > 2.0 * DEBOUNCE else 0.0


def rested(plant: Simulation, mode: str, wake_at: float) -> float:
    """Energy [J] of a pause that a PLC spends in one mode until a time [s], and of the waking."""
    plant.run(0.1)
    begun = plant.mains.energy()
    plant.plc.set_bit(BITS[mode], True)
    plant.run(wake_at)
    if mode == "HIBERNATION":
        plant.wake()
    plant.plc.set_bit(BITS[mode], False)
    plant.run(plant.modes.times[Mode[mode]].leave + 1.0)
    assert plant.modes.motors_on
    plant.mains.settle()
    return plant.mains.energy() - begun


@pytest.mark.sampled
@pytest.mark.parametrize(
    ("mode", "wake_at"),
    [("BUS_POWER_OFF", 6.0), ("BUS_POWER_OFF", 90.0), ("HIBERNATION", 400.0)],
)
def test_charging_the_dc_link_again_costs_what_was_planned_and_nothing_is_lost(
    mode: str, wake_at: float
) -> None:
    """Against the same pause of a link that keeps its charge."""
    cases = {}
    for discharge in (POWER.dc_link.discharge, None):
        power = replace(POWER, dc_link=replace(POWER.dc_link, discharge=discharge))
        plant = make_simulation(CELL, NO_LOAD, "ideal", SimulationSettings(dt=DT), power)
        energy = rested(plant, mode, wake_at)
        read = plant.mains.meter.reading()
        parts = (read.base_energy, read.axis_energy.sum(), read.burnt_energy, read.bled_energy)
        stored = read.rectifier_energy + read.capacitor_energy
        assert read.energy == pytest.approx(sum(parts) + stored, rel=1e-12)
        assert read.capacitor_energy == 0.0
        rests = rests_at(plant.backend.q, scene_with(CELL, NO_LOAD, power), TransitionTimes())
        leave = rests.named(mode).times.leave
        cases[discharge] = energy, rests.in_time((rests.named(mode),), wake_at + leave)
    driven, planned = np.subtract(cases[POWER.dc_link.discharge], cases[None])
    assert driven == pytest.approx(planned, rel=0.01, abs=0.2)
    assert driven > 5.0
