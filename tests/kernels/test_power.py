"""The DC link: where braking energy goes, and that none is lost or made."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from robots import kr210, tool_155

from ir_kernels import DynamicsModel, KernelError, dc_bus
from ir_kernels.power import REGENERATIONS, DcBusParameters, Regeneration

CAPACITY = 106.0  # J, of the KR C4's capacitors between rest voltage and brake chopper
POWERS = st.lists(st.lists(st.floats(-5e3, 5e3), min_size=2, max_size=2), min_size=1, max_size=30)


@given(POWERS, st.sampled_from(REGENERATIONS), st.floats(1e-4, 0.1), st.floats(0.0, CAPACITY))
def test_mains_are_axes_plus_dissipated_plus_the_change_of_the_capacitor(
    powers: list[list[float]], regeneration: Regeneration, dt: float, stored: float
) -> None:
    axis_power = np.array(powers)
    bus = dc_bus(axis_power, dt, DcBusParameters(CAPACITY, regeneration), stored)
    change = np.diff(bus.stored, prepend=stored)
    assert bus.mains * dt == pytest.approx(
        (axis_power.sum(axis=1) + bus.dissipated) * dt + change, abs=1e-6
    )
    assert (bus.stored >= 0.0).all()
    assert (bus.stored <= CAPACITY).all()
    assert (bus.dissipated >= 0.0).all()
    if regeneration != "fed_back":
        assert (bus.mains >= 0.0).all()


@pytest.mark.parametrize(
    ("regeneration", "mains", "dissipated", "stored"),
    [
        ("shared", [0.0, 0.0, 0.0, 94.0], [0.0, 94.0, 0.0, 0.0], [100.0, 106.0, 6.0, 0.0]),
        ("fed_back", [0.0, -94.0, 0.0, 94.0], [0.0, 0.0, 0.0, 0.0], [100.0, 106.0, 6.0, 0.0]),
        ("none", [50.0, 0.0, 100.0, 100.0], [150.0, 100.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]),
    ],
)
def test_a_surplus_goes_to_the_axes_then_the_capacitor_then_the_rest(
    core: Any,
    regeneration: Regeneration,
    mains: list[float],
    dissipated: list[float],
    stored: list[float],
) -> None:
    axis_power = np.array([[50.0, -150.0], [0.0, -100.0], [100.0, 0.0], [50.0, 50.0]])
    bus = dc_bus(axis_power, 1.0, DcBusParameters(CAPACITY, regeneration), core=core)
    assert bus.mains == pytest.approx(mains)
    assert bus.dissipated == pytest.approx(dissipated)
    assert bus.stored == pytest.approx(stored)


def test_steps_one_by_one_are_the_scan(core: Any) -> None:
    rng = np.random.default_rng(0)
    axis_power = rng.normal(0.0, 1e3, (50, 6))
    parameters = DcBusParameters(CAPACITY)
    whole = dc_bus(axis_power, 0.01, parameters, 20.0, core=core)
    stored = 20.0
    for k in range(50):
        step = dc_bus(axis_power[k : k + 1], 0.01, parameters, stored, core=core)
        assert (step.mains[0], step.dissipated[0]) == (whole.mains[k], whole.dissipated[k])
        stored = float(step.stored[0])


def test_drive_energy_is_mechanical_work_plus_copper() -> None:
    model = DynamicsModel(kr210(), (tool_155(),))
    rng = np.random.default_rng(1)
    q, qd, qdd = rng.uniform(-1, 1, (3, 200, 6))
    dt = np.full(200, 0.005)
    power = model.drive_power(q, qd, qdd)
    tau = model.inverse_dynamics(q, qd, qdd)
    copper = kr210().copper_loss * (tau / kr210().gear_ratio) ** 2
    assert dt @ power == pytest.approx(((tau * qd + copper) * dt[:, None]).sum(axis=0))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.full((2, 6), np.nan), 0.1, DcBusParameters(1.0)), "axis_power"),
        ((np.zeros((2, 6)), 0.0, DcBusParameters(1.0)), "dt holds 0.0 s"),
        ((np.zeros((2, 6)), np.ones(3), DcBusParameters(1.0)), "dt has shape"),
        ((np.zeros((2, 6)), 0.1, DcBusParameters(1.0), 2.0), "stored is 2.0 J"),
    ],
)
def test_a_bad_argument_is_named(arguments: Any, message: str) -> None:
    with pytest.raises(KernelError, match=message):
        dc_bus(*arguments)


def test_an_unknown_regeneration_lists_the_known() -> None:
    with pytest.raises(KernelError, match="known are shared, none, fed_back"):
        DcBusParameters(1.0, "magic")  # type: ignore[arg-type]
