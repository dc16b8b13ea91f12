"""The tool centre point: its deviation from the command, and its speed limit in T1."""

from __future__ import annotations

import numpy as np

from ir_description import RobotModel
from ir_kernels.chain import Chain
from ir_sim_driver.motion.path import Path
from ir_values.arrays import FloatArray

# Deviation of the tool: a cheap bound first, the exact distance when it matters.

EXACT_FROM = 1e-4
"""Bound [m] below which the exact deviation is not worth its time."""


class ToolPoint:
    """The tcp (4, 4 in the last link's frame) of `robot` standing at `base_pose` (4, 4)."""

    def __init__(self, robot: RobotModel, base_pose: FloatArray, tcp: FloatArray) -> None:
        self._robot = robot
        self.stand_at(base_pose, tcp)

    def stand_at(self, base_pose: FloatArray, tcp: FloatArray) -> None:
        """Base (4, 4) in the cell and tcp (4, 4) in the flange from now on."""
        robot = self._robot
        self.chain = Chain(robot, base_pose, tcp)
        arms = np.linalg.norm(np.array(robot.joint_origin)[1:, :3, 3], axis=1)
        lengths = np.concatenate((arms, [np.linalg.norm(tcp[:3, 3])]))
        self._reach: FloatArray = np.cumsum(lengths[::-1])[
            ::-1
        ].copy()  # (n,) farthest the tcp gets from axis i

    def position(self, q: FloatArray) -> FloatArray:
        """Position (3,) [m] in the world at q (n,)."""
        position: FloatArray = self.chain.tcp_poses(q[None])[0, :3, 3]
        return position

    def positions(self, q: FloatArray) -> FloatArray:
        """Positions (N, 3) at q (N, n)."""
        positions: FloatArray = self.chain.tcp_poses(q)[:, :3, 3]
        return positions

    def bound(self, size: FloatArray) -> float:
        """Upper bound [m] of the tool's deviation when the joints are off by as much as size (n,)
        >= 0.
        """
        return float(self._reach.dot(size))

    def quiet_bound(self, tolerance: FloatArray) -> float:
        """Bound [m] below which no joint can be off by more than its tolerance (n,)."""
        return float((self._reach * tolerance).min())

    def deviation(self, commanded: FloatArray, q: FloatArray) -> float:
        """Distance [m] of the tcp at q from that at `commanded` (n,)."""
        both = self.positions(np.array((commanded, q)))
        return float(np.linalg.norm(both[0] - both[1]))

    def speeds(self, q: FloatArray, qd: FloatArray) -> FloatArray:
        """Speeds (N,) [m/s] of the tcp at q, qd (N, n)."""
        linear = self.chain.jacobian(q)[:, :3]
        speeds: FloatArray = np.linalg.norm(np.einsum("kij,kj->ki", linear, qd), axis=1)
        return speeds


# Operating mode T1: the tool keeps 250 mm/s, by looking ahead along the path.
#
# From path speed v a stop at rate r covers v^2 / 2r of path time, so the speed that may be had
# now is bounded by what is allowed at every later place s': v^2 <= allowed(s')^2 + 2 r (s' - s).

TOOL_SPEED = 0.25
"""Largest speed of the tool in T1 [m/s]."""
_MARGIN = 0.98  # the speed is kept from step to step, not exactly
_SHARE = 0.7  # of the rate; the limits of the joints may make stops longer
_SAMPLES = 24


def manual_scaling(tool: ToolPoint, path: Path, s: float, stop_time: float) -> float:
    """Largest path speed at path time s [s] that keeps the tool's speed from here on."""
    rate = _SHARE / stop_time
    ahead = np.linspace(0.0, 0.5 / rate, _SAMPLES)
    motions = [path.motion(min(s + float(step), path.duration)) for step in ahead]
    speeds = tool.speeds(np.array([m.q for m in motions]), np.array([m.qd for m in motions]))
    allowed = np.minimum(1.0, _MARGIN * TOOL_SPEED / np.maximum(speeds, 1e-9))
    return float(np.sqrt(allowed**2 + 2.0 * rate * ahead).min(initial=1.0))
