"""PyBullet's kinematics and dynamics against the project's own: two implementations, one robot."""

from __future__ import annotations

import gc
from dataclasses import replace

import numpy as np
import pybullet
import pytest
from scipy.spatial.transform import Rotation

from ir_description import Load, load_power_data
from ir_kernels.chain import Chain
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.modes import Mode
from ir_sim_driver.controller.settings import ControllerSettings
from ir_sim_driver.controller.simulation import make_simulation
from ir_sim_driver.plant import nominal_plant, typical_plant
from ir_sim_driver.plant.drivetrain import Drivetrain, Gears
from ir_sim_driver.plant.ideal_backend import IdealBackend
from ir_sim_driver.plant.pybullet_backend import BulletArm

POSITION_TOLERANCE = 1e-9  # m; the centre-of-mass frame is double precision in Bullet
TORQUE_TOLERANCE = 1e-6  # Nm; sums of a few thousand Nm in another order


def configurations(robot, count, seed=1):
    generator = np.random.default_rng(seed)
    return generator.uniform(robot.position_min, robot.position_max, (count, 6))


@pytest.fixture(scope="module")
def backend(make):
    return make("pybullet").backend


def test_centres_of_mass_are_where_the_chain_puts_them(backend, cell):
    robot = cell.robot
    chain = Chain(robot, cell.base_pose, cell.tcp)
    for q in configurations(robot, 20):
        backend.reset(q)
        poses = chain.link_poses(q[None])[0]
        for link in range(1, 7):
            position = backend.link_com_position(link)
            com = robot.link_com[link]
            if link == 6:  # one body with its load
                m = robot.link_mass[link]
                tool = cell.tool
                com = (m * com + tool.mass * tool.com) / (m + tool.mass)
            expected = poses[link] @ np.append(com, 1.0)
            assert np.abs(position - expected[:3]).max() < POSITION_TOLERANCE


def test_bias_and_mass_matrix_agree_with_the_kernels(backend, make, cell):
    dynamics = make("ideal").dynamics
    for q in configurations(cell.robot, 20, seed=2):
        backend.reset(q)
        assert (
            np.abs(backend.bias() - dynamics.bias(q[None], np.zeros((1, 6)))[0]).max()
            < TORQUE_TOLERANCE
        )
        H = dynamics.mass_matrix(q[None])[0]
        assert np.abs(backend.mass_matrix() - H).max() < 1e-9 * np.abs(H).max()


def test_a_tilted_base_turns_gravity(cell, make):
    tilted = np.eye(4)
    tilted[:3, :3] = Rotation.from_euler("xyz", [0.3, -0.5, 0.7]).as_matrix()
    tilted[:3, 3] = [0.4, -1.0, 0.2]
    simulation = make_simulation(replace(cell, base_pose=tilted), backend="pybullet")
    q = simulation.backend.q[None]
    assert (
        np.abs(simulation.backend.bias() - simulation.dynamics.gravity(q)[0]).max()
        < TORQUE_TOLERANCE
    )
    position = simulation.backend.link_com_position(5)
    pose = Chain(cell.robot, tilted).link_poses(q)[0, 5]
    assert (
        np.abs(position - (pose @ np.append(cell.robot.link_com[5], 1.0))[:3]).max()
        < POSITION_TOLERANCE
    )


def test_a_lopsided_load_reaches_the_joints(cell, make):
    simulation = make("pybullet")
    inertia = np.array([[4.0, 0.5, -0.3], [0.5, 6.0, 0.2], [-0.3, 0.2, 5.0]])
    load = Load("lopsided", "tool", 90.0, np.array([0.2, 0.05, -0.1]), inertia)
    simulation.backend.set_load((load, cell.tool))
    dynamics = DynamicsModel(cell.robot, (load, cell.tool), cell.base_pose)
    for q in configurations(cell.robot, 5, seed=3):
        simulation.backend.reset(q)
        expected = dynamics.mass_matrix(q[None])[0]
        assert np.allclose(simulation.backend.mass_matrix(), expected, atol=1e-6)
        assert np.allclose(
            simulation.backend.bias(), dynamics.gravity(q[None])[0], atol=TORQUE_TOLERANCE
        )


def test_counterbalance_has_the_published_torques(cell):
    published = {-140: 5116, -120: 3254, -90: -234, -60: -3650, -45: -5023, -30: -6088, -5: -7081}
    drives = Drivetrain(cell.robot)
    for degrees, torque in published.items():
        assert drives.counterbalance_torque(np.radians(degrees)) == pytest.approx(torque, abs=1.0)


def test_envelope_and_friction_are_those_of_the_kernels(cell, make):
    drives = Drivetrain(cell.robot)
    dynamics = make("ideal").dynamics
    generator = np.random.default_rng(4)
    qd = generator.uniform(-1.0, 1.0, (50, 6)) * 1.1 * cell.robot.velocity_max
    assert np.allclose([drives.limit(v) for v in qd], dynamics.torque_limit(qd))
    q = configurations(cell.robot, 50, seed=5)
    still = np.zeros_like(q)
    resistance = dynamics.inverse_dynamics(q, qd, still) - dynamics.bias(q, qd)
    fast = np.abs(qd).min(axis=1) > 0.01  # friction is smoothed around rest only
    gears = Gears(nominal_plant(cell.robot, load_power_data()).gears, 0.001)
    dry = gears.dry([0.0] * 6, [0.0] * 6)
    mine = np.array(
        [
            np.subtract(gears.friction(b.tolist(), dry)[0], drives.counterbalance(a.tolist()))
            for a, b in zip(q, qd, strict=True)
        ]
    )
    assert np.allclose(mine[fast], resistance[fast], atol=1e-6)


