"""A judge of executed motion that shares nothing with the driver.

It knows the robot's limits and what was sent, and nothing of how the driver works: it takes finite
differences of the joint states, and remembers presses of the emergency stop.
"""

from __future__ import annotations

import numpy as np

from ir_description import RobotModel

DT = 0.001
# share: a command is judged by differences over a step, the limits hold for its derivatives
SLACK = 0.02
NOISE = 1e-3  # rad/s^2: differences of positions to 1e-16 rad, and interpolation of path time
ROLLING = 1.25  # times its limit a joint may reach while the brakes close: gravity pulls meanwhile
STOPPED = 400  # steps after which a latched stop has stopped everything


class Judge:
    """Looks at joint states (n,), one per step, and at what was pressed; wrong: what broke a
    law.
    """

    def __init__(self, robot: RobotModel) -> None:
        self._robot = robot
        self._seen: list[np.ndarray] = []
        self._braking: list[bool] = []
        self._since = 0  # steps since a press that nobody has reset
        self.pressed = False
        self.wrong: list[str] = []

    def see(self, q: np.ndarray | None, stopped: bool, braking: bool) -> None:
        """Take the next joint state; None: the controller was off the network. stopped: a stop is
        latched.
        braking: the power mode is that of the emergency stop.
        """
        if self.pressed and not stopped:
            self.wrong.append("an emergency stop is no longer latched")
            self.pressed = False
        self._since = self._since + 1 if stopped else 0
        if q is None:
            self._seen = self._seen[-1:]
            self._braking = self._braking[-1:]
            return
        if self._since > STOPPED and not np.array_equal(q, self._seen[-1]):
            self.wrong.append(
                f"it moves by {np.abs(q - self._seen[-1]).max():.3g} rad though it is stopped"
            )
        self._seen.append(q)
        self._braking.append(stopped or braking)

    def conclude(self, what: str) -> None:
        """Judge what was seen since the last time."""
        if len(self._seen) < 3:
            return
        q = np.array(self._seen)
        robot = self._robot
        braking = np.array(self._braking)
        speed = np.abs(np.diff(q, axis=0)) / DT / robot.velocity_max
        change = (np.abs(np.diff(q, 2, axis=0)) / DT**2 - NOISE) / robot.acceleration_max
        beyond = np.maximum(q - robot.position_max, robot.position_min - q).max(axis=1)
        allowed = np.where(braking[1:], ROLLING, 1.0 + SLACK)
        free = ~(braking[2:] | braking[1:-1] | braking[:-2])
        found = {
            "not finite": not np.isfinite(q).all(),
            "speed": bool((speed.max(axis=1) > allowed).any()),
            "acceleration": bool((change.max(axis=1)[free] > 1.0 + SLACK).any()),
            "range": bool((beyond[~braking] > 1e-5).any()),
        }
        self.wrong += [f"{name} after {what}" for name, broken in found.items() if broken]
        self._seen = self._seen[-2:]
        self._braking = self._braking[-2:]
