"""How parts of a path are joined at the corner between them, and by how much that leaves the
parts.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import TANGENT, CartesianPath
from ir_planner.cartesian.parts import Part
from ir_planner.cartesian.tool_path import ToolPath, covered, joint_bend
from ir_planner.curves import turn_of

SMOOTHING = (
    2e-5  # m by which a smoothed joint may leave the parts, well below the 0.1 mm of the whole
)
SMOOTHING_TURN = 5e-4  # rad
SHORTEST_JOINT = 1e-3  # m: a smaller radius is a corner
_LONGEST_JOINT = 0.05  # m
_TANGENT = np.radians(2.0)  # parts that meet at less are smoothed, whatever the radius asked for
REVERSAL = np.radians(175.0)  # beyond, a rounded corner would come to a stand
_SHRINK = 0.8
_SAMPLES = 129


@dataclass(frozen=True)
class Joint:
    """radius [m], 0: the tool stops; angle [rad] of the corner; leaves, turns: by what smoothing
    leaves the parts [m, rad]; rounded: as asked for, which leaves them on purpose.
    """

    radius: float
    angle: float
    leaves: float = 0.0
    turns: float = 0.0
    rounded: bool = False


def joined(path: CartesianPath, parts: tuple[Part, ...]) -> tuple[ToolPath, tuple[Joint, ...]]:
    """The parts one after the other, and the joints between them; approach and retract are not
    rounded.
    """
    joints = tuple(
        joint_between(before, after, path.blending_radius if before.kept and after.kept else 0.0)
        for before, after in itertools.pairwise(parts)
    )
    radius = np.array([0.0, *(joint.radius for joint in joints), 0.0])
    return ToolPath(parts, radius, path.orientation == TANGENT), joints


def joint_between(before: Part, after: Part, asked: float) -> Joint:
    """How two parts are joined, with the radius [m] that is asked for."""
    half = 0.5 * min(before.length, after.length)
    first = before.places.tangent(np.array([before.length]))[0]
    second = after.places.tangent(np.array([0.0]))[0]
    angle = float(
        portable.arctan2(portable.norm(np.cross(first, second)), portable.matmul(first, second))
    )
    if angle > REVERSAL:
        return Joint(0.0, angle)
    if asked > 0.0 and angle > _TANGENT:
        return Joint(min(asked, half), angle, rounded=True)
    radius = min(_LONGEST_JOINT, half)
    shortest = min(SHORTEST_JOINT, half) if angle < _TANGENT else SHORTEST_JOINT
    while radius >= shortest:
        leaves, turns = _left_by(before, after, radius)
        if leaves <= SMOOTHING and turns <= SMOOTHING_TURN:
            return Joint(radius, angle, leaves, turns)
        radius *= _SHRINK
    return Joint(min(asked, half), angle, rounded=asked > 0.0)


def _left_by(before: Part, after: Part, radius: float) -> tuple[float, float]:
    """A bound of the distance [m], and the largest turn [rad], between joined and unjoined parts at
    the same length.
    """
    u = np.linspace(-radius, radius, _SAMPLES)
    left = before.length - covered(-u, radius)
    right = covered(u, radius)
    corner = after.places.at(np.array([0.0]))
    place = before.places.at(left) + after.places.at(right) - corner
    exact = np.where(
        (u < 0.0)[:, None],
        before.places.at(np.minimum(before.length + u, before.length)),
        after.places.at(np.maximum(u, 0.0)),
    )
    there = after.turning.at(np.array([0.0]))[0]
    turned = portable.matmul(before.turning.at(left), there.T, after.turning.at(right))
    asked = np.where(
        (u < 0.0)[:, None, None],
        before.turning.at(np.minimum(before.length + u, before.length)),
        after.turning.at(np.maximum(u, 0.0)),
    )
    bends = max(before.places.curvature, after.places.curvature) + joint_bend(before, after, radius)
    between = bends * np.square(u[1] - u[0]) / 8.0
    return _largest(place - exact) + between, _turn(asked, turned)


def _largest(difference: FloatArray) -> float:
    return float(np.linalg.norm(difference, axis=1).max())


def _turn(first: FloatArray, second: FloatArray) -> float:
    return float(turn_of(portable.matmul(first.transpose(0, 2, 1), second)).max())
