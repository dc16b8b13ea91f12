"""The contract of `Backend`, for each registered robot behind the controller."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ir_description import Cell, Load, load_cell
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.controller import SimulationSettings
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.plant import BACKENDS, Backend, MotorWork, make_backend

SETTINGS = SimulationSettings()
DT = SETTINGS.dt
TRACKING = 1e-4
"""Largest deviation [rad] from a command within all limits: 0.3 mm at 3 m of reach; the tube is 5
mm.
"""
TORQUE = 5.0
"""Largest error [Nm] of a torque: about 0.1 % of what A1 to A3 can give."""
REACH = np.array([0.5, 0.3, -0.3, 0.4, -0.3, 0.5])


@pytest.fixture(scope="module")
def cell() -> Cell:
    return load_cell("open")


@pytest.fixture(params=BACKENDS)
def backend(request: pytest.FixtureRequest, cell: Cell) -> Backend:
    """A fresh backend that carries the cell's tool and stands at machine home."""
    made = make_backend(request.param, cell, DT, SETTINGS.control)
    made.set_load(tool(cell))
    made.reset(home(cell))
    made.work()
    return made


def home(cell: Cell) -> np.ndarray:
    return np.asarray(cell.machine_home, dtype=np.float64)


def holding(cell: Cell, loads: tuple[Load, ...]) -> np.ndarray:
    """Motor torque (n,) [Nm] that holds the loads at machine home, counterbalance included."""
    still = np.zeros((1, 6))
    dynamics = DynamicsModel(cell.robot, loads, cell.base_pose)
    return np.array(dynamics.inverse_dynamics(home(cell)[None], still, still)[0])


def tool(cell: Cell) -> tuple[Load, ...]:
    assert cell.tool is not None
    return (cell.tool,)


def motion(start: np.ndarray, seconds: float = 2.0) -> np.ndarray:
    """Commands (K, n): from rest to rest by REACH, the end of each step."""
    u = np.arange(1, round(seconds / DT) + 1)[:, None] * DT / seconds
    fraction = 10.0 * u**3 - 15.0 * u**4 + 6.0 * u**5
    return np.array(start + fraction * REACH)


def drive(backend: Backend, commands: np.ndarray) -> np.ndarray:
    """Track all commands; the positions (K, n) after each step."""
    reached = []
    for q in commands:
        backend.track(q)
        reached.append(np.array(backend.q))
    return np.array(reached)


def moving(backend: Backend, cell: Cell) -> None:
    """Bring the backend into the middle of a motion."""
    drive(backend, motion(home(cell))[: round(1.0 / DT)])


def held(backend: Backend) -> np.ndarray:
    """Torque (n,) [Nm] of the last 0.1 s, in the mean: encoders have steps."""
    return np.array(backend.work().torque[-round(0.1 / DT) :].mean(axis=0))


def test_reset_makes_it_stand_where_it_was_put(backend: Backend, cell: Cell) -> None:
    q = home(cell) + REACH
    backend.reset(q)
    q += 1.0  # the backend keeps a copy
    assert np.array_equal(backend.q, home(cell) + REACH)
    assert np.array_equal(backend.qd, np.zeros(6))
    assert backend.standing
    assert backend.disturbance is None


def test_it_holds_its_position_with_the_torque_of_gravity(backend: Backend, cell: Cell) -> None:
    commands = np.tile(home(cell), (round(0.5 / DT), 1))
    assert np.abs(drive(backend, commands) - home(cell)).max() < 1e-6
    assert backend.standing
    assert np.abs(held(backend) - holding(cell, tool(cell))).max() < TORQUE


def test_it_follows_a_motion_with_the_torque_of_the_equations_of_motion(
    backend: Backend, cell: Cell
) -> None:
    commands = motion(home(cell))
    reached = drive(backend, commands)
    assert np.abs(reached - commands).max() < TRACKING
    work = backend.work()
    assert work.speed.shape == work.torque.shape == commands.shape
    path = np.vstack((home(cell), home(cell), commands))
    speed = np.diff(path, axis=0) / DT
    qdd = np.diff(speed, axis=0) / DT
    middle = 0.5 * (speed[1:] + speed[:-1])
    dynamics = DynamicsModel(cell.robot, tool(cell), cell.base_pose)
    expected = dynamics.inverse_dynamics(path[1:-1], middle, qdd)
    assert np.abs(work.speed - middle).max() < 0.01
    # below, each backend smooths friction in its own manner
    sliding = np.abs(middle).min(axis=1) > 0.01
    assert sliding.sum() > 0.8 * len(commands)
    off = work.torque - expected
    off[~sliding] = 0.0
    ripple = np.cumsum(off, axis=0)  # encoders have steps: what counts is the mean over 20 ms
    assert np.abs(ripple[20:] - ripple[:-20]).max() / 20.0 < TORQUE


def test_work_is_handed_over_once_with_one_row_per_step(backend: Backend, cell: Cell) -> None:
    for _ in range(3):
        backend.track(home(cell))
    backend.rest()
    backend.brake()
    work = backend.work()
    assert isinstance(work, MotorWork)
    assert work.speed.shape == work.torque.shape == (5, 6)
    assert np.isfinite(work.speed).all()
    assert np.isfinite(work.torque).all()
    again = backend.work()
    assert again.speed.shape == again.torque.shape == (0, 6)


