"""Proofs that no path exists, in some tenths of a second, however long searches would look for one.

A barrier: one joint would have to pass a value at which two links of the robot, or the link that
it alone moves and a body, are too near, whatever the other joints do. An enclosure: a ball within
the robot or its load would have to pass where it doesn't fit; walls that enclose an end, or that
part the arm's reach, are recognised. A request that isn't recognised may still be impossible: only
single balls and joints are followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ir_description import Body, RobotModel
from ir_description.shapes import Capsule
from ir_kernels import portable
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import FreeSpace
from ir_planner.scene import PlanningScene
from ir_planner.search import Ends
from ir_values.arrays import BoolArray, FloatArray

# A grid of cubes says where a ball of the robot may be; the clearance on it is never below the true
# one within a cube. A point fixed to a link moves on a continuous curve, within the reach of the
# arm and outside the bodies by its capsule's radius and the distance that the pair must keep. So
# does the ball around it, from cube to neighbouring cube.

FloatArray32 = NDArray[np.float32]
_EDGE = 0.05  # m, of a cube
_CORNER = 0.5 * np.sqrt(3.0) * _EDGE  # from its centre
_NEIGHBOURS = np.ones((3, 3, 3))
_FAR = 1e3  # m
Index = tuple[int, int, int]


class Reach(NamedTuple):
    """Where joint 2 of an arm may be, a circle about the axis (3,) of joint 1 through its origin
    (3,): height above the origin and radius [m]; steps (n - 1,): from each later joint to the next,
    added up.
    """

    origin: FloatArray
    axis: FloatArray
    height: float
    circle: float
    steps: FloatArray

    @staticmethod
    def of(robot: RobotModel, base: FloatArray) -> Reach:
        """Of a robot on its base (4, 4)."""
        frame = portable.matmul(base, robot.joint_origin[0])
        axis = portable.matmul(frame[:3, :3], robot.joint_axis[0])
        shoulder = portable.matmul(frame[:3, :3], robot.joint_origin[1][:3, 3])
        height = float(portable.matmul(shoulder, axis))
        steps = np.cumsum(np.append(0.0, np.linalg.norm(robot.joint_origin[2:, :3, 3], axis=1)))
        return Reach(
            frame[:3, 3], axis, height, float(portable.norm(shoulder - height * axis)), steps
        )

    def beyond_circle(self, link: int, offset: float) -> float:
        """How far from the circle a point of a link >= 2 can be, `offset` m from the origin of its
        frame.
        """
        return float(self.steps[link - 2]) + offset


class BallField(NamedTuple):
    """left (X, Y, Z) m: distance of each cube's centre from the bodies less what they must keep,
    `_FAR` where that is more than any ball needs; nearest (X, Y, Z): number of that body; low (3,):
    the first centre; circle (X, Y, Z) m: distance from where joint 2 may be.
    """

    left: FloatArray32
    nearest: NDArray[np.int32]
    low: FloatArray
    circle: FloatArray32

    @staticmethod
    def of(
        bodies: Sequence[Body], kept: FloatArray, reach: Reach, farthest: float, most: float
    ) -> BallField:
        """Of bodies in the world that must be kept off by kept (B,) m; for points up to `farthest`
        m from where joint 2 may be, and balls of radius up to `most` m.
        """
        half = reach.circle + farthest + abs(reach.height)
        count = int(np.ceil(2.0 * half / _EDGE)) + 1
        low = reach.origin - 0.5 * (count - 1) * _EDGE
        left = np.full((count, count, count), _FAR, np.float32)
        nearest = np.full(left.shape, -1, np.int32)
        for number, (body, own) in enumerate(zip(bodies, kept, strict=True)):
            first, last = _box_around(body, most + own, low, count)
            if (last <= first).any():
                continue
            axes = [low[k] + _EDGE * np.arange(first[k], last[k]) for k in range(3)]
            points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
            part = tuple(slice(a, b) for a, b in zip(first, last, strict=True))
            here = (distance_at_most(body, points) - own).astype(np.float32)
            nearer = here < left[part]
            nearest[part][nearer] = number
            left[part][nearer] = here[nearer]
        return BallField(left, nearest, low, _from_circle(low, count, reach))

    def cube(self, point: FloatArray) -> Index:
        """The cube that a point (3,) lies in."""
        i, j, k = np.round((point - self.low) / _EDGE).astype(int).tolist()
        return i, j, k

    def components(self, needed: float, beyond: float) -> NDArray[np.int32]:
        """Number of the connected component of each cube (X, Y, Z) in which a ball that needs so
        many m may be, up to `beyond` m from where joint 2 may be; 0: in none.
        """
        from scipy.ndimage import label

        there = (self.left > needed - _CORNER) & (self.circle <= beyond + _CORNER)
        return np.asarray(label(there, _NEIGHBOURS)[0], np.int32)

    def beside_widest_exit(self, part: BoolArray) -> int:
        """Number of the body at which what surrounds a part (X, Y, Z) of the space leaves most."""
        from scipy.ndimage import binary_dilation

        around = binary_dilation(part) & ~part & (self.nearest >= 0)
        places = np.flatnonzero(around)
        return int(self.nearest.ravel()[places[np.argmax(self.left.ravel()[places])]])


def _hypot(x: FloatArray, y: FloatArray) -> FloatArray:
    """As np.hypot in the arrays' own precision; lengths of metres can't overflow."""
    return np.asarray(np.sqrt(x * x + y * y))


def _from_circle(low: FloatArray, count: int, reach: Reach) -> FloatArray32:
    """Distance (X, Y, Z) m of the cubes' centres from where joint 2 may be."""
    lines = [
        (low[k] - reach.origin[k] + _EDGE * np.arange(count)).astype(np.float32) for k in range(3)
    ]
    x = lines[0][:, None, None]
    y = lines[1][:, None]
    z = lines[2]
    a, b, c = (np.float32(value) for value in reach.axis)
    along = a * x + b * y + c * z
    across = np.sqrt(np.maximum(x * x + y * y + z * z - along * along, np.float32(0.0)))
    return np.asarray(_hypot(across - np.float32(reach.circle), along - np.float32(reach.height)))


