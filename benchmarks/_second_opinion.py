"""Second opinions on movements: distances by Coal at 0.0005 rad, limits at 10 kHz, torque by
Pinocchio.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio
from _coal_model import Coal
from _drives import Drives

from ir_description.robot import RobotModel
from ir_kernels import CollisionModel
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.scene.allowed_contacts import tcp_inside
from ir_planner.scene.planning_scene import PlanningScene
from ir_values.arrays import BoolArray, FloatArray, IntArray

# Coal's distances along a path at 0.0005 rad, asked only where they could be too small.
#
# No point of a capsule is farther from an axis than the links and the capsule between are long, so
# a distance changes by at most that times what the axis turns. Distances at both ends of a stretch
# bound it from below in between; a pair that can come below what it must keep is asked for in the
# middle, and so on down to single samples. The lengths are those of the robot's data; nothing of
# the planner takes part.

_FIRST = 64  # samples of a stretch at first
_BELOW = -1e-6  # m: what is excluded is less than this


class RefinedCoal:
    """Coal for one scene, with how far each pair's distance can change."""

    def __init__(
        self, coal: Coal, model: CollisionModel, robot: RobotModel, capsules: Sequence[Any]
    ) -> None:
        self._coal = coal
        by_name = {capsule.name: capsule for capsule in capsules}
        links = np.linalg.norm(np.array(robot.joint_origin)[:, :3, 3], axis=1)
        self._reach = np.array(
            [_reach(pair, by_name, links) for pair in model.pairs]
        )  # (Z, n): m per rad

    def least(self, q: FloatArray, kept: FloatArray) -> tuple[float, int]:
        """Least distance minus what its pair must keep [m] at q (M, n), exact where it is negative,
        and at how many configurations Coal was asked. kept (M, Z) m.
        """
        turned = np.concatenate(
            [np.zeros((1, q.shape[1])), np.abs(np.diff(q, axis=0)).cumsum(axis=0)]
        )
        places = np.unique(np.append(np.arange(0, len(q), _FIRST), len(q) - 1))
        first = np.array([self._coal.distances(q[k]) - kept[k] for k in places])
        best = float(first.min())
        asked = len(places)
        stretches = [
            (int(a), int(b), np.arange(first.shape[1]), first[k], first[k + 1])
            for k, (a, b) in enumerate(itertools.pairwise(places))
        ]
        while stretches:
            a, b, pairs, left_a, left_b = stretches.pop()
            if b - a < 2:
                continue
            low = 0.5 * (left_a + left_b - self._reach[pairs] @ (turned[b] - turned[a]))
            open_ = (low < _BELOW) | _changing(kept[a : b + 1], pairs)
            if not open_.any():
                continue
            pairs = pairs[open_]
            middle = (a + b) // 2
            left = self._some(q[middle], pairs) - kept[middle, pairs]
            best = min(best, float(left.min()))
            asked = asked + 1
            stretches += [
                (a, middle, pairs, left_a[open_], left),
                (middle, b, pairs, left, left_b[open_]),
            ]
        return best, asked

    def _some(self, q: FloatArray, pairs: IntArray) -> FloatArray:
        """Distances of some pairs at q (n,)."""
        coal = self._coal
        pinocchio.updateGeometryPlacements(
            coal.model, coal.data, coal.geometry, coal.geometry_data, q
        )
        for z in pairs:
            pinocchio.computeDistance(coal.geometry, coal.geometry_data, int(z))
        results = coal.geometry_data.distanceResults
        return np.array([results[int(z)].min_distance for z in pairs])


def _changing(kept: FloatArray, pairs: IntArray) -> BoolArray:
    """Which pairs must keep different distances along a stretch."""
    if kept.strides[0] == 0:  # the same row all along
        return np.zeros(len(pairs), dtype=bool)
    return np.asarray((kept[:, pairs] != kept[0, pairs]).any(axis=0))


