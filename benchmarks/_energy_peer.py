"""Least drive energy at a fixed duration by CasADi and IPOPT: a direct transcription beside the
planner.

Jerk is constant in each of MESH intervals, so that the answer is exactly a trajectory of the
project's interpolant. Torque is the symbolic recursive Newton-Euler of the tests' reference plus
rotors, friction and the gas spring; the DC link is exact: mains, dissipated and stored energy are
variables of every step, and the least mains energy uses the capacitor as the bus does. One thing is
smoothed: sign(qd) of Coulomb friction and the step of the torque envelope, over SMOOTHING rad/s.
Obstacles are left out: what collides is dropped.
"""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from ir_kernels.reference.dynamics import counterbalance_torque, rigid_body_torque
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

MESH = 60  # intervals
SMOOTHING = 0.01  # rad/s
# of the envelope that the planner's reserve of torque leaves, at the points of the mesh: between
# them it may be a little more
TORQUE_SHARE = 0.975
ITERATIONS = 250
SPREAD = 0.35  # rad: standard deviation of the bump that makes one start differ from another
_GAUSS = (0.5 - np.sqrt(3.0) / 6.0, 0.5 + np.sqrt(3.0) / 6.0)  # two points per interval
_KILO = 1e-3  # powers in kW and energies in kJ: numbers near 1
_JERK_WEIGHT = 1e-7  # makes the least energy unique; far below a joule
_OPTIONS: dict[str, Any] = {
    "ipopt": {
        "max_iter": ITERATIONS,
        "print_level": 0,
        "sb": "yes",
        "tol": 1e-5,  # of energies in kJ
        "acceptable_tol": 1e-4,
        "acceptable_iter": 5,
    },
    "print_time": False,
    "expand": True,  # scalar expressions: each evaluation is ten times as fast
}


