"""The robot as Bullet computes with it exactly: a body per link, in its principal axes, its loads
merged.

Bullet turns an inertia into its principal axes, moves it to the joint by -m x y and -m y x, and
refuses what rounding leaves unsymmetrical by 1e-15 kg m^2. Given in principal axes nothing is
turned; and some mass within parts in a trillion gives the same products in either order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ir_description import Load, RobotModel
from ir_msgs_py.arrays import FloatArray

_ULPS = 1000  # of a figure that are tried, relative 2e-13; one mass in ten is exact
_THICKNESS = 1e-6  # share of the largest principal moment; a thousand times finer than it is known


class Body(NamedTuple):
    """A link: mass [kg], centre (3,) [m] and principal moments (3,) [kg m^2] about it in its frame,
    whose pose in that of the link before is pose (4, 4); it turns about axis (3,).
    """

    mass: float
    com: FloatArray
    moments: FloatArray
    pose: FloatArray
    axis: FloatArray


def bodies_of(robot: RobotModel, loads: Sequence[Load]) -> list[Body]:
    """The n bodies that move; the loads (in the last link's frame) are parts of the last one."""
    bodies = []
    before = np.eye(3)
    for i in range(robot.n):
        own = robot.link_mass[i + 1], robot.link_com[i + 1], robot.link_inertia[i + 1]
        carried = loads if i == robot.n - 1 else ()
        mass, com, inertia = _merged(
            [own, *((load.mass, load.com, load.inertia) for load in carried)]
        )
        moments, turn = np.linalg.eigh(inertia)
        turn[:, 0] *= np.linalg.det(turn)
        pose = np.array(robot.joint_origin[i])
        pose[:3, 3] = before.T @ pose[:3, 3]
        pose[:3, :3] = before.T @ pose[:3, :3] @ turn
        axis = _unit(turn.T @ np.asarray(robot.joint_axis[i]))
        com = turn.T @ com
        bodies.append(Body(_symmetrical(mass, com), com, _thick(moments), pose, axis))
        before = turn
    return bodies


def urdf_of(robot: RobotModel, bodies: Sequence[Body]) -> str:
    """The URDF text of the bodies on a base that is fixed."""
    low = np.array(robot.position_min).tolist()
    high = np.array(robot.position_max).tolist()
    parts = [_link(0, 1.0, np.zeros(3), np.ones(3))]
    for i, body in enumerate(bodies):
        parts.append(_link(i + 1, body.mass, body.com, body.moments))
        parts.append(
            f'<joint name="{i + 1}" '
            f'type="revolute">{_origin(body.pose[:3, 3], _rpy(body.pose[:3, :3]))}'
            f'<parent link="{i}"/><child link="{i + 1}"/><axis xyz="{_row(body.axis)}"/>'
            f'<limit lower="{low[i]!r}" upper="{high[i]!r}" velocity="0" effort="0"/></joint>'
        )
    return f'<robot name="plant">{"".join(parts)}</robot>'


def _merged(
    parts: Sequence[tuple[float, FloatArray, FloatArray]],
) -> tuple[float, FloatArray, FloatArray]:
    """Mass, centre (3,) and inertia (3, 3) about it of rigid bodies, given so each."""
    mass = float(sum(m for m, _, _ in parts))
    com = sum((m * np.asarray(c) for m, c, _ in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for m, c, own in parts:
        off = np.asarray(c) - com
        inertia += np.asarray(own) + m * (off @ off * np.eye(3) - np.outer(off, off))
    return mass, com, 0.5 * (inertia + inertia.T)


def _thick(moments: FloatArray) -> FloatArray:
    """Principal moments (3,), rising, that Bullet does not take for impossible by rounding, and for
    zero
    then: a flat disc fulfils their triangle inequality with equality.
    """
    if moments[0] + moments[1] - moments[2] > _THICKNESS * moments[2]:
        return moments
    thicker: FloatArray = moments + _THICKNESS * moments[2]
    return thicker


def _unit(axis: FloatArray) -> FloatArray:
    """The axis (3,) with a length of 1 to the last bit, as Bullet has a sentence for any other."""
    axis = axis / np.linalg.norm(axis)
    largest = int(np.abs(axis).argmax())
    for _ in range(_ULPS):
        length = math.sqrt(sum(x * x for x in axis.tolist()))
        if length == 1.0:
            break
        axis[largest] = np.nextafter(axis[largest], 0.0 if length > 1.0 else 2.0 * axis[largest])
    return axis


def _symmetrical(mass: float, com: FloatArray) -> float:
    """The nearest mass above whose products with the coordinates of the centre commute in floating
    point.
    """
    x, y, z = com.tolist()
    for _ in range(_ULPS):
        if all((mass * a) * b == (mass * b) * a for a, b in ((x, y), (x, z), (y, z))):
            break
        mass = math.nextafter(mass, math.inf)
    return mass


def _link(i: int, mass: float, com: FloatArray, moments: FloatArray) -> str:
    ixx, iyy, izz = moments.tolist()
    return (
        f'<link name="{i}"><inertial>{_origin(com, np.zeros(3))}<mass value="{mass!r}"/><inertia '
        f'ixx="{ixx!r}" ixy="0" ixz="0" iyy="{iyy!r}" iyz="0" izz="{izz!r}"/></inertial></link>'
    )


def _origin(xyz: FloatArray, rpy: FloatArray) -> str:
    return f'<origin xyz="{_row(xyz)}" rpy="{_row(rpy)}"/>'


def _row(values: FloatArray) -> str:
    return " ".join(repr(x) for x in values.tolist())


def _rpy(R: FloatArray) -> FloatArray:
    """Roll, pitch, yaw [rad] of a rotation (3, 3). Roll is taken behind yaw, so that next to a
    pitch of 90 degrees, where yaw is hardly known, their sum still is.
    """
    yaw = np.arctan2(R[1, 0], R[0, 0])
    sin = np.sin(yaw)
    cos = np.cos(yaw)
    pitch = np.arctan2(-R[2, 0], cos * R[0, 0] + sin * R[1, 0])
    roll = np.arctan2(sin * R[0, 2] - cos * R[1, 2], cos * R[1, 1] - sin * R[0, 1])
    return np.array((roll, pitch, yaw))
