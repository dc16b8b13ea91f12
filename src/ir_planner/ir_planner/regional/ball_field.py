"""Where a ball of the robot may be: clearance on a grid of cubes, never below what is true within
them.

A point fixed to a link moves on a continuous curve, within the reach of the arm and outside the
bodies by its capsule's radius and what the pair must keep. So does the ball around it, from cube to
neighbouring cube.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label

from ir_description import Body, RobotModel
from ir_kernels import portable
from ir_msgs_py.arrays import BoolArray, FloatArray

FloatArray32 = NDArray[np.float32]
_EDGE = 0.05  # m, of a cube
_CORNER = 0.5 * np.sqrt(3.0) * _EDGE  # from its centre
_NEIGHBOURS = np.ones((3, 3, 3))
_FAR = 1e3  # m
Index = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Reach:
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
    def of(robot: RobotModel, base: FloatArray) -> "Reach":
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


@dataclass(frozen=True, eq=False)
class BallField:
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
    ) -> "BallField":
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
        there = (self.left > needed - _CORNER) & (self.circle <= beyond + _CORNER)
        return np.asarray(label(there, _NEIGHBOURS)[0], np.int32)

    def beside_widest_exit(self, part: BoolArray) -> int:
        """Number of the body at which what surrounds a part (X, Y, Z) of the space leaves most."""
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
    negative. Exact,
    but for meshes: the distance from their nearest vertex.
    """
    local = portable.matmul(points - body.pose[:3, 3], body.pose[:3, :3])
    x, y, z = np.moveaxis(local, -1, 0)
    if body.kind == "plane":
        return np.asarray(np.maximum(z, 0.0))
    if body.kind == "box":
        return np.asarray(np.linalg.norm(np.maximum(np.abs(local) - 0.5 * body.size, 0.0), axis=-1))
    if body.kind == "mesh":
        return np.asarray(
            np.min([np.linalg.norm(local - v, axis=-1) for v in body.vertices], axis=0)
        )
    radius, length, _ = body.size
    if body.kind == "cylinder":
        beside = np.maximum(_hypot(x, y) - radius, 0.0)
        return np.asarray(_hypot(beside, np.maximum(np.abs(z) - 0.5 * length, 0.0)))
    above = np.maximum(np.abs(z) - 0.5 * length, 0.0) if body.kind == "capsule" else z
    return np.asarray(np.maximum(np.sqrt(x * x + y * y + above * above) - radius, 0.0))


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
