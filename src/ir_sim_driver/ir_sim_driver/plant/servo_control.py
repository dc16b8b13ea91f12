"""The drives' control: feed-forward from the model of the robot, and feedback; it knows nothing of
the plant.

Position loop around a speed loop with an integral part, as in drives with a feed-forward of speed:

    u = K_v (e' + K_p e + (1 / T_i) integral of (e' + K_p e)),    torque = model(q_c, q_c', q_c'' +
    u)

e is the command less what the encoder says, on the same grid of steps: speed is the difference of
two positions, acceleration the difference of two speeds, so the command feeds forward exactly,
whatever its path time does; e' is filtered. The model is that of the data with the declared load;
its inertia turns u into torques.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_description import Load, RobotModel
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.plant.drivetrain import SMOOTHING, Drivetrain
from ir_values.arrays import FloatArray
from ir_values.settings import check_settings, setting

_TURN = 2.0 * np.pi
_STEEP = 1.0 / SMOOTHING


@dataclass(frozen=True)
class ControlSettings:
    """Gains and encoders of the drives; the gains are bounded by what a 1 kHz loop can do."""

    position_gain: float = setting(
        40.0, "Gain of the position loop.", unit="1/s", minimum=1.0, maximum=100.0, read_only=True
    )
    speed_gain: float = setting(
        150.0, "Gain of the speed loop.", unit="1/s", minimum=10.0, maximum=400.0, read_only=True
    )
    integral_time: float = setting(
        0.04,
        "Time in which the integral part of the speed loop doubles its answer.",
        unit="s",
        minimum=0.005,
        maximum=10.0,
        read_only=True,
    )
    speed_filter: float = setting(
        0.003,
        "Time constant of the filter on the error of speed, which an encoder gives in steps.",
        unit="s",
        minimum=0.0,
        maximum=0.02,
        read_only=True,
    )
    encoder_counts: int = setting(
        65536,
        "Steps of an encoder per turn of its motor (an estimate: a resolver of 16 bits).",
        minimum=1000,
        maximum=16_777_216,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)


_SEEN = 0
_GOAL = 1
_KEPT = slice(2, 7)
"""Rows (n,) that the law acts on: encoders now, command at the end of the step, what the step
before left.
"""
_INTEGRAL = 4
_NOW = 5
_CHANGE = 6
_MEASURED = 7
"""Rows that it gives, behind the new values of what is kept."""


def control_law(settings: ControlSettings, dt: float) -> FloatArray:
    """(8, 7): what is linear in the law, over one step of dt [s], the same for every joint.

    It acts on: encoders, next command; of the step before: encoders, command, commanded speed,
    filtered error of speed, integral. It gives: these five for the next step; commanded speed now,
    acceleration with feedback, measured speed.
    """
    s = settings
    seen, goal, seen_before, command, speed_before, slow_before, integral = np.eye(7)
    measured = (seen - seen_before) / dt  # half a step old, as the commanded speed is
    speed = (goal - command) / dt
    acceleration = (speed - speed_before) / dt
    slow = slow_before + dt / (s.speed_filter + dt) * (speed_before - measured - slow_before)
    error = slow + s.position_gain * (command - seen)
    now = speed_before + 0.5 * dt * acceleration
    change = acceleration + s.speed_gain * (error + integral / s.integral_time)
    return np.stack((seen, goal, speed, slow, integral + dt * error, now, change, measured))


class ServoControl:
    """Turns commands (n,), one per step of dt [s], into motor torques at the joint (n,) [Nm].

    robot: the model, an ir_description RobotModel, standing at base_pose (4, 4).
    """

    def __init__(
        self,
        robot: RobotModel,
        dt: float,
        base_pose: FloatArray,
        settings: ControlSettings | None = None,
    ) -> None:
        s = settings or ControlSettings()
        self._law = control_law(s, dt)
        self._count: FloatArray = _TURN / s.encoder_counts / np.array(robot.gear_ratio)
        none = np.zeros(len(robot.joint_names))
        self._rows: FloatArray = np.zeros((7, len(none)))
        self._bare = replace(robot, friction_viscous=none, friction_coulomb=none)
        self._viscous: list[float] = np.array(robot.friction_viscous).tolist()
        self._coulomb: list[float] = np.array(robot.friction_coulomb).tolist()
        self._base_pose = base_pose
        self._coupling = robot.coupling
        self._drives = Drivetrain(robot)
        self.declare(())

    def declare(self, loads: Sequence[Load]) -> None:
        """Take these for what the robot carries."""
        self._model = DynamicsModel(self._bare, tuple(loads), self._base_pose)

    def reset(self, q: FloatArray) -> None:
        """Start over with a command that stands at q (n,) [rad]."""
        self.command: FloatArray = q.copy()
        self._rows[_KEPT] = 0.0
        self._rows[_KEPT][:2] = self._encoders(q), q

    def torque(self, q_next: FloatArray, q: FloatArray) -> tuple[FloatArray, bool]:
        """Torque (n,) for the step that ends with the command q_next, the robot being at q now, and
        whether the envelope has cut it.
        """
        rows = self._rows
        rows[_SEEN] = self._encoders(q)
        rows[_GOAL] = q_next
        new = self._law.dot(rows)
        speed = new[_NOW]
        model = self._model.inverse_dynamics_at(self.command, speed, new[_CHANGE])
        turning = self._coupling.motors(speed)
        # plain floats, joint by joint: half the time of arrays this small
        friction = zip(model.tolist(), self._viscous, self._coulomb, turning.tolist(), strict=True)
        wanted = [t + viscous * v + dry * math.tanh(v * _STEEP) for t, viscous, dry, v in friction]
        measured = self._coupling.motors(new[_MEASURED])
        torque, cut = self._drives.limited(wanted, measured.tolist())
        if cut:  # else the integral would wind up
            new[_INTEGRAL] = rows[_KEPT][_INTEGRAL]
        rows[_KEPT] = new[:_NOW]
        self.command = q_next
        return torque, cut

    def _encoders(self, q: FloatArray) -> FloatArray:
        """What the encoders of the motors say of the joints (n,) [rad]."""
        seen: FloatArray = np.rint(self._coupling.motors(q) / self._count) * self._count
        return self._coupling.joints(seen)
