"""The drives' control: feed-forward from the model of the robot, and feedback; it knows nothing of the plant.

Position loop around a speed loop with an integral part, as in drives with a feed-forward of speed:

    u = K_v (e' + K_p e + (1 / T_i) integral of (e' + K_p e)),    torque = model(q_c, q_c', q_c'' + u)

e is the command less what the encoder says, on the same grid of steps: speed is the difference of two
positions, acceleration the difference of two speeds, so the command feeds forward exactly, whatever its path
time does; e' is filtered. The model is that of the data with the declared load; its inertia turns u into
torques.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_description import Load, RobotModel
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.settings import check_settings, setting
from ir_sim_driver.plant.drivetrain import Drivetrain
from ir_sim_driver.plant.gears import SMOOTHING

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


class ServoControl:
    """Turns commands (n,), one per step of dt [s], into motor torques at the joint (n,) [Nm].

    robot: the model, an ir_description RobotModel, standing at base_pose (4, 4).
    """

    def __init__(
        self, robot: RobotModel, dt: float, base_pose: FloatArray, settings: ControlSettings | None = None
    ) -> None:
        s = settings or ControlSettings()
        self._dt, self._per_dt = dt, 1.0 / dt
        self._kp, self._kv, self._per_ti = s.position_gain, s.speed_gain, 1.0 / s.integral_time
        self._share = dt / (s.speed_filter + dt)
        self._count: list[float] = (_TURN / s.encoder_counts / np.array(robot.gear_ratio)).tolist()
        none = np.zeros(len(robot.joint_names))
        self._bare = replace(robot, friction_viscous=none, friction_coulomb=none)
        self._viscous: list[float] = np.array(robot.friction_viscous).tolist()
        self._coulomb: list[float] = np.array(robot.friction_coulomb).tolist()
        self._base_pose, self._drives = base_pose, Drivetrain(robot)
        self.declare(())

    def declare(self, loads: Sequence[Load]) -> None:
        """Take these for what the robot carries."""
        self._model = DynamicsModel(self._bare, tuple(loads), self._base_pose)

    def reset(self, q: FloatArray) -> None:
        """Start over with a command that stands at q."""
        self.command: FloatArray = q.copy()
        self._wanted = q.tolist()
        self._seen = self._measured(self._wanted)
        still = [0.0] * len(q)
        self._speed, self._integral, self._slow = still, still, still

    def torque(self, q_next: FloatArray, q: FloatArray) -> tuple[FloatArray, bool]:
        """Torque (n,) for the step that ends with the command q_next, the robot being at q now, and whether
        the envelope has cut it.
        """
        # plain floats, joint by joint: half the time of arrays this small
        seen, goal, per_dt, half = self._measured(q.tolist()), q_next.tolist(), self._per_dt, 0.5 * self._dt
        rows = zip(seen, self._seen, goal, self._wanted, self._speed, self._slow, self._integral, strict=True)
        measured, speeds, slow, errors, now, change = [], [], [], [], [], []
        for x, x_before, c_next, c, v, e_slow, integral in rows:
            moves = (x - x_before) * per_dt  # half a step old, as the commanded speed is
            speed = (c_next - c) * per_dt
            faster = (speed - v) * per_dt
            lag = e_slow + self._share * (v - moves - e_slow)
            wrong = lag + self._kp * (c - x)
            measured.append(moves)
            speeds.append(speed)
            slow.append(lag)
            errors.append(wrong)
            now.append(v + half * faster)
            change.append(faster + self._kv * (wrong + self._per_ti * integral))
        model = self._model.inverse_dynamics(self.command[None], np.array((now,)), np.array((change,)))[0]
        friction = zip(model.tolist(), self._viscous, self._coulomb, now, strict=True)
        wanted = [t + viscous * v + dry * math.tanh(v * _STEEP) for t, viscous, dry, v in friction]
        torque, cut = self._drives.limited(wanted, measured)
        if not cut:  # else the integral would wind up
            self._integral = [i + self._dt * e for i, e in zip(self._integral, errors, strict=True)]
        self._seen, self._speed, self._slow = seen, speeds, slow
        self.command, self._wanted = q_next, goal
        return torque, cut

    def _measured(self, q: Sequence[float]) -> list[float]:
        """What the encoders say (n,) [rad]."""
        return [round(x / count) * count for x, count in zip(q, self._count, strict=True)]
