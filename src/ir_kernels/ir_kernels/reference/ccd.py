"""Cyclic coordinate descent on the pose error (eq. 3), batched over starts, with an optional Newton
finish.

Psi = |p - p*|^2 + (lambda^2 / 2) |R - R*|_F^2 (eq. 2). As a function of one joint's increment phi
it is const - 2 ((k2 - k1) cos phi + k3 sin phi): the minimum is closed form, and at limits the
better one of both.
"""

from typing import NamedTuple

import numpy as np

from ir_kernels import portable
from ir_kernels.reference.chain import axes, axis_rotation, jacobian, link_poses
from ir_values.arrays import FloatArray, IntArray

DAMPING_START = 1e-4
DAMPING_DOWN = 0.1
DAMPING_UP = 10.0
DAMPING_LEAST = 1e-12
DAMPING_MOST = 1e6


class Problem(NamedTuple):
    """Chain (origins, axes, base, tcp), pose (4, 4) in the world, limits (n,), lambda [m/rad] of
    eq. 2.
    """

    joint_origin: FloatArray
    joint_axis: FloatArray
    base_pose: FloatArray
    tcp: FloatArray
    pose: FloatArray
    position_min: FloatArray
    position_max: FloatArray
    rotation_length: float


def tcp_poses(problem: Problem, q: FloatArray) -> FloatArray:
    """Poses of the tcp (P, 4, 4) in the world at q (P, n)."""
    links = link_poses(problem.joint_origin, problem.joint_axis, problem.base_pose, q)
    return np.asarray(portable.matmul(links[:, -1], problem.tcp))


def psi(problem: Problem, poses: FloatArray) -> FloatArray:
    """Eq. 2 for tcp poses (P, 4, 4)."""
    step = poses[:, :3, 3] - problem.pose[:3, 3]
    turn = poses[:, :3, :3] - problem.pose[:3, :3]
    weight = problem.rotation_length**2 / 2.0
    return np.asarray((step**2).sum(axis=1) + weight * (turn**2).sum(axis=(1, 2)))


