"""The DC link: nothing is lost, whatever the axes do, and an independent integration agrees."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_kernels.power import REGENERATIONS, DcBusParameters, Regeneration, dc_bus
from ir_sim_driver.plant.dc_link import PRECHARGE, DcCircuit
from ir_sim_driver.plant.plant_parameters import LinkFigures

DT = 0.001
IDEAL_CHOPPER = LinkFigures(1.33e-3, 560.0, 688.0, 688.0, 11.0, 0.0, 0.0)
POWERS = st.lists(
    st.lists(st.floats(-60e3, 60e3), min_size=6, max_size=6), min_size=1, max_size=60
)  # beyond what six axes can do


@st.composite
def links(draw: st.DrawFn) -> LinkFigures:
    mains = draw(st.floats(300.0, 700.0))
    off = mains * draw(st.floats(1.01, 1.3))
    on = off * draw(st.floats(1.0, 1.2))
    small = st.floats(0.0, 5.0)
    return LinkFigures(
        draw(st.floats(1e-4, 1e-2)),
        mains,
        on,
        off,
        draw(st.floats(2.0, 100.0)),
        draw(small),
        draw(small),
    )


@settings(max_examples=200, deadline=None)
@given(figures=links(), powers=POWERS, regeneration=st.sampled_from(REGENERATIONS))
def test_what_is_supplied_goes_to_axes_resistor_and_capacitor_at_every_step(
    figures: LinkFigures, powers: list[list[float]], regeneration: Regeneration
) -> None:
    circuit = DcCircuit(figures, DT, regeneration)
    for row in powers:
        before = circuit.stored
        flows = circuit.step(row)
        taken = DT * sum(row) + flows.dissipated + circuit.stored - before
        assert flows.supplied == pytest.approx(taken, abs=1e-9 * (1.0 + DT * sum(map(abs, row))))
        assert flows.dissipated >= 0.0
        assert flows.rectifier >= 0.0
        assert circuit.voltage >= figures.mains * (1.0 - 1e-12)
        if flows.supplied > 0.0:  # the rectifier conducts only where U is down at the mains'
            assert circuit.stored == 0.0
        if flows.rectifier > 0.0:
            assert flows.supplied > 0.0


@settings(max_examples=200, deadline=None)
@given(figures=links(), powers=POWERS, regeneration=st.sampled_from(REGENERATIONS))
def test_many_steps_at_once_are_the_steps_one_by_one(
    figures: LinkFigures, powers: list[list[float]], regeneration: Regeneration
) -> None:
    once = DcCircuit(figures, DT, regeneration)
    each = DcCircuit(figures, DT, regeneration)
    together = once.steps(np.array(powers))
    single = np.array([each.step(row) for row in powers]).sum(axis=0)
    scale = 1.0 + DT * np.abs(powers).sum()
    np.testing.assert_allclose(together, single, rtol=1e-9, atol=1e-9 * scale)
    assert once.stored == pytest.approx(each.stored, abs=1e-9 * scale)


@settings(max_examples=100, deadline=None)
@given(
    figures=links(),
    powers=POWERS,
    rate=st.floats(1e-4, 1.0),
    steps=st.integers(1, 400_000),
    regeneration=st.sampled_from(REGENERATIONS),
)
def test_what_is_lost_while_the_bus_is_off_is_charged_again(
    figures: LinkFigures,
    powers: list[list[float]],
    rate: float,
    steps: int,
    regeneration: Regeneration,
) -> None:
    """A resistor across the capacitor, then the mains through another: charge times their voltage
    is drawn, whatever both resistances.
    """
    circuit = DcCircuit(replace(figures, discharge_rate=rate), DT, regeneration)
    for row in powers:
        circuit.step(row)
    before = circuit.stored
    volts = circuit.voltage
    bled = circuit.off(steps)
    left = volts * math.exp(-rate * steps * DT)
    assert circuit.voltage == pytest.approx(left, rel=1e-6, abs=1e-3)
    assert bled == pytest.approx(before - circuit.stored, rel=1e-9, abs=1e-9)
    supplied = 0.0
    lost = 0.0
    for _ in range(round(PRECHARGE / DT) + 1):
        flows = circuit.step([0.0] * 6)
        assert flows.dissipated == 0.0
        supplied += flows.supplied
        lost += flows.rectifier
    taken = figures.capacitance * figures.mains * max(figures.mains - left, 0.0)
    scale = figures.capacitance * figures.mains**2
    assert supplied - bled == pytest.approx(circuit.stored - before, abs=1e-9 * scale)
    assert circuit.stored >= 0.0
    bare = figures.rectifier_drop == figures.rectifier_resistance == 0.0
    assert supplied + lost >= taken - 1e-9 * scale
    if bare:
        assert supplied + lost == pytest.approx(taken, abs=1e-6 * scale)


@settings(max_examples=100, deadline=None)
@given(powers=POWERS, regeneration=st.sampled_from(REGENERATIONS))
def test_without_hysteresis_it_is_the_bus_of_the_planner(
    powers: list[list[float]], regeneration: Regeneration
) -> None:
    circuit = DcCircuit(IDEAL_CHOPPER, DT, regeneration)
    flows = np.array([circuit.step(row) for row in powers])
    capacity = 0.5 * 1.33e-3 * (688.0**2 - 560.0**2)
    bus = dc_bus(np.array(powers), DT, DcBusParameters(capacity, regeneration))
    assert flows[:, 0] == pytest.approx(DT * bus.mains, abs=1e-7)
    assert flows[:, 1] == pytest.approx(DT * bus.dissipated, abs=1e-7)
    assert circuit.stored == pytest.approx(bus.stored[-1], abs=1e-7)


@settings(max_examples=15, deadline=None)
@given(powers=st.lists(st.floats(-30e3, 30e3), min_size=5, max_size=15))
def test_the_chopper_switches_as_in_a_fine_integration(powers: list[float]) -> None:
    """Euler's steps of 1 us of C dU/dt = i_mains - P / U - U / R."""
    figures = LinkFigures(1.33e-3, 560.0, 688.0, 668.0, 11.0, 0.0, 0.0)
    circuit = DcCircuit(figures, DT)
    voltage = 560.0
    closed = False
    heat = 0.0
    fine = 1e-6
    dissipated = 0.0
    for power in powers:
        for _ in range(round(DT / fine)):
            closed = voltage >= 688.0 or (closed and voltage > 668.0)
            resistor = voltage / 11.0 if closed else 0.0
            heat += fine * voltage * resistor
            voltage += fine * (-power / voltage - resistor) / 1.33e-3
            voltage = max(voltage, 560.0)
        dissipated += circuit.step((power,)).dissipated
    assert abs(dissipated - heat) < 0.5 + 0.01 * heat  # J; a step of 1 us is up to 0.04 J late
    assert circuit.voltage == pytest.approx(
        voltage, abs=21.0
    )  # the hysteresis: it may switch a step apart


def test_the_rectifier_loses_its_drop_and_its_resistance() -> None:
    circuit = DcCircuit(LinkFigures(1e-3, 500.0, 700.0, 650.0, 10.0, 2.0, 0.5), DT)
    flows = circuit.step((5000.0,))  # 10 A
    assert flows.rectifier == pytest.approx(DT * 10.0 * (2.0 + 0.5 * 10.0))
    assert math.isclose(circuit.voltage, 500.0)
