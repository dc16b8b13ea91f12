"""Emergency stop: stops at once, says how far off the path, and nothing resumes or jumps
afterwards.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from ir_msgs_py.modes import Mode
from ir_sim_driver.controller import SupervisionSettings
from ir_sim_driver.controller.outputs import report
from ir_sim_driver.errors import BackendError, RequestRefusedError, TrajectoryRefusedError
from ir_sim_driver.motion.goal import ErrorCode


@pytest.fixture
def home(cell):
    return np.array(cell.machine_home)


@pytest.fixture
def stopped(make, plan, start, home):
    """A simulation that was stopped in the middle of a fast movement, the button still pressed."""
    simulation = make("pybullet")
    there = home + np.array([1.2, 0.4, -0.4, 0.8, -0.5, 1.0])
    start(simulation, plan(2.5, home, there))
    simulation.run(1.25)
    simulation.plc.set_bit("emergency_stop", True)
    return simulation


def test_the_robot_stops_faster_than_along_the_path_and_the_goal_ends(stopped):
    assert np.abs(stopped.backend.qd).max() > 0.5
    stopped.run(0.002)
    (outcome,) = stopped.take_outcomes()
    assert (outcome.code, outcome.sentence) == (ErrorCode.INVALID_GOAL, "emergency stop")
    stopped.run(0.5)
    assert np.abs(stopped.backend.qd).max() == 0.0
    assert stopped.modes.mode is Mode.EMERGENCY_STOP


def test_the_distance_from_the_path_is_published(stopped):
    stopped.run(0.5)
    assert 1e-5 < stopped.safety.emergency.excursion < 0.05
    controller = {entry.name: entry for entry in report(stopped, 0.0)}["ir_sim_driver: controller"]
    assert controller.level == 2
    published = float(controller.values["emergency stop left the path by [mm]"])
    assert published == pytest.approx(stopped.safety.emergency.excursion * 1e3, abs=0.01)


def test_brakes_take_no_motor_power_and_hold_against_gravity(stopped):
    stopped.run(0.5)
    q = stopped.backend.q.copy()
    before = stopped.mains.meter.reading()
    stopped.run(1.0)
    after = stopped.mains.meter.reading()
    assert np.array_equal(stopped.backend.q, q)
    assert after.energy - before.energy == pytest.approx(
        325.0, rel=1e-3
    )  # Table II, on brakes with 155 kg


def test_release_alone_does_nothing_and_recover_needs_it(stopped):
    stopped.run(0.5)
    with pytest.raises(RequestRefusedError, match="still pressed"):
        stopped.recover()
    stopped.plc.set_bit("emergency_stop", False)
    stopped.run(5.0)
    assert stopped.modes.mode is Mode.EMERGENCY_STOP
    q = stopped.backend.q.copy()
    assert "nothing resumes" in stopped.recover()
    stopped.run(2.0)
    assert stopped.modes.mode is Mode.STAND_ON_MOTORS
    assert np.abs(stopped.backend.q - q).max() < 1e-6  # an encoder has steps
    assert not stopped.executor.active


def test_a_plc_recovers_by_confirming_and_switching_the_drives_on(stopped):
    stopped.run(0.5)
    plc = stopped.plc
    plc.set_bit("emergency_stop", False)
    stopped.run(0.1)
    plc.set_bit("drives_on", True)
    stopped.run(0.1)
    plc.set_bit("drives_on", False)
    stopped.run(0.1)
    assert stopped.modes.mode is Mode.EMERGENCY_STOP  # not confirmed yet
    plc.set_bit("conf_mess", True)
    stopped.run(0.1)
    plc.set_bit("drives_on", True)
    stopped.run(1.0)
    assert stopped.modes.mode is Mode.STAND_ON_MOTORS


def test_goals_are_refused_until_recovered_and_run_from_where_the_robot_stands(
    stopped, plan, start, run_out, home
):
    stopped.run(0.5)
    stopped.plc.set_bit("emergency_stop", False)
    stopped.run(0.1)
    back = plan([4.0], home)
    with pytest.raises(Exception, match="recover first"):
        start(stopped, back)
    stopped.recover()
    stopped.run(1.0)
    stopped.take_outcomes()
    start(stopped, back)
    assert run_out(stopped).code == ErrorCode.SUCCESSFUL


@pytest.mark.parametrize(("load", "least", "most"), [("none", 1e-4, 5e-3), ("cell", 5e-3, 3e-2)])
def test_pressing_it_at_rest_lets_the_arm_sag_until_the_brakes_hold_it(make, load, least, most):
    simulation = make("pybullet", load)
    simulation.run(0.1)
    before = simulation.tool.position(simulation.backend.q)
    simulation.plc.set_bit("emergency_stop", True)
    simulation.run(0.3)
    assert simulation.modes.mode is Mode.EMERGENCY_STOP
    sag = before - simulation.tool.position(simulation.backend.q)
    assert least < sag[2] < most
    assert np.linalg.norm(sag) == pytest.approx(simulation.safety.emergency.excursion, rel=1e-6)
    assert not simulation.backend.qd.any()
    assert not simulation.outputs().alarm_stop


STOPS = re.findall(
    r"^\| (none|155 kg) \| A(\d), ([\d.]+) rad in ([\d.]+) s \| (.+?) \| (.+?) \|$",
    (Path(__file__).parents[2] / "docs" / "driver.md").read_text(),
    re.MULTILINE,
)


def stopped_by(bit, simulation, joint):
    """Angle [rad] and time [s] of a joint until it stands."""
    q = simulation.backend.q[joint]
    begun = simulation.time
    simulation.plc.set_bit(bit, True)
    while np.abs(simulation.backend.qd[joint]) > 1e-3:
        simulation.step()
    return abs(simulation.backend.q[joint] - q), simulation.time - begun


@pytest.mark.parametrize(("load", "axis", "angle", "seconds", "stop_0", "stop_1"), STOPS)
def test_the_table_of_stops_in_the_docs(
    make, plan, start, home, load, axis, angle, seconds, stop_0, stop_1
):
    found = []
    for bit in ("emergency_stop", "drives_off"):
        simulation = make("pybullet", load="none" if load == "none" else "cell")
        there = home.copy()
        there[int(axis) - 1] += float(angle)
        start(simulation, plan(float(seconds), home, there))
        simulation.run(0.5 * float(seconds))
        found.append(stopped_by(bit, simulation, int(axis) - 1))
        simulation.run(0.5)
        found.append(simulation.safety.emergency.excursion * 1e3)
    (rad, lasted), off, (along, longer), _ = found
    assert stop_0 == f"{rad:.2f} rad, {lasted:.2f} s, {off:.0f} mm"
    assert stop_1 == f"{along:.2f} rad, {longer:.2f} s"


def test_the_table_of_stops_has_its_rows():
    assert len(STOPS) == 4


def test_closed_brakes_don_t_sag(make):
    simulation = make("pybullet")
    simulation.plc.set_bit("drives_off", True)
    simulation.run(2.0)
    assert simulation.modes.mode is Mode.STAND_ON_BRAKES
    q = simulation.backend.q.copy()
    simulation.plc.set_bit("emergency_stop", True)
    simulation.run(0.2)
    assert simulation.modes.mode is Mode.EMERGENCY_STOP
    assert np.array_equal(simulation.backend.q, q)


def test_brakes_that_act_at_once_stop_sooner(make, plan, start, home):
    stops = []
    for reaction in (0.0, 0.05):
        simulation = make("pybullet", supervision=SupervisionSettings(brake_reaction=reaction))
        start(simulation, plan(2.5, home, home + np.array([1.2, 0.0, 0.0, 0.0, 0.0, 0.0])))
        simulation.run(1.25)
        q = simulation.backend.q[0]
        speed = simulation.backend.qd[0]
        simulation.plc.set_bit("emergency_stop", True)
        simulation.run(1.0)
        stops.append(simulation.backend.q[0] - q)
    assert stops[1] - stops[0] == pytest.approx(
        0.05 * speed, rel=0.2
    )  # friction brakes a little meanwhile


def test_physics_that_fail_stop_the_robot_and_recover_starts_them_again(
    make, plan, start, home, monkeypatch
):
    simulation = make("pybullet")
    start(simulation, plan(2.0, home, home + 0.2))
    simulation.run(0.5)

    def explode(q_next):
        raise BackendError("the physics has diverged")

    monkeypatch.setattr(simulation.backend, "track", explode)
    simulation.run(0.1)
    (outcome,) = simulation.take_outcomes()
    assert "diverged" in outcome.sentence
    plant = report(simulation, 0.0)[0]
    assert (plant.level, plant.sentence) == (2, "the physics has diverged")
    monkeypatch.undo()
    q = simulation.backend.q.copy()
    simulation.recover()
    simulation.run(2.0)
    assert simulation.modes.mode is Mode.STAND_ON_MOTORS
    assert np.abs(simulation.backend.q - q).max() < 1e-6  # an encoder has steps


def test_a_lost_physics_server_comes_back_with_recover(make, plan, start, run_out, home):
    simulation = make("pybullet")
    simulation.run(0.1)
    simulation.backend.close()
    simulation.run(0.1)
    assert simulation.fault
    simulation.recover()
    simulation.run(1.0)
    start(simulation, plan(2.0, home, home + 0.1))
    assert run_out(simulation).code == ErrorCode.SUCCESSFUL


def test_recovering_from_nothing_is_harmless(make):
    simulation = make()
    assert "nothing to recover from" in simulation.recover()
    simulation.run(0.1)
    assert simulation.modes.mode is Mode.STAND_ON_MOTORS


def test_a_second_recover_says_that_it_recovered_nothing(stopped):
    stopped.run(0.5)
    stopped.plc.set_bit("emergency_stop", False)
    stopped.run(0.1)
    assert stopped.recover() == "the brakes open where the robot stands; nothing resumes"
    assert stopped.recover() == "nothing to recover from: stop 1 is recovered, the brakes open"
    stopped.run(1.0)
    assert stopped.modes.mode is Mode.STAND_ON_MOTORS
    assert stopped.recover() == "nothing to recover from: the mode is STAND_ON_MOTORS"


def test_a_recover_in_the_step_of_a_fault_lets_the_brakes_stop_the_robot_first(
    make, plan, start, home
):
    simulation = make("pybullet")
    start(simulation, plan(2.5, home, home + np.array([1.2, 0.4, -0.4, 0.8, -0.5, 1.0])))
    simulation.run(1.25)
    assert np.abs(simulation.backend.qd).max() > 0.5
    simulation.plc.stop.fault(simulation.plc.order)
    simulation.recover()
    assert simulation.modes.mode is Mode.EMERGENCY_STOP
    simulation.run(2.0)
    (outcome,) = simulation.take_outcomes()
    assert outcome.code == ErrorCode.INVALID_GOAL
    assert simulation.modes.mode is Mode.STAND_ON_MOTORS


def test_a_recover_while_the_robot_rolls_on_keeps_the_stop_until_it_stands(stopped):
    stopped.run(0.002)
    stopped.plc.set_bit("emergency_stop", False)
    stopped.run(0.022)
    assert np.abs(stopped.backend.qd).max() > 0.5
    stopped.recover()
    while stopped.modes.mode is Mode.EMERGENCY_STOP:
        stopped.run(0.001)
    assert np.abs(stopped.backend.qd).max() < 1e-4  # the motors have taken the arm up
    assert 1e-5 < stopped.safety.emergency.excursion < 0.05


@pytest.mark.parametrize("asked", ["ab", "a pause"])
@pytest.mark.parametrize("recovered", [False, True])
def test_a_press_in_bus_power_off_is_latched_while_the_mode_says_what_is_powered(
    make, home, asked, recovered
):
    simulation = make("ideal")
    simulation.run(1.0)
    if asked == "ab":
        simulation.plc.set_bit("ab", True)
    else:
        simulation.pauses.start(600.0, executing=False)
    simulation.run(10.0)
    assert simulation.modes.mode is Mode.BUS_POWER_OFF
    simulation.plc.set_bit("emergency_stop", True)
    simulation.run(1.0)
    assert simulation.stopped
    assert not simulation.outputs().alarm_stop
    assert report_says(simulation, "emergency stop")
    stays = simulation.modes.mode
    assert stays is (Mode.BUS_POWER_OFF if asked == "ab" else Mode.FROM_BUS_POWER_OFF)
    simulation.plc.set_bit("emergency_stop", False)
    simulation.run(0.1)
    if recovered:
        simulation.recover()
        assert simulation.modes.mode is stays
    simulation.plc.set_bit("ab", False)
    simulation.run(25.0)
    ends = Mode.STAND_ON_MOTORS if recovered else Mode.EMERGENCY_STOP
    assert simulation.modes.mode is ends
    assert np.abs(simulation.backend.q - home).max() < 1e-9


def report_says(simulation, text):
    return any(text in entry.sentence for entry in report(simulation, 0.0))


def test_a_goal_that_a_stop_ends_before_it_has_stopped_on_its_path_says_so(make, plan, start, home):
    simulation = make("ideal")
    goal_id = start(simulation, plan(2.5, home, home + 0.8 * np.eye(6)[0]))
    simulation.run(1.25)
    simulation.cancel(goal_id)
    simulation.run(0.05)
    assert simulation.executor.path_speed > 0.1
    simulation.plc.set_bit("emergency_stop", True)
    simulation.run(0.01)
    (outcome,) = simulation.take_outcomes()
    assert (outcome.code, outcome.canceled) == (ErrorCode.INVALID_GOAL, False)
    assert outcome.sentence == "emergency stop, before the robot stood: canceled"


def test_a_goal_that_follows_another_driver_process_is_refused(make, plan, start, home):
    known = make(before_first_stop=1_795_973_304_123_000_000)
    anew = make(before_first_stop=1_795_973_304_124_000_000)
    there = home + 0.1
    with pytest.raises(TrajectoryRefusedError, match="was started after the one that the sender"):
        start(anew, plan(1.0, home, there), after_stop=known.stop_number)
    assert not anew.executor.active
    start(anew, plan(1.0, home, there), after_stop=anew.stop_number)


def test_a_goal_that_does_not_know_the_last_stop_is_refused_with_the_count_of_both(
    make, plan, start, home
):
    simulation = make(before_first_stop=1_795_973_304_123_000_000)
    known = simulation.stop_number
    simulation.plc.set_bit("emergency_stop", True)
    simulation.plc.set_bit("emergency_stop", False)
    simulation.run(0.1)
    simulation.recover()
    simulation.run(1.0)
    with pytest.raises(TrajectoryRefusedError, match="stop 1 came after stop 0"):
        start(simulation, plan(1.0, home, home + 0.1), after_stop=known)
