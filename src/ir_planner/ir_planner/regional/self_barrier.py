"""Proofs that no path exists: one joint would have to pass a value at which two links are too near.

The distance of two capsules depends on the joints between them alone, and not on one that turns a
capsule
about its own axis: forearm and flange of an arm with offsets at its wrist come near at one value of
axis 5, whatever the others do. Joints don't wrap round, so a path can't avoid a value between its
ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ir_description import Capsule
from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import FreeSpace
from ir_planner.scene import PlanningScene
from ir_planner.search import Ends

_VALUES = 181  # of a joint that are tried: 2 degrees apart over a whole turn


@dataclass(frozen=True)
class Barrier:
    """The value [rad] of a joint that no path passes, the pair that is too near there whatever the
    other joints are, the largest distance that it has there and what it must keep [m].
    """

    joint: str
    value: float
    pair: tuple[str, str]
    distance: float
    needed: float

    @property
    def status(self) -> Status:
        """The status for a request that can't be met."""
        first, second = self.pair
        return Status(
            StatusCode.PLANNING_FAILED,
            f"no path exists: {self.joint} would have to pass {np.degrees(self.value):.0f} deg, "
            f"where {first} and {second} are {1e3 * self.distance:.0f} mm apart at most, below the "
            f"{1e3 * self.needed:.1f} mm they must keep; another configuration, or a smaller "
            "safety distance, may help",
        )


def barrier(ends: Ends, space: FreeSpace) -> Barrier | None:
    """What proves that no path leads from the start to any of the goals, shown for the first."""
    spread = spreads(space.scene)
    found = [_between(ends.start, goal, space, spread) for goal in ends.goals]
    return found[0] if None not in found else None


def _between(
    start: FloatArray, goal: FloatArray, space: FreeSpace, spread: FloatArray
) -> Barrier | None:
    """The barrier of one goal (n,) that lacks most."""
    best = None
    worst = 0.0
    for joint in np.flatnonzero(np.isfinite(spread).any(axis=1) & (start != goal)):
        q = np.tile(start, (_VALUES, 1))
        q[:, joint] = np.linspace(start[joint], goal[joint], _VALUES)
        most = space.scene.collision.distances(q) + spread[joint]
        lacking = most - space.threshold
        sample, pair = np.unravel_index(np.argmin(lacking), lacking.shape)
        if lacking[sample, pair] < worst:
            worst = lacking[sample, pair]
            names = space.scene.collision.pairs[pair]
            best = Barrier(
                space.scene.cell.robot.joint_names[joint],
                float(q[sample, joint]),
                (names.body_a, names.body_b),
                float(most[sample, pair]),
                float(space.threshold[pair]),
            )
    return best


def spreads(scene: PlanningScene) -> FloatArray:
    """How far (n, Z) [m] the distance of a pair changes at most while one joint keeps its value;
    inf where that isn't bounded.
    """
    robot = scene.cell.robot
    capsules = {
        c.name: c for c in (*robot.capsules, *(c for one in scene.loads for c in one.capsules))
    }
    spread = np.full((len(robot.joint_names), len(scene.collision.pairs)), np.inf)
    for number, pair in enumerate(scene.collision.pairs):
        if pair.body_b not in capsules:
            continue
        near, far = sorted((capsules[pair.body_a], capsules[pair.body_b]), key=lambda c: c.link)
        between = set(range(near.link, far.link))
        turns = _turned(near, far, scene)
        for joint in between:
            others = between - {joint}
            if others <= set(turns):
                spread[joint, number] = sum(turns[other] for other in others)
    return spread


def _turned(near: Capsule, far: Capsule, scene: PlanningScene) -> dict[int, float]:
    """How far [m] the ends of two capsules move as the joints next to them turn: nothing on their
    axes.
    """
    robot = scene.cell.robot
    first = near.link
    last = far.link - 1
    if first >= last:
        return {}
    origin = robot.joint_origin[first]
    before = _beside(near, origin[:3, 3], portable.matmul(origin[:3, :3], robot.joint_axis[first]))
    return {first: 2.0 * before, last: 2.0 * _beside(far, np.zeros(3), robot.joint_axis[last])}


def _beside(capsule: Capsule, point: FloatArray, axis: FloatArray) -> float:
    """Distance [m] of the farther end of a capsule from an axis through a point, in the capsule's
    frame.
    """
    ends = np.stack([capsule.p0, capsule.p1]) - point
    return float(np.linalg.norm(np.cross(ends, axis / portable.norm(axis)), axis=1).max())