def distance_at_most(body: Body, points: FloatArray) -> FloatArray:
    """A length (...) m that the distance of points (..., 3) from a body does not exceed; not
    negative. Exact, but for meshes: the distance from their nearest vertex.
    """
    local = portable.matmul(points - body.pose[:3, 3], body.pose[:3, :3])
    x, y, z = np.moveaxis(local, -1, 0)
    if body.kind == "plane":
        return np.asarray(np.maximum(z, 0.0))
    if body.kind == "box":
        outside = np.maximum(np.abs(local) - 0.5 * body.size, 0.0)
        return np.asarray(np.linalg.norm(outside, axis=-1))
    if body.kind == "mesh":
        from_vertices = [np.linalg.norm(local - vertex, axis=-1) for vertex in body.vertices]
        return np.asarray(np.min(from_vertices, axis=0))
    radius, length, _ = body.size
    beyond_ends = np.maximum(np.abs(z) - 0.5 * length, 0.0)
    if body.kind == "cylinder":
        beside = np.maximum(_hypot(x, y) - radius, 0.0)
        return np.asarray(_hypot(beside, beyond_ends))
    above = beyond_ends if body.kind == "capsule" else z
    from_core = np.sqrt(x * x + y * y + above * above)
    return np.asarray(np.maximum(from_core - radius, 0.0))