class EnergyPeer:
    """The problem of one scene, built once; its duration and ends are parameters.

    energy: what the last solution costs by the problem itself [J].
    """

    def __init__(self, scene: PlanningScene) -> None:
        self._scene = scene
        self._n = scene.cell.robot.n
        self._power = self._power_function()
        self._solver, self._bounds = self._problem()
        self.energy = float("nan")

    def solve(
        self, q0: FloatArray, q1: FloatArray, duration: float, seed: int
    ) -> JointTrajectory | None:
        """A local minimum from q0 to q1 (n,) in `duration` [s]; None where IPOPT finds none. Seed 0
        starts from the straight movement.
        """
        guess = self._guess(q0, q1, duration, seed)
        given = np.concatenate([q0, q1, [duration]])
        found = self._solver(x0=guess, p=given, **self._bounds)
        if not self._solver.stats()["success"]:
            return None
        self.energy = float(found["f"]) / _KILO
        states = (
            np.array(found["x"]).ravel()[: 3 * self._n * (MESH + 1)].reshape(MESH + 1, 3, self._n)
        )
        q, qd, qdd = (states[:, k].copy() for k in range(3))
        q[0] = q0
        q[-1] = q1
        qd[[0, -1]] = 0.0
        qdd[[0, -1]] = 0.0
        times = np.linspace(0.0, duration, MESH + 1)
        return JointTrajectory.from_seconds(self._scene.cell.robot.joint_names, times, q, qd, qdd)

    def _guess(self, q0: FloatArray, q1: FloatArray, duration: float, seed: int) -> FloatArray:
        u = np.linspace(0.0, 1.0, MESH + 1)[:, None]
        bump = (
            np.zeros(self._n)
            if seed == 0
            else np.random.default_rng(seed).normal(0.0, SPREAD, self._n)
        )
        q = q0 + (10 * u**3 - 15 * u**4 + 6 * u**5) * (q1 - q0) + 64 * (u * (1 - u)) ** 3 * bump
        robot = self._scene.cell.robot
        q = np.clip(q, robot.position_min + 1e-3, robot.position_max - 1e-3)
        h = duration / MESH
        qd = np.gradient(q, h, axis=0)
        qdd = np.gradient(qd, h, axis=0)
        states = np.stack([q, qd, qdd], axis=1).ravel()
        jerk = (np.diff(qdd, axis=0) / h).ravel()
        wanted = _KILO * np.array(self._power.map(MESH)(q[:-1].T, qd[:-1].T, qdd[:-1].T)[0]).ravel()
        level = np.full(MESH, 0.5 * _KILO * self._scene.power.dc_link_capacity_energy)
        bus = np.stack(
            [np.maximum(wanted, 0.0) + 0.1, np.maximum(-wanted, 0.0) + 0.1, level], axis=1
        )
        return np.concatenate([states, jerk, np.repeat(bus, 2, axis=0).ravel()])

    def _power_function(self) -> Any:
        """(q, qd, qdd) -> what the axes take together [W], and shares of torque (2n,), up and
        down.
        """
        n = self._n
        data = self._scene.dynamics.data
        robot = self._scene.cell.robot
        q, qd, qdd = (ca.SX.sym(name, n) for name in ("q", "qd", "qdd"))
        sin = [ca.sin(q[i]) for i in range(n)]
        cos = [ca.cos(q[i]) for i in range(n)]
        tau = rigid_body_torque(
            data, sin, cos, [qd[i] for i in range(n)], [qdd[i] for i in range(n)]
        )
        power = 0.0
        use = []
        for i in range(n):
            speed = ca.sqrt(qd[i] ** 2 + SMOOTHING**2)
            drive = data.rotor_inertia[i] * qdd[i] + data.viscous[i] * qd[i]
            torque = tau[i] + drive + data.coulomb[i] * qd[i] / speed
            spring = data.counterbalance
            if spring is not None and spring.joint == i:
                torque = torque - counterbalance_torque(spring, sin[i], cos[i], ca.sqrt, ca.power)
            power += torque * qd[i] + robot.copper_loss[i] * (torque / robot.gear_ratio[i]) ** 2
            unsure = (
                data.coulomb[i] * (SMOOTHING / speed) ** 2
            )  # sign(qd) is more than its smoothed value
            limit = self._envelope(i, speed)
            use += [(torque + unsure) / limit, (unsure - torque) / limit]
        return ca.Function("power", [q, qd, qdd], [power, ca.vertcat(*use)])

    def _envelope(self, joint: int, speed: Any) -> Any:
        """Torque that a joint has at a speed; the step at the first speed is smoothed."""
        data = self._scene.dynamics.data
        knots = data.envelope_speed[joint]
        torques = data.envelope_torque[joint]
        slopes = np.diff(torques[1:]) / np.diff(knots)
        limit = torques[1]
        for k, slope in enumerate(slopes):
            inside = ca.fmin(ca.fmax(speed - knots[k], 0.0), knots[k + 1] - knots[k])
            limit = limit + slope * inside
        step = torques[0] - torques[1]
        return limit + 0.5 * step * (1.0 + ca.tanh((knots[0] - speed) / SMOOTHING))

    def _problem(self) -> tuple[Any, dict[str, Any]]:
        """The solver and the bounds of its variables and constraints."""
        n = self._n
        X = ca.MX.sym("X", 3 * n, MESH + 1)
        U = ca.MX.sym("U", n, MESH)
        bus = ca.MX.sym("bus", 3, 2 * MESH)  # mains [kW], dissipated [kW], stored [kJ]
        p = ca.MX.sym("p", 2 * n + 1)
        h = p[2 * n] / MESH
        power, uses = self._along(X, U, h)
        before = ca.horzcat(0.0, bus[2, :-1])
        balance = _KILO * power - bus[0, :] + bus[1, :] - (before - bus[2, :]) / (h / 2)
        ends = ca.vertcat(X[:n, 0] - p[:n], X[:n, -1] - p[n : 2 * n], X[n:, 0], X[n:, -1])
        following = X[:, 1:] - ca.vertcat(*_moved(X[:, :-1], U, h))
        equal = ca.vertcat(ca.vec(following), balance.T, ends)
        energy = ca.sum2(bus[0, :]) * h / 2
        smooth = h * ca.sumsqr(U / ca.DM(self._scene.limits.jerk))
        problem = {
            "x": ca.vertcat(ca.vec(X), ca.vec(U), ca.vec(bus)),
            "p": p,
            "f": energy + _JERK_WEIGHT * smooth,
            "g": ca.vertcat(equal, uses),
        }
        left = TORQUE_SHARE * (1.0 - self._scene.limits.torque_reserve)
        zeros = np.zeros(int(equal.numel()))
        share = np.full(int(uses.numel()), left)
        bounds = {
            "lbg": np.concatenate([zeros, -np.inf * share]),
            "ubg": np.concatenate([zeros, share]),
        }
        return ca.nlpsol("peer", "ipopt", problem, _OPTIONS), self._box() | bounds

    def _along(self, X: Any, U: Any, h: Any) -> tuple[Any, Any]:
        """Power (1, 2 MESH) W of all axes at the points of the mesh, and use of torque there and
        where the jerk changes, one long column.
        """
        n = self._n
        _, use = self._power.map(MESH - 1)(X[:n, 1:-1], X[n : 2 * n, 1:-1], X[2 * n :, 1:-1])
        powers = []
        uses = [ca.vec(use)]
        for point in _GAUSS:
            power, use = self._power.map(MESH)(*_moved(X[:, :-1], U, point * h))
            powers.append(power)
            uses.append(ca.vec(use))
        return ca.reshape(ca.vertcat(*powers), 1, 2 * MESH), ca.vertcat(*uses)

    def _box(self) -> dict[str, FloatArray]:
        """Limits of position, speed, acceleration and jerk, and of the bus."""
        robot = self._scene.cell.robot
        limits = self._scene.limits
        highest = np.concatenate([robot.position_max, limits.velocity, limits.acceleration])
        lowest = np.concatenate([robot.position_min, -limits.velocity, -limits.acceleration])
        capacity = _KILO * self._scene.power.dc_link_capacity_energy
        jerk = np.tile(limits.jerk, MESH)
        bus = np.tile([np.inf, np.inf, capacity], 2 * MESH)
        states = [np.tile(bound, MESH + 1) for bound in (lowest, highest)]
        return {
            "lbx": np.concatenate([states[0], -jerk, np.zeros(6 * MESH)]),
            "ubx": np.concatenate([states[1], jerk, bus]),
        }


def _moved(X: Any, U: Any, t: Any) -> tuple[Any, Any, Any]:
    """q, qd, qdd (n, MESH) a time t after the states X (3n, MESH) under the jerk U (n, MESH)."""
    n = U.shape[0]
    q = X[:n, :]
    qd = X[n : 2 * n, :]
    qdd = X[2 * n :, :]
    return q + t * (qd + t * (qdd / 2 + t * U / 6)), qd + t * (qdd + t * U / 2), qdd + t * U