@pytest.mark.sampled
@pytest.mark.parametrize("backend_name", ["pybullet", "ideal"])
@pytest.mark.parametrize(("load", "payload"), [("cell", 155.0), ("none", 0.0)])
@pytest.mark.parametrize(
    "mode", ["STAND_ON_MOTORS", "STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION"]
)
def test_table_2_at_machine_home(make, backend_name, load, payload, mode):
    simulation = make(backend_name, load, controller=ControllerSettings(start_mode=mode))
    simulation.plc.rest = Mode[mode] if mode in ("BUS_POWER_OFF", "HIBERNATION") else None
    simulation.run(0.1)
    before = simulation.mains.meter.reading()
    simulation.run(0.5)
    after = simulation.mains.meter.reading()
    watts = (after.energy - before.energy) / (after.time - before.time)
    assert watts == pytest.approx(load_power_data().measured(payload, mode), rel=0.001)
    assert simulation.standing_power(Mode[mode]) == pytest.approx(
        watts, rel=1e-4
    )  # encoders have steps


def test_a_movement_with_155_kg_is_tracked_and_costs_what_the_model_says(
    make, plan, start, run_out, cell
):
    q0 = np.array(cell.machine_home)
    there = plan(2.5, q0, q0 + np.array([1.2, 0.4, -0.4, 0.8, -0.5, 1.0]))
    energies = {}
    for name in ("pybullet", "ideal"):
        simulation = make(name)
        start(simulation, there)
        outcome = run_out(simulation)
        assert outcome.code == 0
        assert outcome.max_tool_deviation < 0.001
        energies[name] = outcome.energy
    assert energies["pybullet"] == pytest.approx(energies["ideal"], rel=0.002)


def test_a_torque_beyond_the_envelope_is_cut_and_the_tool_leaves_its_path(make, cell):
    simulation = make("pybullet")
    q0 = np.array(cell.machine_home)
    step = (
        0.02 * np.sin(np.linspace(0.0, np.pi, 30)) ** 2
    )  # 30 ms: far beyond what the motors can do
    for offset in step:
        simulation.backend.track(q0 + offset)
    work = simulation.backend.work()
    limits = np.array([Drivetrain(cell.robot).limit(v) for v in work.speed])
    assert (np.abs(work.torque) <= limits * 1.001 + 1e-9).all()
    assert (np.abs(work.torque) >= limits * 0.99).any()


def test_a_disturbance_pushes_the_robot_and_the_loop_holds_it(make):
    simulation = make("pybullet")
    simulation.run(0.1)
    q = simulation.backend.q.copy()
    simulation.disturb(np.array([800.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    pushed = []
    for _ in range(1000):
        simulation.step()
        pushed.append(simulation.backend.q[0] - q[0])
    assert 1e-5 < max(pushed) < 1e-3
    assert abs(pushed[-1]) < 1e-6  # the integral part has found the torque
    simulation.disturb(None)
    simulation.run(1.0)
    assert abs(simulation.backend.q[0] - q[0]) < 1e-6


def test_ideal_torques_of_a_batch_equal_those_of_single_steps(cell):
    batch, single = (IdealBackend(cell.robot, 0.001) for _ in range(2))
    q = np.array(cell.machine_home)
    torques = []
    for k in range(20):
        for backend in (batch, single):
            backend.track(q + 1e-6 * k**2)
        torques.append(single.torque.copy())
    assert np.allclose(batch.work().torque, torques)
    assert np.allclose(single.work().torque, torques)


def test_bullet_computes_with_every_plant_and_load_and_prints_nothing(cell, capfd):
    data = load_power_data()
    generator = np.random.default_rng(7)
    home = np.array(cell.machine_home)
    for seed in range(30):
        plant = typical_plant(cell.robot, data, seed)
        spread = generator.normal(size=(3, 3))
        inertia = np.sum(spread**2) * np.eye(3) - spread @ spread.T  # of three points of 1 kg
        load = Load(
            "lopsided", "tool", 40.0 * generator.random(), generator.normal(size=3), inertia
        )
        arm = BulletArm(plant.robot, 0.001, np.eye(4))
        arm.carry((load,), home.tolist())
        H = DynamicsModel(plant.robot, (load,)).mass_matrix(home[None])[0]
        assert np.abs(arm.mass_matrix(home.tolist()) - H).max() < 1e-9 * np.abs(H).max(), seed
        arm.close()
    assert capfd.readouterr() == ("", "")


def test_an_arm_that_is_not_used_any_more_lets_its_server_go(cell):
    """PyBullet has a thousand of them, of 30 MB each."""

    def servers():
        return sum(bool(pybullet.isConnected(client)) for client in range(1024))

    gc.collect()
    before = servers()
    for _ in range(3):
        arm = BulletArm(cell.robot, 0.001, np.eye(4))
        for _ in range(2):  # it gets another server
            arm.carry((), [0.0] * 6)
            assert servers() == before + 1
        del arm
        gc.collect()
        assert servers() == before
