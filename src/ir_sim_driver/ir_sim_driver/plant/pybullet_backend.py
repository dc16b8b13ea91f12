"""The robot of a plant in PyBullet, driven by motor torques that a controller makes which does not
know it.

Rotor inertia is up to 4000 times a link's own and can neither be fed back as a torque (it diverges
in six steps) nor be added to the links. So every step solves (H + J_r) qdd + h + friction -
counterbalance = tau for qdd, friction at the speed in the middle of the change (else it chatters at
rest), and applies H qdd + h to the links.
"""

from __future__ import annotations

from collections.abc import Sequence
from operator import add, sub

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
"""Torque of a mechanical brake over the joint's largest motor torque (an estimate; no public
figure).
"""
_CHUNK = 4096  # steps whose work is kept when nobody asks for it
_FRICTION = 1e-6  # Nm to which the friction of a step is found
# steps of Newton's method for it, and with those that surely come nearer
_NEWTON = 4
_ITERATIONS = 16


class PyBulletBackend:
    """Implements Backend for the plant of `model`, the robot as its controller knows it, at
    base_pose (4, 4).

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
        self._dt = dt
        self._n = len(plant.robot.joint_names)
        self._drives = Drivetrain(plant.robot)
        self._gears = Gears(plant.gears, dt)
        self._axes = range(self._n)
        self._inertia: FloatArray = np.zeros((self._n, self._n))  # H + J_r, and what friction adds
        self._diagonal = self._inertia.ravel()[:: self._n + 1]
        self._rotor: list[float] = self._drives.rotor_inertia.tolist()
        self._servo = ServoControl(model, dt, base, control)
        self._motor_torque: FloatArray = np.array(plant.robot.envelope_torque)[:, 0]
        self._brake_torque: FloatArray = BRAKE_FACTOR * self._motor_torque
        self._still: FloatArray = np.zeros(self._n)
        self.disturbance: FloatArray | None = None
        self.torque = self._still
        self.saturated = False
        self._rest = [0.0] * self._n
        self._be(np.array(plant.robot.machine_home, dtype=np.float64))
        self._load = self._rest  # through the gears to the links in the last step
        self._speeds: list[Sequence[float]] = []
        self._torques: list[FloatArray] = []
        self._stale = False  # whether Bullet's state is older than ours
        self.set_load(())
        self.reset(self.q)

    def close(self) -> None:
        """Let go of the physics server."""
        self._arm.close()

    @property
    def qd(self) -> FloatArray:
        """Present speed (n,) [rad/s]."""
        return np.array(self._now)

    @property
    def standing(self) -> bool:
        """Whether the robot stands."""
        return min(self._now) > -STANDING and max(self._now) < STANDING

    @property
    def temperature(self) -> FloatArray:
        """Of the gears (n,) [deg C]."""
        return self._gears.temperature

    def reset(self, q: FloatArray) -> None:
        """Stand still at q; starts the physics server again when it is gone."""
        self._arm.connect_again()
        self._be(np.array(q, dtype=np.float64))
        self._servo.reset(self.q)
        self._write()

    def set_load(self, loads: Sequence[Load], declared: Sequence[Load] | None = None) -> None:
        """Carry these loads, in the same motion. Raises BackendError where Bullet takes none of
        their inertia.
        """
        self._arm.carry(loads, self._at)
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
        self.torque = self._still
        self.saturated = False
        self._drive(self._still)
        self._servo.reset(self.q)

    def halt(self) -> None:
        """Brake with the largest motor torque: a motor that brakes has it at any speed."""
        self._stop(self._motor_torque, motors=True)

    def brake(self) -> None:
        """Brake with the mechanical brakes."""
        self._stop(self._brake_torque, motors=False)

    def _stop(self, most: FloatArray, motors: bool) -> None:
        """Take at most this torque (n,), of motors or brakes, to stop each joint within this
        step.
        """
        H = self.mass_matrix()
        h = self._bias(self._lagging)
        stopping = np.array(self._lagging) * (-1.0 / self._dt)
        links = H @ stopping + h
        balance = np.array(self._drives.counterbalance(self._at))
        wanted = links + self._drives.rotor_inertia * stopping - balance
        torque: FloatArray = np.clip(wanted, -most, most)
        self.torque = torque if motors else self._still
        self.saturated = False
        if (torque != wanted).any() or self.disturbance is not None:
            self._drive(torque)
        else:
            self._advance(links.tolist())
        self._servo.reset(self.q)

    def rest(self) -> None:
        """Stay where the closed brakes hold the robot."""
        if any(self._lagging):
            self._be(self.q)
            self._servo.reset(self.q)
            self._stale = True
        self.torque = self._still
        self.saturated = False
        self._gears.cool()
        self._speeds.append(self._rest)
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
        return np.array(self._arm.mass_matrix(self._at))

    def bias(self) -> FloatArray:
        """h = C qd + g (n,) at the present state."""
        return self._bias(self._now)

    def link_com_position(self, link: int) -> FloatArray:
        """Centre of mass (3,) of link 1..n in the world [m]."""
        return self._arm.link_com_position(link)

    def required_torque(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Motor torque (n,) [Nm] at the joint for this motion, by the equations that are
        stepped.
        """
        links = self._arm.inverse_dynamics(q.tolist(), qd.tolist(), qdd.tolist())
        through = np.array(links) - self._drives.counterbalance(q.tolist())
        speed = qd.tolist()
        friction, _ = self._gears.friction(speed, self._gears.dry(speed, through.tolist()))
        torque: FloatArray = through + self._drives.rotor_inertia * qdd + friction
        return torque

    def _bias(self, qd: Sequence[float]) -> FloatArray:
        return np.array(self._arm.inverse_dynamics(self._at, qd, self._rest))

    def _be(self, q: FloatArray) -> None:
        """Stand at q (n,)."""
        self.q: FloatArray = q
        self._at: Sequence[float] = q.tolist()
        self._now: Sequence[float] = self._rest
        self._lagging: Sequence[float] = self._rest  # Bullet's speed: it is half a step old

    def _drive(self, torque: FloatArray) -> None:
        """Make a step under this motor torque and the disturbance."""
        arm = self._arm
        q = self._at
        balance = self._drives.counterbalance(q)
        outer = list(
            map(
                sub,
                map(add, torque.tolist(), balance),
                arm.inverse_dynamics(q, self._now, self._rest),
            )
        )
        if self.disturbance is not None:
            outer = list(map(add, outer, self.disturbance.tolist()))
        links = arm.inverse_dynamics(q, self._lagging, self._accelerations(outer))
        self._load = list(map(sub, links, balance))
        self._advance(links)

    def _accelerations(self, outer: Sequence[float]) -> list[float]:
        """qdd (n,) of a step in which this torque (n,) acts, and friction at the speed in its
        middle.
        """
        gears = self._gears
        lagging = self._lagging
        speed = self._now
        half = 0.5 * self._dt
        rows = self._arm.mass_matrix(self._at)
        self._inertia[:] = rows
        own = [row[j] + rotor for j, row, rotor in zip(self._axes, rows, self._rotor, strict=True)]
        dry = gears.dry(speed, self._load)
        friction, slope = gears.friction(speed, dry)
        for k in range(
            _ITERATIONS
        ):  # the state's speed lags half a step: qd is the speed at its position
            self._diagonal[:] = [m + half * s for m, s in zip(own, slope, strict=True)]
            rest = zip(outer, friction, slope, speed, lagging, strict=True)
            left = [t - f + s * (v - w) for t, f, s, v, w in rest]
            qdd: list[float] = dposv(self._inertia, left)[1].tolist()
            before = speed
            speed = [w + half * a for w, a in zip(lagging, qdd, strict=True)]
            linear = zip(friction, slope, speed, before, strict=True)
            expected = [f + s * (v - u) for f, s, v, u in linear]
            friction, slope = gears.friction(speed, dry, chord=k >= _NEWTON)
            if max(map(abs, map(sub, friction, expected))) < _FRICTION:
                break
        gears.heat(friction, speed)
        return qdd

    def _advance(self, links: Sequence[float]) -> None:
        """Make a step with these torques (n,) on the links."""
        before = self._lagging
        self._at, self._lagging = self._arm.advance(links)
        self.q = np.array(self._at)
        self._now = [1.5 * v - 0.5 * u for u, v in zip(before, self._lagging, strict=True)]
        self._speeds.append([0.5 * (u + v) for u, v in zip(before, self._lagging, strict=True)])
        self._torques.append(self.torque)
        if len(self._speeds) > _CHUNK:  # nobody reads the work: keep the memory bounded
            del self._speeds[:_CHUNK], self._torques[:_CHUNK]

    def _write(self) -> None:
        self._stale = False
        self._arm.write(self._at, self._lagging)
