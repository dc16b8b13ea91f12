"""Loads that the wrist cannot carry or that no body can have: refused with value and bound; the
rest runs.
"""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

from ir_description import Cell, load_cell
from ir_sim_driver import make_simulation
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plant import custom_load

MILLIMETRE = 0.001


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell("open")


def custom(cell: Cell, mass: float, com: tuple[float, float, float], *inertia: float) -> None:
    custom_load(cell, mass, np.array(com), np.array(inertia), 0.0, 0.0)


def test_the_rated_load_point_is_carried_and_a_little_more_is_not(cell: Cell) -> None:
    """210 kg at 0.24 m in front of the flange and 0.27 m beside it: an estimate, not used to build
    it.
    """
    custom(cell, 210.0, (0.24, 0.27 - MILLIMETRE, 0.0), 105.0, 0.0, 0.0, 105.0, 0.0, 105.0)
    with pytest.raises(
        RequestRefusedError, match=r"moment of .* Nm about the last axis.* at most 556 Nm"
    ):
        custom(cell, 210.0, (0.1, 0.28, 0.0))
    with pytest.raises(
        RequestRefusedError, match=r"moment of .* Nm about the wrist's centre.* at most 1090"
    ):
        custom(cell, 210.0, (0.33, 0.0, 0.0))


def test_the_rated_mass_at_a_metre_is_refused(cell: Cell) -> None:
    with pytest.raises(RequestRefusedError, match="2502 Nm"):
        custom(cell, 210.0, (1.0, 0.0, 0.0))


def test_a_flywheel_is_refused(cell: Cell) -> None:
    with pytest.raises(RequestRefusedError, match=r"inertia of .* kg m\^2 about .*: .* at most"):
        custom(cell, 10.0, (0.1, 0.0, 0.0), 300.0, 0.0, 0.0, 300.0, 0.0, 300.0)


@pytest.mark.parametrize(
    "inertia",
    [
        (1.0, 0.0, 0.0, 1.0, 0.0, 2.1),  # triangle inequality
        (1.0, 5.0, 0.0, 1.0, 0.0, 1.0),  # not positive
        (float("nan"), 0.0, 0.0, 1.0, 0.0, 1.0),
        (1e308, 0.0, 0.0, 1e308, 0.0, 1e308),
        (1.0, 0.0, 0.0),
    ],
)
def test_what_no_body_can_have_is_refused(cell: Cell, inertia: tuple[float, ...]) -> None:
    with pytest.raises(RequestRefusedError):
        custom(cell, 10.0, (0.1, 0.0, 0.0), *inertia)


def survivors(cell: Cell, cases: int, seed: int) -> tuple[int, list[str]]:
    """Random loads of all sizes and shapes on the physics: how many were carried, and what went
    wrong.
    """
    generator = np.random.default_rng(seed)
    simulation = make_simulation(cell, backend="pybullet")
    carried = 0
    wrong = []
    for case in range(cases):
        mass = 10.0 ** generator.uniform(-9.0, 2.32)
        com = generator.normal(size=3) * 10.0 ** generator.uniform(-6.0, 0.0)
        shape = mass * np.abs(generator.normal(size=3)) * 10.0 ** generator.uniform(-9.0, 1.0, 3)
        shape *= np.where(generator.random(3) < 0.2, 1e-12, 1.0)  # needles and discs
        turn = np.linalg.qr(generator.normal(size=(3, 3)))[0]
        tensor = turn @ np.diag(shape.sum() - shape) @ turn.T
        try:
            load = custom_load(cell, mass, com, tensor[np.triu_indices(3)], 0.0, 0.0)
        except RequestRefusedError:
            continue
        simulation.set_load(load)
        simulation.run(0.02)
        carried += 1
        if simulation.fault:
            wrong.append(f"case {case} of seed {seed}: {simulation.fault}")
            simulation = make_simulation(cell, backend="pybullet")
    return carried, wrong


def test_forty_random_loads_are_carried_or_refused(
    cell: Cell, capfd: pytest.CaptureFixture[str]
) -> None:
    carried, wrong = survivors(cell, 40, seed=0)
    assert wrong == []
    assert carried > 10
    said = "".join(capfd.readouterr())  # Bullet takes what it calls bad for zero
    assert "Bad inertia" not in said


def needle(generator: np.random.Generator) -> np.ndarray:
    """Inertia (6,) of a body whose least moment is what rounding leaves."""
    turn = np.linalg.qr(generator.normal(size=(3, 3)))[0]
    tensor: np.ndarray = (turn @ np.diag([1e-17, 1.0, 1.0]) @ turn.T)[np.triu_indices(3)]
    return tensor * 10.0 ** generator.uniform(-6.0, 0.0)


def test_what_is_taken_as_a_load_can_be_scaled_and_weighed(cell: Cell) -> None:
    """The load check compares with heavier loads in proportion, whose inertia rounding turned
    negative.
    """
    generator = np.random.default_rng(0)
    simulation = make_simulation(cell, backend="ideal")
    for _ in range(60):
        with contextlib.suppress(RequestRefusedError):
            load = custom_load(cell, 10.0, np.array([0.1, 0.0, 0.0]), needle(generator), 0.0, 0.0)
            simulation.set_load(load)
            assert simulation.load is load


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_two_thousand_random_loads_are_carried_or_refused(cell: Cell, seed: int) -> None:
    assert survivors(cell, 500, seed=10 + seed)[1] == []


@pytest.mark.parametrize(
    ("mass", "com", "inertia"),
    [  # rounding left these unsymmetrical by one bit in Bullet, which stopped the plant for good
        (
            58.885839177068384,
            (0.2699501068933443, 0.21000922327413202, -0.5655660817178797),
            (
                18.087931947380227, 1.2838865211320116, -1.7137164203058506,
                11.524954228226607, 8.988991505632244, 10.265888047591837,
            ),
        ),
        (
            79.02243303178399,
            (-0.7801847888169607, 0.390905798833282, 0.1928661097386332),
            (
                0.003438575613269482, 0.0021896043244319717, 0.001615528314003789,
                0.004353934655066185, -0.0010189463455711988, 0.005429113277959415,
            ),
        ),
    ],
)  # fmt: skip
def test_an_inertia_that_rounding_skews_is_carried(
    cell: Cell, mass: float, com: tuple[float, ...], inertia: tuple[float, ...]
) -> None:
    simulation = make_simulation(cell, backend="pybullet")
    simulation.set_load(custom_load(cell, mass, np.array(com), np.array(inertia), 0.0, 0.0))
    simulation.run(0.02)
    assert not simulation.stopped, simulation.fault


def test_a_flat_plate_has_its_inertia_in_the_physics_too(cell: Cell) -> None:
    inertia = np.array(
        [
            26.40133764665394, -7.530245270746493, -1.3598219742758433,
            3.056306958606719, -4.608475174226605, 27.7945027374608,
        ]
    )  # fmt: skip
    com = np.array([-0.07759464362512764, 0.12965089406865812, -0.02429308446016383])
    simulation = make_simulation(cell, backend="pybullet")
    simulation.set_load(custom_load(cell, 143.34435875349004, com, inertia, 0.0, 0.0))
    simulation.run(0.004)
    physics = simulation.backend.mass_matrix()
    model = simulation.dynamics.mass_matrix(simulation.backend.q[None])[0]
    assert np.abs(physics - model).max() < 1e-4 * np.abs(model).max()
