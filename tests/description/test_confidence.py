"""Every figure of the data files has a mark, found by its place."""

from ir_description import load_power_data, load_robot


def test_every_figure_has_a_mark_under_its_place():
    robot = load_robot().marks
    power = load_power_data().marks
    assert robot["drives.friction_viscous_nms_rad"] == "M"
    assert robot["links.link_2.mass_kg"] == "H"
    assert robot["counterbalance.charge_pressure_pa"] == "M"
    assert power["modes.HIBERNATION.controller_w"] == "M"
    assert power["dc_link.capacitance_f"] == "H"
    assert {*robot.values(), *power.values()} == {"H", "M", "L"}
