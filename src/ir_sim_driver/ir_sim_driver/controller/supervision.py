"""Is the robot where it should be, and no faster? Looked at in every mode, braking and standing
too.

Whoever leaves its range, the tube around its command, its speed or its acceleration is stopped by
the brakes at once (STOP 0), and so is a motor that gives all it has for long. The fault lasts until
somebody recovers.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ir_description import RobotModel
from ir_msgs_py.names import joint_unit
from ir_sim_driver.motion import ErrorCode
from ir_sim_driver.plant import Backend
from ir_values.arrays import FloatArray
from ir_values.settings import check_settings, setting

PERIOD = 4  # steps: as safety controllers do, which look every 4 to 12 ms
_WINDOW = 5  # looks: acceleration is the mean over 20 ms, as speeds of single steps carry noise


@dataclass(frozen=True)
class SupervisionSettings:
    """When the robot counts as running away, beyond what trajectories may ask for."""

    range_margin: float = setting(
        0.02,
        "How far a joint may be outside its range.",
        unit="rad",
        minimum=1e-4,
        maximum=0.1,
        read_only=True,
    )
    speed_margin: float = setting(
        0.1,
        "By what share a joint may be faster than its limit.",
        minimum=0.01,
        maximum=1.0,
        read_only=True,
    )
    acceleration_margin: float = setting(
        1.0,
        "By what share the mean acceleration over 20 ms may be above its limit, brakes apart.",
        minimum=0.1,
        maximum=20.0,
        read_only=True,
    )
    saturation_time: float = setting(
        0.3,
        "How long a motor may give all the torque it has without a break.",
        unit="s",
        minimum=0.01,
        maximum=10.0,
        read_only=True,
    )

    brake_reaction: float = setting(
        0.05,
        "How long the brakes take to act when the motors are switched off (an estimate).",
        unit="s",
        minimum=0.0,
        maximum=0.5,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)


class Fault(NamedTuple):
    """Why the robot is stopped, and what a goal that runs ends with."""

    sentence: str
    code: ErrorCode = ErrorCode.PATH_TOLERANCE_VIOLATED


class CommandedPosition(NamedTuple):
    """Commanded position q (n,) [rad], deviation [m] of the tool from it, and the largest that is
    allowed.
    """

    q: FloatArray
    deviation: float
    tube: float


class Supervision:
    """Looks at `robot` every PERIOD steps of dt [s]."""

    def __init__(self, robot: RobotModel, dt: float, settings: SupervisionSettings) -> None:
        self._robot = robot
        self._settings = settings
        self._low = robot.position_min - settings.range_margin
        self._high = robot.position_max + settings.range_margin
        self._speed = robot.velocity_max * (1.0 + settings.speed_margin)
        self._change = (
            robot.acceleration_max * (1.0 + settings.acceleration_margin) * (PERIOD * _WINDOW * dt)
        )
        self._saturation_looks = max(1, round(settings.saturation_time / (PERIOD * dt)))
        self._allow(self._low, self._high)
        self._speeds: deque[FloatArray] = deque(maxlen=_WINDOW + 1)
        self._saturated = 0
        self._seen: FloatArray | None = None

    def recovered(self, q: FloatArray) -> None:
        """Begin anew at q (n,): who is outside may stay there and come back, but go no farther
        out.
        """
        margin = self._settings.range_margin
        self._allow(np.minimum(self._low, q - margin), np.maximum(self._high, q + margin))
        self._speeds.clear()
        self._saturated = 0

    def _allow(self, low: FloatArray, high: FloatArray) -> None:
        """Positions (n,) from now on."""
        self._allowed_low = low
        self._allowed_high = high
        rows = np.stack((low, high, self._speed, self._change), axis=1)
        self._bounds: list[list[float]] = rows.tolist()

    def look(self, backend: Backend, command: CommandedPosition, braking: bool) -> Fault | None:
        """What is wrong now. command: of the last step; braking: motors are off, the brakes close
        or hold.
        """
        q = backend.q
        saturated = backend.saturated
        if q is self._seen and not saturated:  # nothing has moved since
            self._speeds.clear()
            self._saturated = 0
            return None
        self._seen = q
        qd = backend.qd
        before = self._speed_before(qd, braking)
        fault = (
            None if self._is_within_bounds(q, qd, before) else self._exceeded(q, qd, qd - before)
        )
        fault = fault or self._left_tube(q, command)
        return fault if braking else fault or self._saturation(saturated)

    def _is_within_bounds(self, q: FloatArray, qd: FloatArray, before: FloatArray) -> bool:
        """Whether nothing is exceeded; plain floats take a third of the time of so small arrays."""
        for x, v, u, (low, high, speed, change) in zip(
            q.tolist(), qd.tolist(), before.tolist(), self._bounds, strict=True
        ):
            if not (low <= x <= high and -speed <= v <= speed and -change <= v - u <= change):
                return False  # of what is not a number too
        return True

    def _speed_before(self, qd: FloatArray, braking: bool) -> FloatArray:
        """Speed (n,) at the begin of the window; the present one while it is not full."""
        if braking:
            self._speeds.clear()
            return qd
        self._speeds.append(qd)
        return self._speeds[0] if len(self._speeds) > _WINDOW else qd

    def _exceeded(self, q: FloatArray, qd: FloatArray, change: FloatArray) -> Fault | None:
        """Which of range, speed and acceleration is exceeded."""
        return self._left_range(q) or self._too_fast(qd) or self._too_hard(change)

    def _left_range(self, q: FloatArray) -> Fault | None:
        if ((q >= self._allowed_low) & (q <= self._allowed_high)).all():
            return None
        robot = self._robot
        beyond = np.maximum(q - robot.position_max, robot.position_min - q)
        j = int(beyond.argmax())
        unit = joint_unit(robot.joint_names[j])
        return Fault(
            f"{robot.joint_names[j]} is at {q[j]:.4f} {unit}: its range is "
            f"[{robot.position_min[j]:.4f}, {robot.position_max[j]:.4f}] {unit}, exceeded by "
            f"{beyond[j]:.3g} {unit}"
        )

    def _left_tube(self, q: FloatArray, command: CommandedPosition) -> Fault | None:
        if command.deviation <= command.tube:
            return None
        error = command.q - q
        j = int(np.abs(error).argmax())
        off = command.deviation * 1e3
        tube = command.tube * 1e3
        return Fault(
            f"the tool is {off:.2f} mm from its command: at most {tube:g} mm; "
            f"worst is {self._robot.joint_names[j]} with {error[j]:+.6f} "
            f"{joint_unit(self._robot.joint_names[j])}",
        )

    def _too_fast(self, qd: FloatArray) -> Fault | None:
        size = np.abs(qd)
        if (size <= self._speed).all():
            return None
        return self._worst("moves at", qd, self._robot.velocity_max, "rad/s")

    def _too_hard(self, change: FloatArray) -> Fault | None:
        if (np.abs(change) <= self._change).all():
            return None
        limit = self._robot.acceleration_max
        scale = limit * (1.0 + self._settings.acceleration_margin) / self._change
        return self._worst("accelerates at", change * scale, limit, "rad/s^2")

    def _saturation(self, saturated: bool) -> Fault | None:
        self._saturated = self._saturated + 1 if saturated else 0
        if self._saturated <= self._saturation_looks:
            return None
        seconds = self._settings.saturation_time
        return Fault(f"a motor gives all the torque it has for more than {seconds:g} s")

    def _worst(self, verb: str, value: FloatArray, limit: FloatArray, unit: str) -> Fault:
        j = int((np.abs(value) / limit).argmax())
        name = self._robot.joint_names[j]
        unit = joint_unit(name, unit)
        return Fault(f"{name} {verb} {value[j]:.4g} {unit}: its limit is {limit[j]:.4g} {unit}")
