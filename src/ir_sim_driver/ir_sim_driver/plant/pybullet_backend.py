"""The robot of a plant in PyBullet, driven by motor torques that a controller makes which does not know it.

Rotor inertia is up to 4000 times a link's own and can neither be fed back as a torque (it diverges in six
steps) nor be added to the links. So every step solves (H + J_r) qdd + h + friction - counterbalance = tau for
qdd, friction at the speed in the middle of the change (else it chatters at rest), and applies H qdd + h to
the links.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg.lapack import dposv

from ir_description import Load, RobotModel
from ir_msgs_py.arrays import FloatArray
from ir_sim_driver.plant.backend import STANDING, Work
from ir_sim_driver.plant.bullet_arm import BulletArm
from ir_sim_driver.plant.control import ControlSettings, ServoControl
from ir_sim_driver.plant.drivetrain import Drivetrain
from ir_sim_driver.plant.gears import Gears
from ir_sim_driver.plant.plant_parameters import Plant

BRAKE_FACTOR = 1.5
"""Torque of a mechanical brake over the joint's largest motor torque (an estimate; no public figure)."""
_CHUNK = 4096  # steps whose work is kept when nobody asks for it
_FRICTION = 1e-6  # Nm to which the friction of a step is found
_NEWTON, _ITERATIONS = 4, 16  # steps of Newton's method for it, and with those that surely come nearer


