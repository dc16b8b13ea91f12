"""Proofs that no path exists: a ball within the robot or its load would have to pass where it
doesn't fit.

Walls that enclose an end, or that part the arm's reach, are recognised in some tenths of a second,
however long searches would look for a path. What isn't recognised may still be impossible: only
single balls are followed.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import FreeSpace
from ir_planner.regional.ball_field import BallField, Index, Reach
from ir_planner.search import Ends

_FIRST_LINK = 3  # balls of the forearm and of what follows
_HALVINGS = 6  # of the radius, towards the widest passage


@dataclass(frozen=True, eq=False)
class Ball:
    """A capsule's end: name and link of the capsule, the point (3,) in the link's frame, radius
    [m].
    """

    capsule: str
    link: int
    point: FloatArray
    radius: float


@dataclass(frozen=True, eq=False)
class Enclosure:
    """end: "start" or "goal", that which is in the smaller part of the space; the capsule that
    can't leave it, the body at the widest passage out of it, the clearance there and what the pair
    must keep [m].
    """

    end: str
    capsule: str
    body: str
    clearance: float
    needed: float

    @property
    def status(self) -> Status:
        """The status for a request that can't be met."""
        needed = 1e3 * self.needed
        return Status(
            StatusCode.PLANNING_FAILED,
            f"no path exists: the {self.end} is enclosed: {self.capsule} can't get out past "
            f"{self.body}; where the passage is widest, the two come to {1e3 * self.clearance:.0f} "
            f"mm at most, {needed - 1e3 * self.clearance:.0f} mm below the {needed:.1f} mm they "
            "must keep; another configuration, an open door, or a smaller safety distance, may "
            "help",
        )


def enclosure(ends: Ends, space: FreeSpace) -> Enclosure | None:
    """What proves that no path leads from the start to any of the goals; None: nothing is
    proved.
    """
    scene = space.scene
    balls = _balls(space)
    kept = _kept(balls, space)
    bodies = [body for body in scene.cell.bodies() if np.isfinite(kept[body.name])]
    if not bodies or not balls:
        return None
    reach = Reach.of(scene.cell.robot, scene.cell.base_pose)
    beyond = [reach.beyond_circle(ball.link, float(portable.norm(ball.point))) for ball in balls]
    lengths = np.array([kept[body.name] for body in bodies])
    field = BallField.of(bodies, lengths, reach, max(beyond), max(ball.radius for ball in balls))
    links = scene.chain.link_poses(np.concatenate([ends.start[None], ends.goals]))
    for ball, farthest in zip(balls, beyond, strict=True):
        cubes = [
            field.cube(portable.matmul(pose[:3, :3], ball.point) + pose[:3, 3])
            for pose in links[:, ball.link]
        ]
        if _joined(field, ball.radius, farthest, cubes):
            continue
        low = 0.0
        high = ball.radius
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if _joined(field, middle, farthest, cubes) else (low, middle)
        part = field.components(high, farthest)
        start, goal = (part == part[cube] for cube in cubes[:2])
        end, inside = ("goal", goal) if goal.sum() <= start.sum() else ("start", start)
        number = field.beside_widest_exit(inside)
        clearance = float(lengths[number]) + low - ball.radius
        return Enclosure(end, ball.capsule, bodies[number].name, clearance, float(lengths[number]))
    return None


def _joined(field: BallField, needed: float, farthest: float, cubes: list[Index]) -> bool:
    """Whether the first cube and any other are in one component."""
    part = field.components(needed, farthest)
    return any(part[cube] == part[cubes[0]] for cube in cubes[1:])


def _kept(balls: list[Ball], space: FreeSpace) -> dict[str, float]:
    """What the balls' capsules must keep off each body [m]; -inf where one needn't."""
    capsules = {ball.capsule for ball in balls}
    least = {body.name: np.inf for body in space.scene.cell.bodies()}
    count = dict.fromkeys(least, 0)
    for pair, threshold in zip(space.scene.collision.pairs, space.threshold, strict=True):
        if pair.body_b in least and pair.body_a in capsules:
            least[pair.body_b] = min(least[pair.body_b], float(threshold))
            count[pair.body_b] += 1
    return {name: least[name] if count[name] == len(capsules) else -np.inf for name in least}


def _balls(space: FreeSpace) -> list[Ball]:
    """The ends of the thickest capsule of the load, and of the thickest one of the wrist and
    forearm.
    """
    robot = [c for c in space.scene.cell.robot.capsules if c.link >= _FIRST_LINK]
    load = [c for one in space.scene.loads for c in one.capsules]
    thickest = [max(some, key=lambda c: c.radius) for some in (load, robot) if some]
    return [Ball(c.name, c.link, point, c.radius) for c in thickest for point in (c.p0, c.p1)]