def _reach(pair: Any, capsules: dict[str, Any], links: FloatArray) -> FloatArray:
    """(n,): how far what a joint moves of a pair can be from its axis, seen from the pair's other
    half.
    """
    result = np.zeros(len(links))
    ends = [capsules[pair.body_a]] + ([capsules[pair.body_b]] if pair.kind == "SELF" else [])
    outer = max(ends, key=lambda capsule: capsule.link)
    inner = min(capsule.link for capsule in ends) if len(ends) > 1 else 0
    far = max(float(np.linalg.norm(end)) for end in (outer.p0, outer.p1)) + outer.radius
    for joint in range(outer.link - 1, inner - 1, -1):
        result[joint] = far
        far += float(links[joint])
    return result


STEP = 0.0005  # rad of the fastest joint between two configurations that Coal is asked about
RATE = 10_000.0  # Hz


def sampled_densely(trajectory: JointTrajectory, step: float = STEP) -> FloatArray:
    """Configurations (M, n) along the path; no joint moves more than `step` [rad] from one to the
    next.
    """
    times = trajectory.times
    instants = np.linspace(times[0], times[-1], max(int((times[-1] - times[0]) * RATE), 2))
    steps = np.abs(np.diff(trajectory.sample(instants).q, axis=0)).max(axis=1)
    passed = np.concatenate([[0.0], np.cumsum(steps)])
    count = int(np.ceil(1.1 * passed[-1] / step)) + 2
    while True:
        q = trajectory.sample(np.interp(np.linspace(0.0, passed[-1], count), passed, instants)).q
        if np.abs(np.diff(q, axis=0)).max() <= step:
            return q
        count = int(1.2 * count)


class SecondOpinion:
    """Coal and Pinocchio for one scene."""

    def __init__(self, scene: PlanningScene) -> None:
        loads = [capsule for load in scene.loads for capsule in load.capsules]
        self._scene = scene
        capsules = [*scene.cell.robot.capsules, *loads]
        self._coal = Coal(scene.collision, capsules, scene.cell.bodies())
        self._coal.precise()
        self._refined = RefinedCoal(self._coal, scene.collision, scene.cell.robot, capsules)
        self._drives = Drives(scene)

    def clearance_left(
        self, trajectory: JointTrajectory, margin: float, station: str = "", step: float = STEP
    ) -> tuple[float, int]:
        """Least distance minus what its pair must keep [m] by Coal, exact where it is negative, and
        at how many configurations it was asked.

        station: inside its zone its allowed contacts keep their own distances.
        """
        asked = sampled_densely(trajectory, step)
        plain = self._scene.thresholds(margin)
        kept = np.broadcast_to(plain, (len(asked), len(plain)))
        if station:
            inside = tcp_inside(asked, self._scene, station, margin)
            kept = np.where(inside[:, None], self._scene.thresholds(margin, station), plain)
        return self._refined.least(asked, kept)

    def least_distance(self, trajectory: JointTrajectory) -> tuple[float, int]:
        """Least distance of all pairs [m] by Coal, and at how many configurations."""
        asked = sampled_densely(trajectory)
        return min(float(self._coal.distances(q).min()) for q in asked), len(asked)

    def largest_share(self, trajectory: JointTrajectory) -> float:
        """Largest used share of position, speed, acceleration, jerk and torque limits at 10 kHz."""
        robot = self._scene.cell.robot
        times = trajectory.times
        count = max(int(np.ceil((times[-1] - times[0]) * RATE)), 1) + 1
        at = trajectory.sample(np.linspace(times[0], times[-1], count))
        middle = 0.5 * (robot.position_max + robot.position_min)
        half = 0.5 * (robot.position_max - robot.position_min)
        shares = (
            (at.q - middle) / half,
            at.qd / robot.velocity_max,
            at.qdd / robot.acceleration_max,
            at.qddd / robot.jerk_max,
            self._drives.torque(at.q, at.qd, at.qdd) / self._drives.envelope(at.qd),
        )
        return float(max(np.abs(share).max() for share in shares))
