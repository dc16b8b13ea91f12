"""Any sequence of bits, requests and goals: no illegal transition, jump or crash; energy only
grows.
"""

from __future__ import annotations

import contextlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_msgs_py.modes import Mode, TransitionTimes
from ir_msgs_py.plc import OperatingMode, PlcInputs
from ir_sim_driver.controller.settings import ControllerSettings
from ir_sim_driver.errors import DriverError
from ir_sim_driver.plant.loads import carried
from ir_sim_driver.plc.inputs import BITS
from ir_sim_driver.power import IdleTimes

QUICK = TransitionTimes(
    stand_on_brakes_enter=0.02,
    stand_on_brakes_leave=0.03,
    stand_on_brakes_minimum_stay=0.02,
    bus_power_off_enter=0.03,
    bus_power_off_leave=0.05,
    bus_power_off_minimum_stay=0.02,
    hibernation_enter=0.05,
    hibernation_leave=0.05,
    hibernation_minimum_stay=0.05,
)
IDLE = IdleTimes(motors_to_brakes_in_program=0.4, motors_to_brakes_in_command=0.2)
M = Mode
AWAKE = {M.STAND_ON_MOTORS, M.MOVING}
LEGAL = {
    M.STAND_ON_MOTORS: {
        M.MOVING,
        M.TO_BRAKES,
        M.TO_BUS_POWER_OFF,
        M.TO_HIBERNATION,
        M.FROM_HIBERNATION,
    },
    M.MOVING: {
        M.STAND_ON_MOTORS,
        M.TO_BRAKES,
        M.TO_BUS_POWER_OFF,
        M.TO_HIBERNATION,
        M.FROM_HIBERNATION,
    },
    M.TO_BRAKES: {M.STAND_ON_BRAKES},
    M.STAND_ON_BRAKES: {M.FROM_BRAKES, M.TO_BUS_POWER_OFF, M.TO_HIBERNATION, M.FROM_HIBERNATION},
    M.FROM_BRAKES: {M.STAND_ON_MOTORS},
    M.TO_BUS_POWER_OFF: {M.BUS_POWER_OFF},
    M.BUS_POWER_OFF: {M.FROM_BUS_POWER_OFF, M.TO_HIBERNATION, M.FROM_HIBERNATION},
    M.FROM_BUS_POWER_OFF: {M.STAND_ON_MOTORS, M.EMERGENCY_STOP},
    M.TO_HIBERNATION: {M.HIBERNATION},
    M.HIBERNATION: {M.FROM_HIBERNATION},
    M.FROM_HIBERNATION: {M.STAND_ON_MOTORS, M.EMERGENCY_STOP},
    M.EMERGENCY_STOP: {M.FROM_BRAKES},
}
DRIVES_ON = AWAKE | {M.TO_BRAKES, M.STAND_ON_BRAKES, M.FROM_BRAKES}

actions = st.one_of(
    st.tuples(st.sampled_from(BITS), st.booleans()),
    st.tuples(st.just("all"), st.builds(PlcInputs, **{bit: st.booleans() for bit in BITS})),
    st.tuples(st.just("mode"), st.sampled_from([mode for mode in OperatingMode if mode])),
    st.tuples(st.just("goal"), st.floats(-0.1, 0.1)),
    st.tuples(st.just("scaling"), st.sampled_from([0.0, 0.3, 1.0, -1.0, float("nan")])),
    st.tuples(
        st.sampled_from(["wake", "recover", "pause", "end_pause", "cancel", "load"]), st.just(None)
    ),
)


def act(simulation, what, value, plan, start):  # noqa: C901
    home = np.array(simulation.cell.machine_home)
    match what:
        case "all":
            simulation.plc.set_all(value)
        case "mode":
            simulation.plc.set_operating_mode(value)
        case "goal":
            start(simulation, plan([1.2], home + value))
        case "scaling":
            simulation.set_speed_scaling(value)
        case "wake":
            simulation.wake()
        case "recover":
            simulation.recover()
        case "pause":
            simulation.pauses.start(3.0, simulation.executor.active)
        case "end_pause":
            simulation.control.end_pause()
        case "cancel":
            simulation.cancel(simulation.executor.goal_id or 0)
        case "load":
            simulation.set_load(carried(simulation.cell, "none"))
        case bit:
            simulation.plc.set_bit(bit, value)


