"""Supervision never sleeps: whoever leaves range, tube, speed or acceleration is stopped until
recovered.
"""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from ir_description import load_cell
from ir_msgs_py.modes import Mode
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import (
    ExecutionSettings,
    Simulation,
    SimulationSettings,
    TrajectoryGoal,
    TrajectoryRefusedError,
    make_simulation,
)
from ir_sim_driver.controller.outputs import report
from ir_sim_driver.controller.supervision import CommandedPosition, Supervision, SupervisionSettings
from ir_sim_driver.notices import Level
from ir_sim_driver.plant import Backend

BARE = replace(
    load_cell("open"), floor=False, equipment=(), stations=(), parts=(), program=(), tasks=()
)


def start(simulation: Simulation, times: list[float], points: list[np.ndarray]) -> None:
    rest = np.zeros((len(points), 6))
    goal = JointTrajectory.from_seconds(simulation.robot.joint_names, times, points, rest, rest)
    simulation.execute(simulation.vet(TrajectoryGoal(goal), 0), 0)


def is_stopped(simulation: Simulation) -> bool:
    """STOP 0 with a fault that people see, and a robot that stands."""
    entries = {entry.name: entry for entry in report(simulation, 0.0)}
    seen = [entry.level for name, entry in entries.items() if name != "ir_sim_driver: executor"]
    return (
        simulation.modes.mode is Mode.EMERGENCY_STOP
        and not simulation.backend.qd.any()
        and seen == [Level.ERROR, Level.ERROR]
    )


@pytest.fixture
def simulation() -> Simulation:
    return make_simulation(BARE, backend="pybullet")


def pushed(torque: float) -> np.ndarray:
    return np.array([torque, 0.0, 0.0, 0.0, 0.0, 0.0])


def seen(looks: list[tuple[np.ndarray, np.ndarray, bool]], deviation: float = 0.0) -> str:
    """What the supervision alone says of positions, speeds (n,) and saturation, look by look."""
    watch = Supervision(BARE.robot, 1e-3, SupervisionSettings())
    fault = None
    for q, qd, saturated in looks:
        backend = cast(Backend, SimpleNamespace(q=q.copy(), qd=qd, saturated=saturated))
        fault = fault or watch.look(backend, CommandedPosition(q, deviation, 5e-3), braking=False)
    return fault.sentence if fault is not None else ""


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("share", [0.99, 1.01])
def test_each_bound_of_the_supervision_counts_alone(sign: float, share: float) -> None:
    """One percent within and beyond 0.02 rad, 10 %, twice the acceleration over 20 ms, 5 mm and 0.3
    s.
    """
    robot = BARE.robot
    home = np.array(BARE.machine_home)
    rest = np.zeros(6)
    one = sign * np.eye(6)[3]
    beyond = share > 1.0
    edge = home.copy()
    edge[3] = (robot.position_max if sign > 0 else robot.position_min)[3] + share * 0.02 * sign
    fast = share * 1.1 * robot.velocity_max[3] * one
    harder = [(home, share * k * 0.008 * robot.acceleration_max[3] * one, False) for k in range(7)]
    long = [(home, rest, True)] * round(share * 76)
    assert ("is at" in seen([(edge, rest, False)])) is beyond
    assert ("moves at" in seen([(home, fast, False)])) is beyond
    assert ("accelerates at" in seen(harder)) is beyond
    assert ("mm from its command" in seen([(home, rest, False)], share * 5e-3)) is beyond
    assert ("all the torque" in seen(long)) is beyond


def test_a_robot_that_is_pushed_away_while_it_holds_is_stopped(simulation: Simulation) -> None:
    simulation.run(0.2)
    simulation.disturb(pushed(2e4))
    simulation.run(0.3)
    simulation.disturb(None)
    simulation.run(0.5)
    assert "joint_a1" in simulation.fault
    assert is_stopped(simulation)
    with pytest.raises(TrajectoryRefusedError, match="recover first"):
        start(simulation, [1.0], [simulation.backend.q])
    simulation.recover()
    simulation.run(1.5)
    assert simulation.modes.mode is Mode.STAND_ON_MOTORS
    assert report(simulation, 0.0)[0].level is Level.OK


def test_a_robot_that_is_pushed_while_it_stops_along_its_path_is_stopped(
    simulation: Simulation,
) -> None:
    q = simulation.backend.q
    start(simulation, [0.0, 2.0], [q, q + 0.4])
    simulation.run(1.0)
    simulation.abort("for a test")
    simulation.disturb(pushed(2e4))
    simulation.run(0.2)
    simulation.disturb(None)
    simulation.run(0.5)
    assert is_stopped(simulation)


