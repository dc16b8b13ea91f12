"""Dynamics: the checks of the machine data, laws that hold for every robot, agreement with
Pinocchio.
"""

from typing import Any

import numpy as np
import pinocchio
import pytest
from builds import slow_reference
from robots import (
    LoadLiteral,
    RobotLiteral,
    kr210,
    power_gradients,
    random_chain,
    random_rotation,
    tool_155,
)

from ir_kernels import Chain, DynamicsModel, KernelError
from ir_kernels.reference import dynamics as reference
from ir_values.arrays import FloatArray

HOME = np.radians([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0]])
AGREEMENT = 1e-9  # relative to the largest torque of the batch: sums of a few hundred roundings
FITTED = 1e-11  # the compiled core evaluates the counterbalance by a fitted polynomial


def batch(seed: int, n: int, N: int = 40) -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, (N, n)), rng.normal(size=(N, n)), 2.0 * rng.normal(size=(N, n))


def tilted(seed: int) -> FloatArray:
    pose = np.eye(4)
    pose[:3, :3] = random_rotation(np.random.default_rng(seed))
    return pose


def relative(a: FloatArray, b: FloatArray) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())


@pytest.mark.parametrize(
    ("loads", "joint", "torque"),
    [((), 1, 991.0), ((), 2, 991.0), ((tool_155(),), 1, 3506.0), ((tool_155(),), 4, 692.0)],
)
def test_gravity_at_machine_home_is_that_of_the_machine_data(
    core: Any, loads: tuple[LoadLiteral, ...], joint: int, torque: float
) -> None:
    holding = DynamicsModel(kr210(), loads, core=core).gravity(HOME)[0]
    assert holding[joint] == pytest.approx(
        -torque, abs=1.0
    )  # the data are rounded to 1 Nm; A2 is lifted by -


@pytest.mark.parametrize(
    ("angle_deg", "torque"),
    [
        (-140, 5116),
        (-120, 3254),
        (-90, -234),
        (-60, -3650),
        (-45, -5023),
        (-30, -6088),
        (-5, -7081),
    ],
)
def test_counterbalance_gives_the_table_of_the_machine_data(
    core: Any, angle_deg: float, torque: float
) -> None:
    q = np.radians([[0.0, angle_deg, 0.0, 0.0, 0.0, 0.0]])
    about = DynamicsModel(kr210(), core=core).counterbalance(q)[0]
    assert about[1] == pytest.approx(torque, abs=0.5)
    assert (np.delete(about, 1) == 0.0).all()


def pinocchio_model(
    robot: RobotLiteral, loads: tuple[LoadLiteral, ...], base: FloatArray
) -> pinocchio.Model:
    model = pinocchio.Model()
    model.gravity.linear = base[:3, :3].T @ np.array([0.0, 0.0, -9.80665])
    parent = 0
    for i, (origin, axis) in enumerate(zip(robot.joint_origin, robot.joint_axis, strict=True)):
        placement = pinocchio.SE3(origin[:3, :3], origin[:3, 3])
        parent = model.addJoint(
            parent, pinocchio.JointModelRevoluteUnaligned(axis), placement, f"joint_{i}"
        )
        own = pinocchio.Inertia(
            robot.link_mass[i + 1], robot.link_com[i + 1], robot.link_inertia[i + 1]
        )
        model.appendBodyToJoint(parent, own, pinocchio.SE3.Identity())
    for load in loads:
        inertia = pinocchio.Inertia(load.mass, load.com, load.inertia)
        model.appendBodyToJoint(parent, inertia, pinocchio.SE3.Identity())
    return model


@pytest.mark.parametrize(
    "case", ["kr210", "kr210 with tool", "tilted kr210", "random 1", "random 3", "random 7"]
)
def test_arm_agrees_with_pinocchio(core: Any, case: str) -> None:
    loads = (tool_155(),) if "tool" in case else ()
    base = tilted(5) if "kr210" not in case or "tilted" in case else np.eye(4)
    robot = (
        kr210() if "kr210" in case else random_chain(np.random.default_rng(7), int(case.split()[1]))
    )
    model = DynamicsModel(robot, loads, base, core=core)
    q, qd, qdd = batch(1, model.n)
    peer = pinocchio_model(robot, loads, base)
    data = peer.createData()
    rnea = np.array(
        [pinocchio.rnea(peer, data, *sample) for sample in zip(q, qd, qdd, strict=True)]
    )
    motors = (
        robot.reflected_inertia * qdd
        + robot.friction_viscous * qd
        + robot.friction_coulomb * np.sign(qd)
    )
    arm = model.inverse_dynamics(q, qd, qdd) - motors + model.counterbalance(q)
    assert relative(arm, rnea) < AGREEMENT
    crba = np.array([pinocchio.crba(peer, data, sample) for sample in q])
    crba = np.triu(crba) + np.swapaxes(np.triu(crba, 1), 1, 2)
    assert relative(model.mass_matrix(q), crba) < AGREEMENT
    bias = np.array(
        [pinocchio.nonLinearEffects(peer, data, *sample) for sample in zip(q, qd, strict=True)]
    )
    assert relative(model.bias(q, qd), bias) < AGREEMENT