class PyBulletBackend:
    """Implements Backend for the plant of `model`, the robot as its controller knows it, at base_pose (4, 4).

    Raises BackendError when PyBullet is missing or has diverged.
    """

    def __init__(
        self,
        plant: Plant,
        model: RobotModel,
        dt: float,
        base_pose: FloatArray | None = None,
        control: ControlSettings | None = None,
    ) -> None:
        base = np.eye(4) if base_pose is None else np.array(base_pose)
        self._arm = BulletArm(plant.robot, dt, base)
        self._dt, self._n = dt, len(plant.robot.joint_names)
        self._drives, self._gears = Drivetrain(plant.robot), Gears(plant.gears, dt)
        self._diagonal = slice(None, None, self._n + 1)
        self._servo = ServoControl(model, dt, base, control)
        self._motor_torque: FloatArray = np.array(plant.robot.envelope_torque)[:, 0]
        self._brake_torque: FloatArray = BRAKE_FACTOR * self._motor_torque
        self._still: FloatArray = np.zeros(self._n)
        self.disturbance: FloatArray | None = None
        self.torque, self.saturated = self._still, False
        self.q: FloatArray = np.array(plant.robot.machine_home, dtype=np.float64)
        self.qd = self._still
        self._speed: FloatArray = self._still  # of Bullet, half a step old
        self._rest = [0.0] * self._n
        self._load = self._rest  # through the gears to the links in the last step
        self._speeds: list[FloatArray] = []
        self._torques: list[FloatArray] = []
        self._stale = False  # whether Bullet's state is older than ours
        self.set_load(())
        self.reset(self.q)

    def close(self) -> None:
        """Let go of the physics server."""
        self._arm.close()

    @property
    def standing(self) -> bool:
        """Whether the robot stands."""
        return all(-STANDING < x < STANDING for x in self.qd.tolist())

    @property
    def temperature(self) -> FloatArray:
        """Of the gears (n,) [deg C]."""
        return self._gears.temperature

    def reset(self, q: FloatArray) -> None:
        """Stand still at q; starts the physics server again when it is gone."""
        self._arm.connect_again()
        self.q, self.qd, self._speed = np.array(q, dtype=np.float64), self._still, self._still
        self._servo.reset(self.q)
        self._write()

    def set_load(self, loads: Sequence[Load], declared: Sequence[Load] | None = None) -> None:
        """Carry these loads, in the same motion. Raises BackendError where Bullet takes none of their
        inertia.
        """
        self._arm.carry(loads, self.q.tolist())
        self._servo.declare(loads if declared is None else declared)
        self._write()

    def track(self, q_next: FloatArray) -> None:
        """Follow the command with the torque that the envelope allows."""
        if self._stale:
            self._write()
        self.torque, self.saturated = self._servo.torque(q_next, self.q)
        self._drive(self.torque)

    def coast(self) -> None:
        """Fall and roll on as gravity, friction and counterbalance will have it."""
        if self._stale:
            self._write()
        self.torque, self.saturated = self._still, False
        self._drive(self._still)
        self._servo.reset(self.q)

    def halt(self) -> None:
        """Brake with the largest motor torque: a motor that brakes has it at any speed."""
        self._stop(self._motor_torque, motors=True)

    def brake(self) -> None:
        """Brake with the mechanical brakes."""
        self._stop(self._brake_torque, motors=False)

    def _stop(self, most: FloatArray, motors: bool) -> None:
        """Take at most this torque (n,), of motors or brakes, to stop each joint within this step."""
        H, h = self.mass_matrix(), self._bias(self._speed)
        stopping = self._speed * (-1.0 / self._dt)
        links = H @ stopping + h
        balance = np.array(self._drives.counterbalance(self.q.tolist()))
        wanted = links + self._drives.rotor_inertia * stopping - balance
        torque: FloatArray = np.clip(wanted, -most, most)
        self.torque, self.saturated = torque if motors else self._still, False
        if (torque != wanted).any() or self.disturbance is not None:
            self._drive(torque)
        else:
            self._advance(links.tolist())
        self._servo.reset(self.q)

    def rest(self) -> None:
        """Stay where the closed brakes hold the robot."""
        if self._speed.any():
            self._speed = self.qd = self._still
            self._servo.reset(self.q)
            self._stale = True
        self.torque, self.saturated = self._still, False
        self._gears.cool()
        self._speeds.append(self._still)
        self._torques.append(self._still)

    def work(self) -> Work:
        """Speed and torque of every step since the last call."""
        shape = (len(self._speeds), self._n)
        work = Work(np.array(self._speeds).reshape(shape), np.array(self._torques).reshape(shape))
        self._speeds.clear()
        self._torques.clear()
        return work

    def mass_matrix(self) -> FloatArray:
        """H (n, n) at the present state, without rotor inertia."""
        return self._arm.mass_matrix(self.q.tolist())

    def bias(self) -> FloatArray:
        """h = C qd + g (n,) at the present state."""
        return self._bias(self.qd)

    def link_com_position(self, link: int) -> FloatArray:
        """Centre of mass (3,) of link 1..n in the world [m]."""
        return self._arm.link_com_position(link)

    def required_torque(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Motor torque (n,) [Nm] at the joint for this motion, by the equations that are stepped."""
        links = self._arm.inverse_dynamics(q.tolist(), qd.tolist(), qdd.tolist())
        through = np.array(links) - self._drives.counterbalance(q.tolist())
        speed = qd.tolist()
        friction, _ = self._gears.friction(speed, self._gears.dry(speed, through.tolist()))
        torque: FloatArray = through + self._drives.rotor_inertia * qdd + friction
        return torque

    def _bias(self, qd: FloatArray) -> FloatArray:
        return np.array(self._arm.inverse_dynamics(self.q.tolist(), qd.tolist(), self._rest))

    def _drive(self, torque: FloatArray) -> None:
        """Make a step under this motor torque and the disturbance."""
        gears, half = self._gears, 0.5 * self._dt
        q, speed, lagging = self.q.tolist(), self.qd.tolist(), self._speed.tolist()
        inertia, balance = self._arm.mass_matrix(q), self._drives.counterbalance(q)
        inertia.ravel()[self._diagonal] += self._drives.rotor_inertia
        bias = self._arm.inverse_dynamics(q, speed, self._rest)
        outer = [t - h + c for t, h, c in zip(torque.tolist(), bias, balance, strict=True)]
        if self.disturbance is not None:
            outer = [t + d for t, d in zip(outer, self.disturbance.tolist(), strict=True)]
        dry = gears.dry(speed, self._load)
        friction, slope = gears.friction(speed, dry)
        for k in range(_ITERATIONS):  # the state's speed lags half a step: qd is the speed at its position
            stiff = inertia.copy()
            stiff.ravel()[self._diagonal] += [half * s for s in slope]
            rest = zip(outer, friction, slope, speed, lagging, strict=True)
            qdd = dposv(stiff, [t - f + s * (v - w) for t, f, s, v, w in rest])[1].tolist()
            before, speed = speed, [w + half * a for w, a in zip(lagging, qdd, strict=True)]
            linear = zip(friction, slope, speed, before, strict=True)
            expected = [f + s * (v - u) for f, s, v, u in linear]
            friction, slope = gears.friction(speed, dry, chord=k >= _NEWTON)
            if all(abs(f - e) < _FRICTION for f, e in zip(friction, expected, strict=True)):
                break
        gears.heat(friction, speed)
        links = self._arm.inverse_dynamics(q, lagging, qdd)
        self._load = [t - c for t, c in zip(links, balance, strict=True)]
        self._advance(links)

    def _advance(self, links: Sequence[float]) -> None:
        """Make a step with these torques (n,) on the links."""
        before = self._speed
        q, speed = self._arm.advance(links)
        self.q, self._speed = np.array(q), np.array(speed)
        half = 0.5 * (self._speed - before)
        self.qd = self._speed + half
        self._speeds.append(before + half)
        self._torques.append(self.torque)
        if len(self._speeds) > _CHUNK:  # nobody reads the work: keep the memory bounded
            del self._speeds[:_CHUNK], self._torques[:_CHUNK]

    def _write(self) -> None:
        self._stale = False
        self._arm.write(self.q.tolist(), self._speed.tolist())