def _box_around(
    body: Body, more: float, low: FloatArray, count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First and past-the-last indices (3,) of the cubes that may be nearer than `more` m to a
    body.
    """
    least, most = body.bounds()
    first = np.clip(np.floor((least - more - low) / _EDGE), 0, count).astype(np.int64)
    last = np.clip(np.ceil((most + more - low) / _EDGE) + 1, 0, count).astype(np.int64)
    return first, last


_FIRST_LINK = 3  # balls of the forearm and of what follows
_HALVINGS = 6  # of the radius, towards the widest passage


class Ball(NamedTuple):
    """A capsule's end: name and link of the capsule, the point (3,) in the link's frame, radius
    [m].
    """

    capsule: str
    link: int
    point: FloatArray
    radius: float


class EndEnclosure(NamedTuple):
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


def enclosure(ends: Ends, space: FreeSpace) -> EndEnclosure | None:
    """What proves that no path leads from the start to any of the goals; None: nothing is proved,
    as ever on a rail, whose reach isn't followed.

    A ball inside of the arm that can't get from where it is at the start to where it is at a goal
    proves it. The largest ball that could is found by bisection: it says how much is missing.
    """
    scene = space.scene
    if scene.chain.first_slides:
        return None
    balls = _balls(space)
    kept = _kept(balls, space)
    bodies = [body for body in scene.cell.bodies() if np.isfinite(kept[body.name])]
    if not bodies or not balls:
        return None
    reach = Reach.of(scene.cell.robot, scene.cell.base_pose)
    beyond = [reach.beyond_circle(ball.link, float(portable.norm(ball.point))) for ball in balls]
    lengths = np.array([kept[body.name] for body in bodies])
    largest = max(ball.radius for ball in balls)
    field = BallField.of(bodies, lengths, reach, farthest=max(beyond), most=largest)
    links = scene.chain.link_poses(np.concatenate([ends.start[None], ends.goals]))
    for ball, farthest in zip(balls, beyond, strict=True):
        cubes = []  # of the field, in which the ball is at the start and at the goals
        for pose in links[:, ball.link]:
            centre = portable.matmul(pose[:3, :3], ball.point) + pose[:3, 3]
            cubes.append(field.cube(centre))
        if _is_joined(field, ball.radius, farthest, cubes):
            continue
        low = 0.0
        high = ball.radius
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            if _is_joined(field, middle, farthest, cubes):
                low = middle
            else:
                high = middle
        part = field.components(high, farthest)
        around_start = part == part[cubes[0]]
        around_goal = part == part[cubes[1]]
        is_goal_smaller = around_goal.sum() <= around_start.sum()
        number = field.beside_widest_exit(around_goal if is_goal_smaller else around_start)
        needed = float(lengths[number])
        return EndEnclosure(
            end="goal" if is_goal_smaller else "start",
            capsule=ball.capsule,
            body=bodies[number].name,
            clearance=needed + low - ball.radius,
            needed=needed,
        )
    return None


def _is_joined(field: BallField, needed: float, farthest: float, cubes: list[Index]) -> bool:
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


# The distance of two capsules depends on the joints between them alone, and not on one that turns a
# capsule about its own axis: forearm and flange of an arm with offsets at its wrist come near at
# one value of axis 5, whatever the others do. That of link 1 from a body depends on the first joint
# alone. Joints don't wrap round, so a path can't avoid a value between its ends.

_VALUES = 181  # of a joint that are tried: 2 degrees apart over a whole turn


class Barrier(NamedTuple):
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
    found = [_barrier_between(ends.start, goal, space, spread) for goal in ends.goals]
    return found[0] if None not in found else None


def _barrier_between(
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
            if capsules[pair.body_a].link == 1:  # nothing but the first joint moves it
                spread[0, number] = 0.0
            continue
        near, far = sorted((capsules[pair.body_a], capsules[pair.body_b]), key=lambda c: c.link)
        if near.link < robot.base:
            continue
        between = set(range(near.link, far.link))
        turns = _moved_by_joints(near, far, scene)
        for joint in between:
            others = between - {joint}
            if others <= set(turns):
                spread[joint, number] = sum(turns[other] for other in others)
    return spread


def _moved_by_joints(near: Capsule, far: Capsule, scene: PlanningScene) -> dict[int, float]:
    """How far [m] the ends of two capsules move as the joints next to them turn: nothing on their
    axes.
    """
    robot = scene.cell.robot
    first = near.link
    last = far.link - 1
    if first >= last:
        return {}
    origin = robot.joint_origin[first]
    before = _distance_from_axis(
        near, origin[:3, 3], portable.matmul(origin[:3, :3], robot.joint_axis[first])
    )
    return {
        first: 2.0 * before,
        last: 2.0 * _distance_from_axis(far, np.zeros(3), robot.joint_axis[last]),
    }


def _distance_from_axis(capsule: Capsule, point: FloatArray, axis: FloatArray) -> float:
    """Distance [m] of the farther end of a capsule from an axis through a point, in the capsule's
    frame.
    """
    ends = np.stack([capsule.p0, capsule.p1]) - point
    return float(np.linalg.norm(np.cross(ends, axis / portable.norm(axis)), axis=1).max())