def test_compiled_core_agrees_with_the_reference(core: Any) -> None:
    model = DynamicsModel(kr210(), (tool_155(),), tilted(2), core=core)
    q, qd, qdd = batch(3, 6, 37)  # not a multiple of any number of lanes
    data = model.data
    assert (
        relative(model.inverse_dynamics(q, qd, qdd), reference.inverse_dynamics(data, q, qd, qdd))
        < FITTED
    )
    assert relative(model.counterbalance(q), reference.counterbalance(data, q)) < FITTED
    assert relative(model.axis_power(qd, qdd), reference.axis_power(data, qd, qdd)) < 1e-14
    assert relative(model.torque_limit(4.0 * qd), reference.torque_limit(data, 4.0 * qd)) < 1e-14
    tau = 1000.0 * qdd
    forward = reference.forward_dynamics(data, q, qd, tau)
    assert relative(model.forward_dynamics(q, qd, tau), forward) < FITTED


def test_single_precision_agrees_to_five_digits(core: Any) -> None:
    model = DynamicsModel(kr210(), (tool_155(),), core=core)
    q, qd, qdd = batch(4, 6, 1000)
    single = model.inverse_dynamics_single(q, qd, qdd)
    assert relative(single, model.inverse_dynamics(q, qd, qdd)) < 1e-5


def test_every_sample_is_on_its_own(core: Any) -> None:
    model = DynamicsModel(kr210(), core=core)
    q, qd, qdd = batch(5, 6, 21)
    together = model.inverse_dynamics(q, qd, qdd)
    alone = np.array(
        [model.inverse_dynamics(*(x[k : k + 1] for x in (q, qd, qdd)))[0] for k in range(21)]
    )
    assert (together == alone).all()


def test_forward_dynamics_undoes_inverse_dynamics(core: Any) -> None:
    for robot in (kr210(), random_chain(np.random.default_rng(1), 8)):
        model = DynamicsModel(robot, core=core)
        q, qd, qdd = batch(6, model.n)
        again = model.forward_dynamics(q, qd, model.inverse_dynamics(q, qd, qdd))
        assert np.abs(again - qdd).max() < 1e-9


def test_lagrange_form_equals_newton_euler(core: Any) -> None:
    """Eq. 8: d/dt dL/dqd - dL/dq with L = qd' H qd / 2 - V, by differences of the energies."""
    robot = kr210()
    model = DynamicsModel(robot, (tool_155(),), core=core)
    chain = Chain(robot)
    q, qd, qdd = batch(7, 6, 5)

    def potential(x: FloatArray) -> FloatArray:
        links = chain.link_poses(x)[:, 1:]
        mass = np.array(model.data.mass)
        com = np.array(model.data.com)
        height = np.einsum("nij,ij->ni", links[:, :, 2, :3], com) + links[:, :, 2, 3]
        return np.asarray(9.80665 * height @ mass)

    def kinetic(x: FloatArray) -> FloatArray:
        return np.asarray(0.5 * np.einsum("ni,nij,nj->n", qd, model.mass_matrix(x), qd))

    eps = 1e-5
    H_dot = (model.mass_matrix(q + eps * qd) - model.mass_matrix(q - eps * qd)) / (2.0 * eps)
    lagrange = np.einsum("nij,nj->ni", model.mass_matrix(q), qdd) + np.einsum(
        "nij,nj->ni", H_dot, qd
    )
    for j in range(6):
        step = np.zeros(6)
        step[j] = eps
        up, down = (kinetic(x) - potential(x) for x in (q + step, q - step))
        lagrange[:, j] -= (up - down) / (2.0 * eps)
    arm = np.einsum("nij,nj->ni", model.mass_matrix(q), qdd) + model.bias(q, qd)
    assert relative(lagrange, arm) < 1e-7  # of the central differences