sequences = st.lists(st.tuples(actions, st.integers(1, 120)), min_size=5, max_size=30)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(sequence=sequences)
def test_no_sequence_breaks_the_controller(make, plan, start, sequence):
    keep_the_laws(make, plan, start, sequence)


@pytest.mark.long
@settings(max_examples=1_000, deadline=None, derandomize=True)
@given(sequence=sequences)
def test_a_thousand_sequences_don_t_break_the_controller(make, plan, start, sequence):
    keep_the_laws(make, plan, start, sequence)


def keep_the_laws(make, plan, start, sequence):
    simulation = make(
        transitions=QUICK,
        idle=IDLE,
        controller=ControllerSettings(enabling_switch=True),
        load="none",
        backend="ideal",
    )
    before = simulation.modes.mode
    energy = 0.0
    for (what, value), steps in sequence:
        if simulation.on_the_network or what in ("wake", "all"):
            with contextlib.suppress(DriverError):
                act(simulation, what, value, plan, start)
        for _ in range(steps):
            pressed = simulation.plc.levels.emergency_stop
            q = simulation.backend.q
            qd = simulation.backend.qd
            simulation.step()
            now = simulation.modes.mode
            if now is not before:
                assert now in LEGAL[before] or (now is M.EMERGENCY_STOP and before in DRIVES_ON)
            if now not in (*AWAKE, M.EMERGENCY_STOP):
                assert np.array_equal(simulation.backend.q, q) or np.abs(qd).max() < 1e-2
            assert np.abs(simulation.backend.q - q).max() < 0.004  # 4 rad/s: nothing jumps
            if pressed and before in DRIVES_ON:
                assert now is M.EMERGENCY_STOP
            before = now
        simulation.mains.settle()
        reading = simulation.mains.meter.reading()
        assert reading.energy >= energy
        energy = reading.energy
        parts = (
            reading.base_energy
            + reading.axis_energy.sum()
            + reading.burnt_energy
            + reading.bled_energy
            + reading.rectifier_energy
            + reading.capacitor_energy
        )
        assert reading.energy == pytest.approx(parts, rel=1e-9, abs=1e-6)


short_sequences = st.lists(st.tuples(actions, st.integers(1, 60)), max_size=8)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(sequence=short_sequences)
def test_the_time_to_operate_of_an_ended_pause_is_kept_from_every_state(
    make, plan, start, sequence
):
    """Or End_Pause is refused, and nothing but its answer has happened."""
    simulation = make(
        transitions=QUICK,
        idle=IDLE,
        controller=ControllerSettings(enabling_switch=True),
        load="none",
        backend="ideal",
    )
    for (what, value), steps in sequence:
        with contextlib.suppress(DriverError):
            act(simulation, what, value, plan, start)
        simulation.run(steps * 1e-3)
    if not simulation.on_the_network:
        return
    announced = None
    with contextlib.suppress(DriverError):
        announced = simulation.control.end_pause()
    if announced is None:
        return
    for _ in range(round(1e3 * announced) + 3):
        simulation.step()
        if simulation.modes.motors_on:
            return
    pytest.fail(f"motors are not on after {announced} s but {simulation.modes.mode.name}")


@pytest.mark.parametrize(
    ("seed", "steps"),
    [
        (7, 30_000),
        *(pytest.param(seed, 100_000, marks=pytest.mark.long) for seed in range(7, 12)),
    ],
)
def test_steps_of_random_bits_make_legal_changes_alone(make, seed, steps):
    """Bits that a broken PLC might send, 1000 a second."""
    simulation = make(transitions=QUICK, idle=IDLE, load="none")
    generator = np.random.default_rng(seed)
    seen = set()
    before = simulation.modes.mode
    for k in range(steps):
        if k % 17 == 0:
            simulation.plc.set_bit(BITS[generator.integers(len(BITS))], bool(generator.integers(2)))
        if k % 1000 == 0:
            simulation.plc.set_all(PlcInputs())
            with contextlib.suppress(DriverError):
                simulation.recover()
            simulation.wake()
        simulation.step()
        now = simulation.modes.mode
        seen.add(now)
        assert (
            now is before
            or now in LEGAL[before]
            or (now is M.EMERGENCY_STOP and before in DRIVES_ON)
        )
        before = now
    assert len(seen) >= 8