def rotation_vector(R: FloatArray) -> FloatArray:
    """Axis times angle (P, 3) of rotations (P, 3, 3), accurate for small angles and usable near
    pi.
    """
    twice_sine = np.stack(
        [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=1
    )
    length = np.linalg.norm(twice_sine, axis=1)
    angle = portable.arctan2(length, np.trace(R, axis1=1, axis2=2) - 1.0)
    return np.asarray(
        twice_sine * np.where(length > 1e-12, angle / np.maximum(length, 1e-12), 0.5)[:, None]
    )


def errors(problem: Problem, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Psi, distance [m] and rotation angle [rad] (P,) at q (P, n)."""
    poses = tcp_poses(problem, q)
    relative = portable.matmul(np.swapaxes(poses[:, :3, :3], 1, 2), problem.pose[:3, :3])
    sine = np.linalg.norm(
        np.stack(
            [
                relative[:, 2, 1] - relative[:, 1, 2],
                relative[:, 0, 2] - relative[:, 2, 0],
                relative[:, 1, 0] - relative[:, 0, 1],
            ]
        ),
        axis=0,
    )
    angle = portable.arctan2(sine, np.trace(relative, axis1=1, axis2=2) - 1.0)
    return psi(problem, poses), np.linalg.norm(poses[:, :3, 3] - problem.pose[:3, 3], axis=1), angle


def coefficients(
    problem: Problem, z: FloatArray, o: FloatArray, pose: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """k1, k2, k3 (P,) of eq. 3 for axes z (P, 3) through o (P, 3) and tcp poses (P, 4, 4)."""
    wo = problem.rotation_length**2 / 2.0
    Pc = pose[:, :3, 3] - o
    Pt = problem.pose[:3, 3] - o
    uc = pose[:, :3, :3]
    ut = problem.pose[:3, :3]
    along_c = np.einsum("pij,pi->pj", uc, z)
    along_t = np.einsum("ij,pi->pj", ut, z)
    k1 = np.einsum("pi,pi->p", Pt, z) * np.einsum("pi,pi->p", Pc, z) + wo * (along_c * along_t).sum(
        axis=1
    )
    k2 = np.einsum("pi,pi->p", Pt, Pc) + wo * np.einsum("pij,ij->p", uc, ut)
    turned = np.cross(Pc, Pt) + wo * np.cross(uc, np.broadcast_to(ut, uc.shape), axis=1).sum(axis=2)
    return k1, k2, np.einsum("pi,pi->p", z, turned)


def best_value(
    q: FloatArray, k1: FloatArray, k2: FloatArray, k3: FloatArray, low: float, high: float
) -> FloatArray:
    """The joint value (P,) within [low, high] that minimises Psi, of equal ones the nearest to q
    (P,).
    """
    free = q + portable.arctan2(k3, k2 - k1)
    turns = 2.0 * np.pi * np.arange(-1, 2)
    candidates = free[:, None] + turns
    inside = (candidates >= low) & (candidates <= high)
    distance = np.where(inside, np.abs(candidates - q[:, None]), np.inf)
    nearest = np.take_along_axis(candidates, distance.argmin(axis=1)[:, None], axis=1)[:, 0]

    def gain(value: float) -> FloatArray:
        return np.asarray((k2 - k1) * portable.cos(value - q) + k3 * portable.sin(value - q))

    at_limit = np.where(gain(low) >= gain(high), low, high)
    return np.where(inside.any(axis=1), nearest, at_limit)


def sweep(problem: Problem, q: FloatArray) -> FloatArray:
    """One pass over the joints, from the tool to the base: new configurations (P, n) of q (P, n).

    Each joint takes the value of least cost while all others stay (eqs. 1 to 6).
    """
    q = q.copy()
    links = link_poses(problem.joint_origin, problem.joint_axis, problem.base_pose, q)
    origin, direction = axes(problem.joint_axis, links)
    pose = portable.matmul(links[:, -1], problem.tcp)
    for i in reversed(range(q.shape[1])):
        k1, k2, k3 = coefficients(problem, direction[:, i], origin[:, i], pose)
        low = float(problem.position_min[i])
        high = float(problem.position_max[i])
        value = best_value(q[:, i], k1, k2, k3, low, high)
        change = value - q[:, i]
        for p in range(len(q)):  # the joints inside of i stay: only the tool turns about axis i
            turn = axis_rotation(direction[p, i], change[p : p + 1])[0]
            from_axis = pose[p, :3, 3] - origin[p, i]
            pose[p, :3, :3] = portable.matmul(turn, pose[p, :3, :3])
            pose[p, :3, 3] = origin[p, i] + portable.matmul(turn, from_axis)
        q[:, i] = value
    return q


def newton_step(problem: Problem, q: FloatArray, damping: FloatArray) -> FloatArray:
    """Damped least-squares step (P, n), held at limits: joints at a limit that would leave it are
    fixed.
    """
    links = link_poses(problem.joint_origin, problem.joint_axis, problem.base_pose, q)
    J = jacobian(problem.joint_axis, links, problem.tcp)
    pose = portable.matmul(links[:, -1], problem.tcp)
    turn = rotation_vector(
        portable.matmul(problem.pose[:3, :3], np.swapaxes(pose[:, :3, :3], 1, 2))
    )
    error = np.concatenate(
        [problem.pose[:3, 3] - pose[:, :3, 3], problem.rotation_length * turn], axis=1
    )
    J[:, 3:] *= problem.rotation_length
    gradient = np.einsum("pij,pi->pj", J, error)
    held = ((q <= problem.position_min) & (gradient < 0.0)) | (
        (q >= problem.position_max) & (gradient > 0.0)
    )
    J = np.where(held[:, None, :], 0.0, J)
    normal = portable.matmul(np.swapaxes(J, 1, 2), J) + damping[:, None, None] * np.eye(q.shape[1])
    step = portable.solve(normal, np.where(held, 0.0, gradient)[:, :, None])[:, :, 0]
    return np.asarray(np.clip(q + step, problem.position_min, problem.position_max))


def run(
    problem: Problem,
    starts: FloatArray,
    xi: float,
    max_sweeps: int,
    newton_steps: int,
    newton_tolerance: float,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray, IntArray]:
    """q (P, n), Psi, distance, angle (P,), sweeps and Newton steps spent (P,) of every start on its
    own.
    """
    q = np.clip(starts, problem.position_min, problem.position_max)
    value = psi(problem, tcp_poses(problem, q))
    sweeps = np.zeros(len(q), np.int64)
    steps = np.zeros(len(q), np.int64)
    for _ in range(max_sweeps):
        going = np.flatnonzero(value >= xi)
        if len(going) == 0:
            break
        q[going] = sweep(problem, q[going])
        value[going] = psi(problem, tcp_poses(problem, q[going]))
        sweeps[going] += 1
    damping = np.full(len(q), DAMPING_START)
    for _ in range(newton_steps):
        going = np.flatnonzero((value >= newton_tolerance) & (damping < DAMPING_MOST))
        if len(going) == 0:
            break
        tried = newton_step(problem, q[going], damping[going])
        tried_value = psi(problem, tcp_poses(problem, tried))
        better = tried_value < value[going]
        q[going] = np.where(better[:, None], tried, q[going])
        value[going] = np.where(better, tried_value, value[going])
        factor = np.where(better, DAMPING_DOWN, DAMPING_UP)
        damping[going] = np.maximum(damping[going] * factor, DAMPING_LEAST)
        steps[going] += 1
    return q, *errors(problem, q), sweeps, steps