@slow_reference
def test_free_motion_without_friction_keeps_its_energy(core: Any) -> None:
    """Energy of arm, rotors and gas is constant when no motor works (fourth-order Runge-Kutta, 0.5
    s).
    """
    robot = kr210()
    still = type(robot)(
        **{
            **vars(robot),
            "friction_viscous": np.zeros(6),
            "friction_coulomb": np.zeros(6),
            "counterbalance": None,
        }
    )
    model = DynamicsModel(still, (tool_155(),), core=core)
    chain = Chain(still)
    zero = np.zeros((1, 6))

    def energy(q: FloatArray, qd: FloatArray) -> float:
        inertia = model.mass_matrix(q)[0] + np.diag(robot.reflected_inertia)
        links = chain.link_poses(q)[0, 1:]
        height = np.einsum("ij,ij->i", links[:, 2, :3], np.array(model.data.com)) + links[:, 2, 3]
        return float(0.5 * qd[0] @ inertia @ qd[0] + 9.80665 * np.array(model.data.mass) @ height)

    q = HOME.copy()
    qd = np.array([[0.5, 0.3, -0.4, 1.0, 0.6, -1.0]])
    dt = 0.005
    before = energy(q, qd)
    for _ in range(100):
        v1 = qd
        a1 = model.forward_dynamics(q, qd, zero)
        v2 = qd + 0.5 * dt * a1
        a2 = model.forward_dynamics(q + 0.5 * dt * v1, qd + 0.5 * dt * a1, zero)
        v3 = qd + 0.5 * dt * a2
        a3 = model.forward_dynamics(q + 0.5 * dt * v2, qd + 0.5 * dt * a2, zero)
        v4 = qd + dt * a3
        a4 = model.forward_dynamics(q + dt * v3, qd + dt * a3, zero)
        q = q + dt / 6 * (v1 + 2 * v2 + 2 * v3 + v4)
        qd = qd + dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    assert np.abs(q - HOME).max() > 0.1
    assert energy(q, qd) == pytest.approx(
        before, abs=1e-3
    )  # J, of some 10 kJ: error of the integration


@pytest.mark.parametrize("of", ["torque", "power"])
def test_gradients_agree_with_finite_differences(core: Any, of: str) -> None:
    model = DynamicsModel(kr210(), (tool_155(),), core=core)
    names = ("q", "qd", "qdd")
    values = dict(zip(names, batch(8, 6, 20), strict=True))
    function = model.inverse_dynamics if of == "torque" else model.drive_power
    gradients = (
        model.torque_gradients(**values) if of == "torque" else power_gradients(model, **values)
    )
    eps = 1e-6
    for name in names:
        exact = getattr(gradients, name)
        for j in range(6):
            step = np.zeros(6)
            step[j] = eps
            up = function(**{**values, name: values[name] + step})
            down = function(**{**values, name: values[name] - step})
            difference = (up - down) / (2.0 * eps)
            assert np.abs(difference - exact[:, :, j]).max() < 1e-6 * np.abs(exact).max() + 1e-3, (
                name,
                j,
            )


def test_a_load_is_a_part_of_the_last_link(core: Any) -> None:
    """Two halves weigh what the whole does, and a load without mass nothing."""
    whole = tool_155()
    half = LoadLiteral("half", 77.5, whole.com, whole.inertia / 2.0)
    nothing = LoadLiteral("nothing", 0.0, whole.com, 0.0 * whole.inertia)
    q, qd, qdd = batch(9, 6)
    one = DynamicsModel(kr210(), (whole,), core=core).inverse_dynamics(q, qd, qdd)
    two = DynamicsModel(kr210(), (half, nothing, half), core=core).inverse_dynamics(q, qd, qdd)
    assert relative(two, one) < 1e-12


def test_torque_limit_steps_down_then_falls_linearly() -> None:
    model = DynamicsModel(kr210())
    speeds = np.zeros((6, 6))
    speeds[:, 0] = [0.0, 1.329, 1.33, -1.57, 2.16, 9.0]
    assert model.torque_limit(speeds)[:, 0] == pytest.approx(
        [7228.023, 7228.023, 5988, 5245.5, 1215, 1215]
    )


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (np.zeros((3, 5)), r"qd has shape \(3, 5\)"),
        (np.zeros((4, 6)), "different length"),
        (np.zeros((3, 12))[:, ::2], "qd is not C-contiguous"),
        (np.zeros((0, 6)), "qd is empty"),
        (np.full((3, 6), np.nan), r"qd\[0, 0\] is nan"),
        (np.array([[0.0] * 6, [0.0] * 6, [np.inf] + [0.0] * 5]), r"qd\[2, 0\] is inf"),
        (np.zeros((3, 6), complex), "qd has dtype complex128"),
        ([["a"] * 6] * 3, "qd has dtype"),
    ],
)
def test_a_bad_array_is_named(core: Any, bad: Any, message: str) -> None:
    model = DynamicsModel(kr210(), core=core)
    good = np.zeros((3, 6))
    with pytest.raises(KernelError, match=message):
        model.inverse_dynamics(good, bad, good)


def test_negative_mass_and_impossible_counterbalance_are_refused() -> None:
    with pytest.raises(KernelError, match="'tool' has a mass of -1"):
        DynamicsModel(kr210(), (LoadLiteral("tool", -1.0, np.zeros(3), np.eye(3)),))
    robot = kr210()
    tiny = type(robot.counterbalance)(gas_volume=1e-4)
    with pytest.raises(KernelError, match="no volume for the gas"):
        DynamicsModel(type(robot)(**{**vars(robot), "counterbalance": tiny}))