def test_speed_and_torque_are_those_of_the_last_step(backend: Backend, cell: Cell) -> None:
    moving(backend, cell)
    before = np.array(backend.q)
    backend.track(motion(home(cell))[round(1.0 / DT)])
    assert np.abs(backend.qd - (backend.q - before) / DT).max() < 0.05
    assert not backend.standing
    assert np.array_equal(backend.torque, backend.work().torque[-1])


def test_brakes_stop_every_joint_without_motor_torque(backend: Backend, cell: Cell) -> None:
    moving(backend, cell)
    backend.work()
    speeds = [np.abs(backend.qd)]
    for _ in range(round(1.0 / DT)):
        backend.brake()
        speeds.append(np.abs(backend.qd))
        if backend.standing:
            break
    assert backend.standing
    assert max(speeds[-1]) < max(speeds[0])
    assert (np.diff([speed.max() for speed in speeds]) < 0.05).all()
    assert not backend.work().torque.any()


def test_coasting_takes_no_torque_and_lets_the_arm_sag(backend: Backend, cell: Cell) -> None:
    drive(backend, np.tile(home(cell), (10, 1)))
    backend.work()
    for _ in range(50):
        backend.coast()
    sag = backend.q - home(cell)
    assert (sag[1:3] > 5e-4).all()  # both turn downwards
    assert np.abs(sag).max() < 0.1
    assert not backend.torque.any()
    assert not backend.saturated
    assert not backend.work().torque.any()


def test_closed_brakes_hold_the_robot_exactly(backend: Backend, cell: Cell) -> None:
    q = np.array(backend.q)
    for _ in range(10):
        backend.rest()
    assert np.array_equal(backend.q, q)
    assert backend.standing
    assert not backend.torque.any()
    assert not backend.work().torque.any()


def test_it_drives_on_from_where_the_brakes_held_it(backend: Backend, cell: Cell) -> None:
    moving(backend, cell)
    while not backend.standing:
        backend.brake()
    backend.rest()
    q = np.array(backend.q)
    reached = drive(backend, motion(q))
    assert np.abs(reached[-1] - (q + REACH)).max() < TRACKING


def test_a_load_changes_the_torque_and_not_the_state(backend: Backend, cell: Cell) -> None:
    drive(backend, np.tile(home(cell), (10, 1)))
    q = np.array(backend.q)
    carried = np.array(backend.torque)
    backend.set_load(())
    assert np.array_equal(backend.q, q)
    assert backend.standing
    drive(backend, np.tile(home(cell), (round(0.5 / DT), 1)))
    found = held(backend)
    assert np.abs(found - holding(cell, ())).max() < TORQUE
    assert np.abs(found - carried).max() > 100.0


def test_a_disturbance_is_taken_and_ends(backend: Backend, cell: Cell) -> None:
    backend.disturbance = np.array([500.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    drive(backend, np.tile(home(cell), (round(0.2 / DT), 1)))
    backend.disturbance = None
    reached = drive(backend, np.tile(home(cell), (round(1.0 / DT), 1)))
    assert np.abs(reached[-1] - home(cell)).max() < TRACKING


@pytest.mark.parametrize("name", BACKENDS)
def test_the_same_steps_give_the_same_bits(name: str, cell: Cell) -> None:
    works = []
    for _ in range(2):
        backend = make_backend(name, cell, DT, SETTINGS.control)
        backend.set_load(tool(cell))
        backend.reset(home(cell))
        drive(backend, motion(home(cell), 0.3))
        works.append(backend.work())
    assert works[0].speed.tobytes() == works[1].speed.tobytes()
    assert works[0].torque.tobytes() == works[1].torque.tobytes()


@pytest.mark.parametrize("name", BACKENDS)
def test_gravity_is_that_of_the_cell(name: str, cell: Cell) -> None:
    hanging = np.diag([1.0, -1.0, -1.0, 1.0])  # the base upside down
    turned = replace(cell, base_pose=hanging)
    backend = make_backend(name, turned, DT, SETTINGS.control)
    backend.reset(home(cell))
    drive(backend, np.tile(home(cell), (round(0.5 / DT), 1)))
    assert np.abs(held(backend) - holding(turned, ())).max() < TORQUE


def test_an_unknown_backend_is_refused_with_the_known_ones(cell: Cell) -> None:
    with pytest.raises(SettingsError) as refused:
        make_backend("clay", cell, DT, SETTINGS.control)
    assert all(name in str(refused.value) for name in BACKENDS)


def test_motors_that_halt_stop_every_joint(backend: Backend, cell: Cell) -> None:
    """From the middle of a movement: the speed of every joint falls to nothing."""
    commands = motion(home(cell))
    for command in commands[: len(commands) // 2]:
        backend.track(command)
    before = np.abs(backend.qd)
    assert before.max() > 0.1
    steps = 0
    while np.abs(backend.qd).max() > 1e-6:
        backend.halt()
        steps += 1
        assert steps < 2000
        assert (np.abs(backend.qd) <= before + 1e-3).all()
    assert steps > 1
