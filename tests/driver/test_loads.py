"""What the flange carries: names joined by "+", numbers, and what no robot carries."""

from __future__ import annotations

import numpy as np
import pytest

from ir_description import load_cell
from ir_msgs_py.status import StatusCode
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plant.loads import carried, custom_load

NOTHING = np.zeros(0)
POINT = np.array([0.2, 0.0, 0.0])


def test_nothing_is_a_load_too(cell):
    assert carried(cell, "none").mass == carried(cell, "").mass == 0.0


def test_the_tool_of_table_2_has_mass_and_watts(cell):
    load = carried(cell, cell.tool.name)
    assert (load.mass, load.watts_always, load.watts_drive_bus) == (155.0, 90.0, 100.0)


@pytest.mark.parametrize("text", ["anvil", "gripper_155kg+anvil", "+", "none+gripper_155kg"])
def test_an_unknown_load_lists_the_known(cell, text):
    with pytest.raises(RequestRefusedError, match=r"known are .*gripper_155kg") as refusal:
        carried(cell, text)
    assert refusal.value.code is StatusCode.INVALID_OBJECT_NAME


def test_a_load_twice_is_refused(cell):
    with pytest.raises(RequestRefusedError, match="more than once"):
        carried(cell, f"{cell.tool.name}+{cell.tool.name}")


@pytest.mark.parametrize("mass", [-1.0, float("nan"), 10_000.0, 210.1])
def test_an_impossible_payload_is_answered_with_minus_1_and_its_limit(cell, mass):
    with pytest.raises(RequestRefusedError, match=r"\[0, 210\] kg") as refusal:
        custom_load(cell, mass, POINT, NOTHING, 0.0, 0.0)
    assert refusal.value.code == -1


@pytest.mark.parametrize(
    ("com", "inertia", "watts"),
    [
        (np.array([float("nan"), 0.0, 0.0]), NOTHING, 0.0),
        (POINT, np.ones(3), 0.0),
        (POINT, np.array([1.0, 0.0, 0.0, -1.0, 0.0, 1.0]), 0.0),
        (POINT, NOTHING, -5.0),
    ],
)
def test_numbers_that_are_no_body_are_refused(cell, com, inertia, watts):
    with pytest.raises(RequestRefusedError):
        custom_load(cell, 50.0, com, inertia, watts, 0.0)


def test_a_load_changes_holding_torque_and_is_refused_in_motion(make, plan, start):
    simulation = make("pybullet")
    simulation.run(0.01)
    heavy = simulation.backend.torque.copy()
    simulation.set_load(carried(simulation.cell, "none"))
    simulation.run(0.01)
    assert np.abs(simulation.backend.torque[2]) < 0.5 * np.abs(heavy[2])
    home = np.array(simulation.cell.machine_home)
    start(simulation, plan(2.0, home, home + 0.1))
    simulation.run(0.5)
    with pytest.raises(RequestRefusedError, match="moves"):
        simulation.set_load(carried(simulation.cell, simulation.cell.tool.name))


def test_every_bundled_part_can_be_carried():
    cell = load_cell("open")
    for part in cell.parts:
        assert carried(cell, part.name).mass == part.load.mass
