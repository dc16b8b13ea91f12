"""Joules and limits of the experiments on the paper's claims, by Pinocchio and a DC link written
here.
"""

from __future__ import annotations

from typing import Any

import _paper_cost
import _paper_pairs
import _paper_savings
import _paper_spline
import numpy as np
import pinocchio
import pytest
from _paper_pairs import Pair, pairs
from _pinocchio_arm import pinocchio_arm
from numpy.typing import NDArray

from ir_description import load_power_data
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner

FloatArray = NDArray[np.float64]
SHARE = 0.9  # of the torque envelope that plans may use
TIME_VALUE = 500.0  # W


@pytest.fixture(scope="module")
def drawn() -> list[Pair]:
    return list(pairs(Planner(_paper_pairs.CELL), 4, 21))


def counterbalance(pair: Pair, a2: FloatArray) -> FloatArray:
    data: Any = pair.scene.cell.robot.counterbalance
    x, z = data.rod_eye
    pivot = np.asarray(data.pivot)
    eye = np.stack([x * np.cos(a2) + z * np.sin(a2), z * np.cos(a2) - x * np.sin(a2)], axis=1)
    length = np.linalg.norm(pivot - eye, axis=1)
    gas = data.gas_volume / (
        data.gas_volume - data.piston_area * (length - data.rod_length_at_charge)
    )
    force = data.piston_area * data.charge_pressure * gas**data.exponent / length
    across = eye[:, 1] * (pivot[0] - eye[:, 0]) - eye[:, 0] * (pivot[1] - eye[:, 1])
    return np.asarray(force * across)


def torques(pair: Pair, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
    robot = pair.scene.cell.robot
    model = pinocchio_arm(robot, pair.scene.loads)
    data = model.createData()
    found = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    found += (
        robot.reflected_inertia * qdd
        + robot.friction_viscous * qd
        + robot.friction_coulomb * np.sign(qd)
    )
    found[:, 1] -= counterbalance(pair, q[:, 1])
    return found


def available(pair: Pair, qd: FloatArray) -> FloatArray:
    robot = pair.scene.cell.robot
    found = np.empty_like(qd)
    for j, (speeds, torque) in enumerate(
        zip(robot.envelope_speed, robot.envelope_torque, strict=True)
    ):
        v = np.abs(qd[:, j])
        found[:, j] = np.where(v < speeds[0], torque[0], np.interp(v, speeds, torque[1:]))
    return found


def joules(pair: Pair, trajectory: JointTrajectory, slower: float = 1.0) -> float:
    """From the mains for the drives: what the axes take beyond what the capacitor holds."""
    robot = pair.scene.cell.robot
    link = load_power_data().dc_link
    steps = 800
    dt = trajectory.duration / steps
    motion = trajectory.sample((np.arange(steps) + 0.5) * dt)
    qd = motion.qd / slower
    qdd = motion.qdd / slower**2
    torque = torques(pair, motion.q, qd, qdd)
    power = torque * qd + robot.copper_loss * (torque / robot.gear_ratio) ** 2
    most = 0.5 * link.capacitance * (link.chopper_on**2 - link.voltage**2)
    stored = 0.0
    mains = 0.0
    for taken in power.sum(axis=1) * dt * slower:
        stored -= taken
        mains -= min(stored, 0.0)
        stored = min(max(stored, 0.0), most)
    return mains


@pytest.fixture(scope="module")
def compared(drawn: list[Pair]) -> list[tuple[Pair, int, dict[str, JointTrajectory]]]:
    """The curves whose joules the page compares."""
    found: list[tuple[Pair, int, dict[str, JointTrajectory]]] = []

    def noted(pair: Pair, vias: int, curves: dict[str, JointTrajectory]) -> dict[str, Any]:
        found.append((pair, vias, curves))
        return {}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(_paper_spline, "_row", noted)
        patch.setattr(_paper_spline, "pairs", lambda planner, count, seed: drawn)
        _paper_spline.measure(3, True)
    return found


def test_curves_are_compared_where_the_robot_can_follow_all_of_them(compared: list[Any]) -> None:
    assert sorted({vias for _, vias, _ in compared}) == [0, _paper_spline.VIAS]
    for pair, _, curves in compared:
        robot = pair.scene.cell.robot
        assert len({round(each.duration, 5) for each in curves.values()}) == 1
        for name, each in curves.items():
            motion = each.sample(np.linspace(0.0, each.duration, 301))
            use = np.abs(torques(pair, motion.q, motion.qd, motion.qdd)) / available(
                pair, motion.qd
            )
            assert use.max() < SHARE, name
            assert (np.abs(motion.qd) < 1.001 * robot.velocity_max).all(), name
            assert (np.abs(motion.qdd) < 1.001 * robot.acceleration_max).all(), name


def test_their_joules_are_those_of_another_implementation(compared: list[Any]) -> None:
    for pair, _, curves in compared:
        for name, each in curves.items():
            assert pair.drive_energy(each) == pytest.approx(
                joules(pair, each), rel=0.01, abs=5.0
            ), name


def test_the_common_ptp_beside_least_j_has_its_best_slow_down(drawn: list[Pair]) -> None:
    for pair in drawn:
        fastest = pair.common()
        slowed = pair.common(objective=_paper_savings.ARMS["free, least J"][0])
        assert fastest is not None
        assert slowed is not None
        factors = np.linspace(1.0, 4.0, 31)
        costs = [joules(pair, fastest, k) + TIME_VALUE * k * fastest.duration for k in factors]
        assert joules(pair, slowed) + TIME_VALUE * slowed.duration < 1.01 * min(costs)


def test_readings_of_eq_9_differ_in_the_load_and_in_the_lower_index(drawn: list[Pair]) -> None:
    for pair in drawn:
        robot = pair.scene.cell.robot
        found = _paper_cost._costs(pair)
        moved = np.abs(pair.q1 - pair.q0)
        held = sum(load.mass for load in pair.scene.loads)
        kinetic = 0.5 * robot.link_mass[1:] * robot.velocity_max**2
        load = 0.5 * held * robot.velocity_max[-1] ** 2
        empty = sum(kinetic[i:].sum() * moved[i] for i in range(robot.n))
        assert found[_paper_cost.EMPTY] == pytest.approx(empty)
        assert found["W"] == pytest.approx(empty + load * moved.sum())
        assert found[_paper_cost.PRINTED] == pytest.approx((kinetic.sum() + load) * moved.sum())