def test_a_motor_that_gives_all_it_has_for_long_is_stopped() -> None:
    """With a tube so wide that only the saturation shows."""
    settings = SimulationSettings(execution=ExecutionSettings(tube=0.1, path_tolerance=1.0))
    simulation = make_simulation(BARE, backend="pybullet", settings=settings)
    simulation.run(0.1)
    most = np.array(simulation.robot.envelope_torque)[0, 0]
    simulation.disturb(pushed(1.05 * most))  # a little more than it can hold
    simulation.run(0.5)
    assert "all the torque" in simulation.fault


def moved_to(simulation: Simulation, q: np.ndarray) -> None:
    simulation.backend.reset(q)
    simulation.executor.hold(q)


def test_a_lead_in_that_swings_farther_out_first_is_refused() -> None:
    """Its ends are allowed; to arrive with that speed it would begin outwards."""
    simulation = make_simulation(BARE, backend="ideal")
    robot = simulation.robot
    outside = simulation.backend.q.copy()
    outside[0] = robot.position_max[0] + 0.01  # within what the supervision allows
    moved_to(simulation, outside)
    points = np.array([outside, outside])
    speeds = np.zeros((2, 6))
    points[:, 0] -= 0.1, 0.6
    speeds[0, 0] = -0.5
    names = robot.joint_names
    goal = JointTrajectory.from_seconds(names, [2.0, 4.0], points, speeds, np.zeros((2, 6)))
    with pytest.raises(TrajectoryRefusedError, match="joint_a1 is at"):
        simulation.execute(simulation.vet(TrajectoryGoal(goal), 0), 0)
    start(simulation, [2.0], [points[1]])


@pytest.mark.parametrize("beyond", [0.03, 0.2])
def test_beyond_a_limit_it_is_stopped_and_can_only_be_driven_back(beyond: float) -> None:
    simulation = make_simulation(BARE, backend="ideal")
    simulation.run(0.1)
    robot = simulation.robot
    outside = simulation.backend.q.copy()
    outside[0] = robot.position_max[0] + beyond
    moved_to(simulation, outside)
    simulation.run(0.3)
    assert "joint_a1 is at" in simulation.fault
    assert is_stopped(simulation)
    simulation.recover()
    simulation.run(1.5)
    assert simulation.modes.mode is Mode.STAND_ON_MOTORS
    assert simulation.fault == ""

    farther = outside.copy()
    inside = outside.copy()
    farther[0] += 0.01
    inside[0] = robot.position_max[0] - 0.05
    with pytest.raises(TrajectoryRefusedError, match="joint_a1"):
        start(simulation, [2.0], [farther])
    with pytest.raises(TrajectoryRefusedError, match="joint_a1"):
        start(simulation, [2.0, 4.0], [inside, farther])
    start(simulation, [3.0], [inside])
    simulation.run(3.5)
    assert simulation.fault == ""
    assert np.abs(simulation.backend.q - inside).max() < 1e-9


def test_a_command_that_jumps_is_stopped_whoever_made_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bug in the executor: the second look is independent of the first."""
    simulation = make_simulation(BARE, backend="ideal")
    simulation.run(0.1)
    q = simulation.backend.q
    steps = 0

    def runs_away(scaling: float, ready: bool = True) -> np.ndarray:
        nonlocal steps
        steps += 1
        simulation.executor.command = q + pushed(1e-5) * steps**2
        return simulation.executor.command

    monkeypatch.setattr(simulation.executor, "advance", runs_away)
    simulation.run(5.0)
    assert "its limit is" in simulation.fault
    assert is_stopped(simulation)


def test_what_is_allowed_is_never_stopped(simulation: Simulation) -> None:
    """Movements at the limits, disturbed as docs/driver.md allows."""
    generator = np.random.default_rng(0)
    home = simulation.backend.q
    for target in (home + np.array([0.6, 0.2, -0.2, 0.4, 0.3, 0.5]), home):
        start(simulation, [2.0], [target])
        for _ in range(20):
            simulation.disturb(
                np.array([600.0] * 3 + [100.0] * 3) * generator.choice([-1.0, 1.0], 6)
            )
            simulation.run(0.15)
        simulation.disturb(None)
    assert simulation.fault == ""
