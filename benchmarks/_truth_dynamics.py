"""The plant's equations against Pinocchio, and PyBullet's steps against another integration of the
same.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio
from _driven_movements import predicted
from _pinocchio_arm import pinocchio_arm
from _results import at_most
from _truth_section import Asked, Found

from ir_description import Load, RobotModel, load_cell
from ir_sim_driver import TrajectoryGoal, make_simulation
from ir_sim_driver.plant import PyBulletBackend
from ir_values.arrays import FloatArray

TITLE = "torques against Pinocchio, PyBullet's steps against an integration of its own"
CELL = "open"
STATES = 200
FINE = 4  # steps of the other integration per step of the plant
# relative, rad
TORQUE = 1e-9
POSITION = 1e-4


class Equations:
    """(H + J_r) dv/dt + h + friction - counterbalance = tau of the nominal plant, by Pinocchio and
    formulas written once more.
    """

    def __init__(self, robot: RobotModel, loads: tuple[Load, ...], base_pose: FloatArray) -> None:
        self.robot = robot
        self.model = pinocchio_arm(robot, loads, base_pose)
        self.data = self.model.createData()

    def resistance(self, q: FloatArray, v: FloatArray) -> FloatArray:
        """Friction less counterbalance (n,) [Nm]."""
        r = self.robot
        c = self.robot.counterbalance
        torque: FloatArray = r.friction_viscous * v + r.friction_coulomb * np.tanh(v / 1e-3)
        if c is not None:
            turn = np.exp(1j * q[c.joint])  # z + ix turns by +q about +y
            eye = (c.rod_eye[1] + 1j * c.rod_eye[0]) * turn
            rod = c.pivot[1] + 1j * c.pivot[0] - eye
            volume = c.gas_volume - c.piston_area * (abs(rod) - c.rod_length_at_charge)
            force = c.piston_area * c.charge_pressure * (c.gas_volume / volume) ** c.exponent
            torque[c.joint] -= force * (np.conj(eye) * rod / abs(rod)).imag
        return torque

    def torque(self, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        """Motor torque (n,) [Nm] at the joint."""
        links = pinocchio.rnea(self.model, self.data, q, v, a)
        return np.asarray(links + self.robot.reflected_inertia * a + self.resistance(q, v))

    def acceleration(self, q: FloatArray, v: FloatArray, tau: FloatArray) -> FloatArray:
        """dv/dt (n,) under this motor torque."""
        H = pinocchio.crba(self.model, self.data, q)
        H = np.triu(H) + np.triu(H, 1).T + np.diag(self.robot.reflected_inertia)
        h = pinocchio.rnea(self.model, self.data, q, v, np.zeros(len(q)))
        return np.asarray(np.linalg.solve(H, tau - h - self.resistance(q, v)))


def measured(asked: Asked) -> Found:
    """Torques at random states, and the first movements of a cell integrated twice."""
    cell = load_cell(CELL)
    loads = () if cell.tool is None else (cell.tool,)
    simulation = make_simulation(cell)
    assert isinstance(simulation.backend, PyBulletBackend)
    equations = Equations(cell.robot, loads, np.array(cell.base_pose))
    rng = np.random.default_rng(0)
    worst = 0.0
    robot = cell.robot
    for _ in range(STATES):
        q = rng.uniform(robot.position_min, robot.position_max)
        v, a = rng.uniform(-1.0, 1.0, (2, robot.n)) * [robot.velocity_max, robot.acceleration_max]
        want = equations.torque(q, v, a)
        off = np.abs(simulation.backend.required_torque(q, v, a) - want).max()
        worst = max(worst, float(off / np.abs(want).max()))
    rows: list[dict[str, Any]] = []
    chosen = [
        each.movement for each in predicted(CELL) if each.movement.load == simulation.load.text
    ]
    for movement in chosen[: 2 if asked.quick else 10]:
        apart = _apart(equations, simulation, movement.trajectory)
        rows.append(
            {"movement": movement.name, "s": movement.trajectory.duration, "apart_rad": apart}
        )
    return Found(
        rows,
        [
            at_most(f"plant's torque against Pinocchio, {STATES} states", worst, "", TORQUE),
            at_most(
                "PyBullet against another integration",
                max(r["apart_rad"] for r in rows),
                "rad",
                POSITION,
            ),
        ],
    )


def _apart(equations: Equations, simulation: Any, trajectory: Any) -> float:
    """Largest difference [rad] of the two integrations under the same motor torques."""
    backend = simulation.backend
    dt = simulation.settings.dt
    start = np.array(trajectory.positions[0])
    backend.reset(start)
    simulation.executor.hold(start)
    simulation.run(0.5)
    simulation.execute(simulation.vet(TrajectoryGoal(trajectory), 0), 0)
    q = backend.q.copy()
    v = backend.qd.copy()
    torques = []
    positions = []
    while not simulation.take_outcomes():
        simulation.step()
        torques.append(backend.torque)
        positions.append(backend.q)
    worst = 0.0
    h = dt / FINE
    # a step's torque acts at its begin: half a step before and half a step after it in the mean
    ramps = zip(torques, [*torques[1:], torques[-1]], positions, strict=True)
    for now, then, reached in ramps:
        for k in range(FINE):
            tau = now + (k + 0.5) / FINE * (then - now)
            middle = v + 0.5 * h * _implicit(equations, q, v, tau, 0.5 * h)
            q_middle = q + 0.5 * h * v
            a = _implicit(equations, q_middle, v, tau, h)
            q = q + h * middle
            v = v + h * a
        worst = max(worst, float(np.abs(q - reached).max()))
    return worst


def _implicit(
    equations: Equations, q: FloatArray, v: FloatArray, tau: FloatArray, h: float
) -> FloatArray:
    """Acceleration over a step of h that ends at the speed at which the friction acts."""
    a = equations.acceleration(q, v, tau)
    for _ in range(3):
        a = equations.acceleration(q, v + 0.5 * h * a, tau)
    return a
