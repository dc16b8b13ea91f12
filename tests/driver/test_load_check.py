"""A load that is not the declared one is noticed by the torque it takes, and a declared one is
not.
"""

from __future__ import annotations

import numpy as np
import pytest

from ir_description import data_sheet, load_cell, load_robot
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import ErrorCode, SimulationSettings, TrajectoryGoal, make_simulation
from ir_sim_driver.controller.outputs import report
from ir_sim_driver.load_check import (
    Declared,
    LoadCheckSettings,
    LoadFinding,
    NotedMotion,
    Uncertainty,
    weighed,
)
from ir_sim_driver.motion import GoalOutcome
from ir_sim_driver.notices import Level
from ir_sim_driver.plant import carried
from ir_values.arrays import FloatArray

CELL = load_cell("demo")


def driven(
    mass_error: float, load: str = "cell", backend: str = "ideal"
) -> tuple[GoalOutcome, Level]:
    """A movement of A2 with a load that is so much heavier than declared, and the executor's level
    after.
    """
    settings = SimulationSettings(load_check=LoadCheckSettings(mass_error=mass_error))
    simulation = make_simulation(CELL, load, backend, settings)
    q = simulation.executor.command
    there = q + np.array([0.0, 0.4, 0.0, 0.0, 0.0, 0.0])
    rest = np.zeros((2, 6))
    goal = JointTrajectory.from_seconds(
        simulation.robot.joint_names, [0.0, 1.5], [q, there], rest, rest
    )
    simulation.execute(simulation.vet(TrajectoryGoal(goal, label="up"), 0), 0)
    for _ in range(40):
        simulation.run(0.1)
        outcomes = simulation.take_outcomes()
        if outcomes:
            return outcomes[0], report(simulation, 0.0)[-1].level
    raise AssertionError("the movement does not end")


@pytest.mark.parametrize("backend", ["ideal", "pybullet"])
@pytest.mark.parametrize("error", [0.2, -0.2])
def test_a_fifth_of_the_load_is_noticed_with_expected_and_found_torque(
    error: float, backend: str
) -> None:
    outcome, level = driven(error, backend=backend)
    finding = outcome.load_check
    assert finding is not None
    assert finding.noticed
    assert finding.trajectory_id == "up"
    assert finding.mass == pytest.approx(31.0 * np.sign(error), abs=3.0 * finding.mass_deviation)
    assert abs(finding.found - finding.expected) > 3.0 * finding.deviation
    assert f"expects {finding.expected:.0f} Nm" in outcome.sentence
    assert f"found are {finding.found:.0f} Nm" in outcome.sentence
    assert level is Level.WARN


def test_a_declared_load_is_weighed_and_not_noticed() -> None:
    outcome, level = driven(0.0)
    assert outcome.load_check is not None
    assert not outcome.load_check.noticed
    assert (outcome.sentence, level) == ("", Level.OK)


def after_a_stop(mass_error: float, seed: int) -> LoadFinding | None:
    """What a movement says that follows an emergency stop somewhere in another one: of A1, or of
    drawn axes, from where the arm sank to, while the other axes creep back to where they were.
    """
    generator = np.random.default_rng(seed)
    settings = SimulationSettings(load_check=LoadCheckSettings(mass_error=mass_error))
    simulation = make_simulation(CELL, "cell", "pybullet", settings)
    home = simulation.executor.command

    def drive(there: FloatArray, seconds: float) -> None:
        rest = np.zeros((2, 6))
        way = [simulation.executor.command, there]
        goal = JointTrajectory.from_seconds(
            simulation.robot.joint_names, [0.0, seconds], way, rest, rest
        )
        simulation.execute(simulation.vet(TrajectoryGoal(goal), 0), 0)

    def turned() -> FloatArray:
        moves = generator.random(6) < 0.3
        moves[0] = True
        return home + moves * generator.uniform(-0.4, 0.4, 6)

    drive(turned(), generator.uniform(1.5, 3.0))
    simulation.run(generator.uniform(0.2, 1.2))
    simulation.plc.set_bit("emergency_stop", True)
    simulation.run(generator.uniform(0.6, 1.5))
    simulation.plc.set_bit("emergency_stop", False)
    simulation.run(0.2)
    simulation.recover()
    simulation.run(0.5)
    simulation.take_outcomes()
    drive(turned(), generator.uniform(1.5, 3.0))
    simulation.run(4.0)
    (outcome,) = simulation.take_outcomes()
    assert outcome.code is ErrorCode.SUCCESSFUL
    return outcome.load_check


@pytest.mark.parametrize(
    ("seed", "errors"),
    [
        (0, (0.3,)),
        *(pytest.param(seed, (0.3, -0.3), marks=pytest.mark.long) for seed in range(6)),
    ],
)
def test_a_declared_load_is_not_noticed_after_a_stop_and_another_one_is(
    seed: int, errors: tuple[float, ...]
) -> None:
    as_declared = after_a_stop(0.0, seed)
    assert as_declared is not None
    assert not as_declared.noticed, as_declared.sentence
    for error in errors:
        other = after_a_stop(error, seed)
        assert other is not None
        assert other.noticed
        assert np.sign(other.mass) == np.sign(error)


def test_no_load_is_not_weighed() -> None:
    assert driven(0.0, "none")[0].load_check is None


def test_the_estimated_mass_is_as_uncertain_as_it_says() -> None:
    """Robots drawn from the parameters' covariance; what is found is the model of another
    implementation's draw, without any column of the check.
    """
    load = carried(CELL, "gripper")
    marks = load_robot().marks
    generator = np.random.default_rng(5)
    declared = Declared(load, Uncertainty(CELL.robot, data_sheet(), marks, CELL.base_pose))
    z = []
    for seed in range(60):
        s = np.linspace(0.0, 1.0, 24)[:, None]
        start = generator.uniform(-0.8, 0.8, 6) + CELL.machine_home
        delta = generator.uniform(-0.8, 0.8, 6)
        q = start + (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5) * delta
        qd = (30.0 * s**2 - 60.0 * s**3 + 30.0 * s**4) * delta / 1.5
        qdd = (60.0 * s - 180.0 * s**2 + 120.0 * s**3) * delta / 1.5**2
        drawn = data_sheet().drawn(seed)
        other = DynamicsModel(
            drawn.robot_with(CELL.robot), drawn.loads_with(load.loads), CELL.base_pose
        )
        finding = weighed(
            NotedMotion(q, qd, qdd, other.inverse_dynamics(q, qd, qdd)), declared, 3.0
        )
        assert finding is not None
        z.append(finding.mass / finding.mass_deviation)
    assert np.abs(z).max() < 3.0
    assert np.std(z) > 0.1
