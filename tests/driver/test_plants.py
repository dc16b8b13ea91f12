"""Plants: drawn by seed, read from files, named everywhere; and their energies add up."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from ir_description import load_power_data, load_robot
from ir_sim_driver.controller.driver import Driver
from ir_sim_driver.controller.outputs import report
from ir_sim_driver.controller.simulation import make_simulation
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.plant import nominal_plant, plant_hash, plant_named, plant_to_yaml, typical_plant
from ir_sim_driver.plant.drivetrain import Gears
from ir_sim_driver.plant.plants import CUT, SPREAD, plant_from_yaml
from ir_values.errors import DescriptionFileError

HEAD = "format: ir_sim_driver/plant/1\nname: mine\nrobot: kr210_r2700_extra\n"


@pytest.fixture(scope="module")
def data():
    return load_power_data()


def figures_of(plant):
    """Every number of a plant, by section and name."""
    robot = plant.robot
    found = {
        name: getattr(robot, name)
        for name in ("link_mass", "link_com", "link_inertia", "reflected_inertia")
    }
    for section in (plant.drives, plant.gears, plant.link):
        found |= {f.name: getattr(section, f.name) for f in fields(section)}
    watts = [plant.watts.drives, plant.watts.tool, *plant.watts.controller.values()]
    return {**found, "watts": watts, "pressure": robot.counterbalance.charge_pressure}


def test_a_seed_draws_the_same_plant_again_and_another_one_another(cell, data):
    first, again, other = (typical_plant(cell.robot, data, seed) for seed in (3, 3, 4))
    for name, value in figures_of(first).items():
        assert np.array_equal(value, figures_of(again)[name]), name
    differs = [
        not np.array_equal(v, figures_of(other)[name]) for name, v in figures_of(first).items()
    ]
    assert np.mean(differs) > 0.9
    assert first.name == "typical:3"


def test_typical_figures_stay_as_near_to_the_data_as_their_marks_say(cell, data):
    nominal = cell.robot
    drawn = [typical_plant(cell.robot, data, seed) for seed in range(40)]
    masses = np.array([plant.robot.link_mass / nominal.link_mass - 1.0 for plant in drawn])
    assert np.abs(masses[:, :4]).max() <= CUT * SPREAD["H"] + 1e-12
    assert masses[:, 1].std() == pytest.approx(SPREAD["H"], rel=0.4)
    friction = np.array([plant.gears.coulomb / nominal.friction_coulomb - 1.0 for plant in drawn])
    assert friction.std() == pytest.approx(SPREAD["M"], rel=0.2)
    assert abs(friction.mean()) < 0.02


@pytest.mark.parametrize("text", ["nominal", "typical", "typical:12"])
def test_a_plant_comes_back_from_its_file_as_it_was(cell, data, text):
    plant = plant_named(text, cell.robot, data)
    again = plant_from_yaml(plant_to_yaml(plant), cell.robot, data)
    assert again.name == plant.name
    for name, value in figures_of(plant).items():
        assert np.array_equal(value, figures_of(again)[name]), name


def test_what_a_file_leaves_out_is_nominal(cell, data, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(HEAD + "dc_link: {mains_v: 540}\nwatts: {controller_w: {HIBERNATION: 20}}\n")
    plant = plant_named(str(file), cell.robot, data)
    nominal = nominal_plant(cell.robot, data)
    assert plant.link.mains == 540.0
    assert plant.link.capacitance == nominal.link.capacitance
    assert sorted(plant.watts.controller.values()) == [20.0, 115.0, 135.0, 135.0]
    assert np.array_equal(plant.gears.viscous, nominal.gears.viscous)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "gears: {start_deg_c: [5, 5, 5, 5, 5, 900]}",
            "start_deg_c[5] is 900 deg C, must be in [0, 150] deg C",
        ),
        ("gears: {friction: 1}", "unknown key 'friction'"),
        (
            "links: [{name: link_2, mass_kg: -1}]",
            "links[0].mass_kg is -1 kg, must be in (0, 100000] kg",
        ),
        ("dc_link: {mains_v: 700}", "above the mains, 700 V"),
        ("drives: {switching_w: [1, 2]}", "has 2 entries, must have 6"),
        (
            "gears: {friction_viscous_nms_per_rad: -1}",
            "gears.friction_viscous_nms_per_rad is '-1', must be a list of 6 entries",
        ),
        ("gears: {start_deg_c: }", "gears.start_deg_c is empty, must be a list of 6 entries"),
        ("gears: {start_deg_c: {a: 1}}", "gears.start_deg_c must be a list of 6 entries"),
        (
            "dc_link: {brake_resistor_ohm: 1e-9}",
            "dc_link.brake_resistor_ohm is 1e-9 ohm, must be in [0.1, 10000] ohm",
        ),
        ("dc_link: {capacitance_f: 1e-300}", "capacitance_f is 1e-300 F, must be in [1e-05, 10] F"),
        (
            "gears: {heat_capacity_j_per_k: [9, 9, 9, 9, 9, 1e-300]}",
            "gears.heat_capacity_j_per_k[5] is 1e-300 J/K, must be in [0.1, 1e+09] J/K",
        ),
        (
            "gears: {conductance_w_per_k: [0, 0, 1e5, 0, 0, 0], heat_capacity_j_per_k: [9, 9, 9, "
            "9, 9, 9]}",
            "gear 3 of 9 J/K and 100000 W/K cools with a time constant of 9e-05 s, must be at "
            "least 10 s",
        ),
    ],
)
def test_a_file_without_sense_is_refused_with_its_place(cell, data, tmp_path, text, said):
    file = tmp_path / "wrong.yaml"
    file.write_text(HEAD + text + "\n")
    with pytest.raises(DescriptionFileError) as refused:
        plant_named(str(file), cell.robot, data)
    assert said in str(refused.value)
    assert str(file) in str(refused.value)


@pytest.mark.parametrize(
    "content", [b"root:*:20228:0:99999:7:::\n", b"secret\n", b"\xffsecret: 1\n", b"a: {b"]
)
def test_nothing_of_a_file_that_is_no_plant_is_quoted(cell, data, tmp_path, content):
    file = tmp_path / "shadow.yaml"
    file.write_bytes(content)
    with pytest.raises(DescriptionFileError, match="this is no plant file") as refused:
        plant_named(str(file), cell.robot, data)
    said = str(refused.value).replace(str(file), "")
    assert not any(word in said for word in ("root", "20228", "secret", "xff", "{b"))


def test_the_hash_of_a_plant_is_that_of_its_figures(cell, data, tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text(HEAD)
    nominal = plant_hash(nominal_plant(cell.robot, data))
    assert plant_hash(plant_named(str(file), cell.robot, data)) == nominal
    file.write_text(HEAD + "dc_link: {mains_v: 540}\n")
    assert plant_hash(plant_named(str(file), cell.robot, data)) != nominal


@pytest.mark.parametrize("text", ["clay", "typical:x", "typical:-1", ""])
def test_an_unknown_plant_is_refused_with_the_known_ones(cell, data, text):
    with pytest.raises(SettingsError, match="known are nominal, typical, typical:SEED"):
        plant_named(text, cell.robot, data)


def test_the_parts_of_a_typical_plant_add_up_at_every_instant(plan, start, cell):
    simulation = make_simulation(cell, plant="typical:5")
    home = np.array(cell.machine_home)
    start(simulation, plan(1.6, home, home + np.array([0.6, 0.2, -0.2, 0.3, 0.2, 0.2])))
    for _ in range(170):
        simulation.run(0.01)
        simulation.mains.settle()
        r = simulation.mains.meter.reading()
        axes = r.mechanical_energy + r.copper_energy + r.inverter_energy + r.iron_energy
        assert r.axis_energy == pytest.approx(axes, rel=1e-12)
        parts = (
            r.base_energy + axes.sum() + r.burnt_energy + r.capacitor_energy + r.rectifier_energy
        )
        assert r.energy == pytest.approx(parts, rel=1e-12)
    losses = (r.copper_energy, r.inverter_energy, r.iron_energy)
    assert all((loss > 0.0).all() for loss in losses)
    assert r.rectifier_energy > 0.0
    assert 0.0 < r.tool_energy < r.base_energy


def test_meter_results_and_diagnostics_name_the_plant(cell):
    simulation = make_simulation(cell, plant="typical:5")
    frames = [Driver(simulation).tick(k * 2_000_000) for k in range(1, 10)]
    power = next(frame.power for frame in frames if frame.power is not None)
    assert power.plant == "typical:5"
    assert power.joint_temperature.shape == power.joint_current.shape == (6,)
    assert report(simulation, 0.0)[0].values["plant"] == "typical:5"
    assert make_simulation(cell, backend="ideal", plant="typical:5").plant.name == "ideal"


def test_a_load_that_was_not_declared_is_carried_in_the_tube(plan, start, run_out, cell):
    simulation = make_simulation(cell, plant="typical:1")
    simulation.backend.set_load(simulation.load.loads, declared=())
    home = np.array(cell.machine_home)
    start(simulation, plan(2.5, home, home + np.array([0.6, 0.2, -0.2, 0.3, 0.2, 0.2])))
    outcome = run_out(simulation)
    assert outcome.code == 0
    assert 1e-5 < max(outcome.max_tracking_error) < 1e-3
    assert outcome.max_tool_deviation < 0.005


def test_gears_warm_up_by_their_friction_and_turn_more_easily(cell, data):
    gears = Gears(typical_plant(cell.robot, data, 0).gears, 1.0)
    speed = np.full(6, 0.5)
    dry = gears.dry(speed.tolist(), [0.0] * 6)
    cold, _ = gears.friction(speed.tolist(), dry)
    before = gears.temperature
    heat = np.zeros(6)
    for _ in range(3600):
        friction, _ = gears.friction(speed.tolist(), dry)
        gears.heat(friction, speed)
        heat += np.array(friction) * speed
    warm, _ = gears.friction(speed.tolist(), dry)
    assert (gears.temperature > before + 1.0).all()
    assert np.less(warm, cold).all()
    figures = typical_plant(cell.robot, data, 0).gears
    assert (gears.temperature - before < heat / figures.capacity).all()  # some of it has gone


@pytest.mark.parametrize("name", ["kr6_r900_2", "kr210_r2700_extra", "kr300_r2700_2", "ur10e"])
def test_the_plants_of_bundled_robots_lie_within_the_bounds_of_a_file(name, data):
    robot = load_robot(name)
    for plant in (nominal_plant(robot, data), typical_plant(robot, data, 1)):
        text = plant_to_yaml(plant)
        assert plant_to_yaml(plant_from_yaml(text, robot, data)) == text
