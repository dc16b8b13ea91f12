"""Motors that turn with other joints: dynamics, limits and bounds are those of the motors, by one
definition.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from robots import RobotLiteral, coupled, kr210, power_gradients, random_chain, tool_155

from ir_kernels import DynamicsModel, KernelError
from ir_kernels.coupling import Coupling
from ir_kernels.reference.limits import derivative, evaluate
from ir_values.arrays import FloatArray

CASES = ("kr210", "1", "2", "6", "9")


def robot_of(case: str) -> RobotLiteral:
    bare = kr210() if case == "kr210" else random_chain(np.random.default_rng(3), int(case))
    return coupled(bare, 4)


def batch(seed: int, n: int, N: int = 21) -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, (N, n)), rng.normal(size=(N, n)), 2.0 * rng.normal(size=(N, n))


@pytest.mark.parametrize("case", CASES)
def test_torque_power_and_limit_are_those_of_the_motors(core: Any, case: str) -> None:
    """Held against a robot without drives, whose torques a solve hands on to the motors."""
    robot = robot_of(case)
    T = robot.motor_turns
    none = np.zeros(len(T))
    bare = replace(
        robot,
        motor_turns=None,
        friction_viscous=none,
        friction_coulomb=none,
        reflected_inertia=none,
    )
    loads = (tool_155(),)
    model = DynamicsModel(robot, loads, core=core)
    arm = DynamicsModel(bare, loads, core=core)
    q, qd, qdd = batch(1, model.n)
    w = qd @ T.T
    motors = np.linalg.solve(T.T, arm.inverse_dynamics(q, qd, qdd).T).T
    motors += robot.reflected_inertia * (qdd @ T.T)
    motors += robot.friction_viscous * w + robot.friction_coulomb * np.sign(w)
    found = model.inverse_dynamics(q, qd, qdd)
    size = np.abs(motors).max()
    assert np.abs(found - motors).max() < 1e-11 * size
    assert np.abs(model.inverse_dynamics_single(q, qd, qdd) - motors).max() < 2e-5 * size
    plain = DynamicsModel(replace(robot, motor_turns=None), loads, core=core)
    assert (model.torque_limit(qd) == plain.torque_limit(w)).all()
    assert np.abs(model.axis_power(qd, found) - plain.axis_power(w, found)).max() < 1e-6
    assert np.abs(model.forward_dynamics(q, qd, found) - qdd).max() < 1e-8


@pytest.mark.parametrize("case", CASES)
def test_gradients_are_those_of_differences(core: Any, case: str) -> None:
    model = DynamicsModel(robot_of(case), (tool_155(),), core=core)
    values = dict(zip(("q", "qd", "qdd"), batch(2, model.n), strict=True))
    for function, gradients in (
        (model.inverse_dynamics, model.torque_gradients(**values)),
        (model.drive_power, power_gradients(model, **values)),
    ):
        for name in values:
            exact = getattr(gradients, name)
            for j in range(model.n):
                step = 1e-6 * np.eye(model.n)[j]
                up, down = (function(**{**values, name: values[name] + s * step}) for s in (1, -1))
                error = (up - down) / 2e-6 - exact[:, :, j]
                assert np.abs(error).max() < 1e-6 * np.abs(exact).max() + 1e-3


@pytest.mark.sampled
@pytest.mark.parametrize("case", ["kr210", "2", "6"])
def test_no_torque_or_power_is_above_its_bound(core: Any, case: str) -> None:
    model = DynamicsModel(robot_of(case), (tool_155(),), core=core)
    rng = np.random.default_rng(5)
    c = rng.normal(size=(3, model.n, 6)) * np.array([1.0, 1.0, 1.0, 0.6, 0.4, 0.2])
    c[1, 0, 1:] = 0.0  # one joint rests
    T = rng.uniform(0.04, 0.1, 3)
    torque = model.torque_bounds(c, T)
    power = model.power_bounds(c, T, 2e-3)
    most = np.zeros(model.n)
    net = []
    for segment, duration in zip(c, T, strict=True):
        samples = []
        p = segment
        t = np.broadcast_to((np.arange(400) + 0.5) / 400 * duration, (model.n, 400))
        for _ in range(3):
            samples.append(np.ascontiguousarray(evaluate(p, t).T))
            p = derivative(p)
        q, qd, qdd = samples
        needed = model.inverse_dynamics(q, qd, qdd)
        most = np.maximum(most, (np.abs(needed) / model.torque_limit(qd)).max(axis=0))
        net.append(model.axis_power(qd, needed).sum(axis=1).max())
    assert (most <= torque.upper).all()
    assert (torque.upper <= torque.sampled + 0.02 * np.maximum(torque.sampled, 1.0)).all()
    assert (torque.sampled <= 1.001 * most + 0.05).all()
    pieces = np.repeat(np.arange(3), np.ceil(T / 2e-3).astype(int))
    for k, largest in enumerate(net):
        assert largest <= power.net[pieces == k].max() <= largest + 0.05 * abs(largest) + 50.0


def test_a_motor_that_turns_with_a_moving_joint_does_not_rest(core: Any) -> None:
    turns = np.eye(6)
    turns[5, 4] = 1.0
    model = DynamicsModel(replace(kr210(), motor_turns=turns), core=core)
    c = np.zeros((1, 6, 2))
    c[0, :, 0] = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
    c[0, 4, 1] = 0.3  # joint 5 alone
    speed = np.ascontiguousarray(c[:, :, 1])
    found = model.torque_bounds(c, np.array([1.0])).upper * model.torque_limit(speed)[0]
    friction = model.data.coulomb[5] + 0.3 * model.data.viscous[5]
    assert found[5] > 0.99 * friction


def test_without_a_coupling_every_answer_is_the_same_to_the_last_bit(core: Any) -> None:
    told = DynamicsModel(replace(kr210(), motor_turns=np.eye(6)), (tool_155(),), core=core)
    plain = DynamicsModel(kr210(), (tool_155(),), core=core)
    motion = batch(6, 6)
    assert (told.drive_power(*motion) == plain.drive_power(*motion)).all()
    assert not told.coupling.coupled


@pytest.mark.parametrize("n", [1, 3, 6])
def test_a_coupling_keeps_power_and_comes_back(n: int) -> None:
    coupling = Coupling(robot_of(str(n)).motor_turns)
    speed, torque, _ = batch(7, n)
    assert coupling.joints(coupling.motors(speed)) == pytest.approx(speed)
    assert coupling.joint_torque(coupling.motor_torque(torque)) == pytest.approx(torque)
    power = (coupling.motors(speed) * coupling.motor_torque(torque)).sum(axis=1)
    assert power == pytest.approx((speed * torque).sum(axis=1))
    assert (np.abs(coupling.motors(speed)) <= coupling.most(np.abs(speed)) + 1e-12).all()


def test_motors_that_do_not_determine_the_joints_are_refused() -> None:
    with pytest.raises(KernelError, match="singular"):
        DynamicsModel(replace(kr210(), motor_turns=np.ones((6, 6))))
