"""Random paths of the tool in a cell, and an oracle that looks for somebody who can drive a
path.
"""

from __future__ import annotations

import itertools

import numpy as np
from _drives import Drives
from scipy.interpolate import BSpline, PchipInterpolator, make_interp_spline
from scipy.spatial.transform import Rotation

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_planner.cartesian.path_parts import parts_of
from ir_planner.cartesian.tool_path import ToolPath, joined
from ir_planner.scene import PlanningScene

MARGIN = 0.02  # m
# m, m/s
_LENGTHS = (0.15, 0.9)
_SPEEDS = (0.05, 0.4)
_TURN = np.radians(30.0)
_DRAWS = 40  # of the oracle
# m between its samples, rad between two of them
_STEP = 5e-3
_JUMP = 0.2
# m, where axes jump, and in how many draws
_FINE_STEP = 6e-4
_FINE_DRAWS = 2
_BEND = 0.3  # rad
_SLOWER = 0.9  # of the tolerance of the speed
# m that the tool may be off the path, and rad
_ERROR = 1e-4
_TURNED = 1e-2
# s of a ramp, and how many are tried at each end
_SHORTEST = 0.02
_RAMPS = 9
_ASKED = 100  # configurations at which torque is asked for


def random_path(rng: np.random.Generator, scene: PlanningScene) -> CartesianPath:
    """A path whose ends can be reached without collision: line, circle, spline or corner, the angle
    about the tool's axis free or not.
    """
    while True:
        path = _drawn(rng, scene)
        ends = [path.start, *(segment.poses[-1] for segment in path.segments)]
        if all(_reached(end, scene) for end in ends):
            return path


def _reached(pose: FloatArray, scene: PlanningScene) -> bool:
    q = scene.inverse_kinematics.solve(pose[None]).q
    return bool(len(q) and scene.collision.is_free(q, scene.thresholds(MARGIN)).any())


def _drawn(rng: np.random.Generator, scene: PlanningScene) -> CartesianPath:
    robot = scene.cell.robot
    start = scene.chain.tcp_poses(rng.uniform(robot.position_min, robot.position_max)[None])[0]
    ahead, aside, _ = Rotation.random(random_state=rng).as_matrix()
    length = rng.uniform(*_LENGTHS)
    turn = (
        rng.uniform(0.0, _TURN)
        * rng.integers(0, 2)
        * Rotation.random(random_state=rng).as_matrix()[0]
    )

    def pose(share: float, off: float) -> FloatArray:
        result = np.array(start)
        result[:3, 3] += length * (share * ahead + off * aside)
        result[:3, :3] = start[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
        return result

    kind = rng.integers(0, 4)
    off = rng.uniform(0.05, 0.4)
    segments: tuple[CartesianSegment, ...]
    if kind == 0:
        segments = (CartesianSegment("line", (pose(1.0, 0.0),)),)
    elif kind == 1:
        segments = (CartesianSegment("circle", (pose(0.5, off), pose(1.0, 0.0))),)
    elif kind == 2:
        inner = [pose(share, rng.uniform(-0.15, 0.15)) for share in (0.3, 0.6)]
        segments = (CartesianSegment("spline", (*inner, pose(1.0, 0.0))),)
    else:
        segments = tuple(
            CartesianSegment("line", (one,)) for one in (pose(0.5, off), pose(1.0, 0.0))
        )
    return CartesianPath(
        start,
        segments,
        tool_speed=float(np.exp(rng.uniform(*np.log(_SPEEDS)))),
        blending_radius=0.1 * length if kind == 3 else 0.0,
        free_angle=float(rng.choice([0.0, 0.0, 0.5, np.pi])),
    )


def oracle(path: CartesianPath, scene: PlanningScene, rng: np.random.Generator) -> bool:
    """Whether some configuration, followed from the start with an angle that is constant, changes
    evenly or bends, keeps to the path, axis limits, distances, speeds, accelerations and torque
    from rest to rest, at the speed asked for or as much slower as its tolerance allows. Where axes
    jump, samples are closer.

    It keeps the reserve of torque that the planner leaves to the feedback in every movement.
    """
    whole, _ = joined(path, parts_of(path))
    draws = _DRAWS if path.free_angle > 0.0 else 1
    for draw in range(draws):
        values = _angles(path.free_angle, draw, rng)
        steps = (_STEP, _FINE_STEP) if draw < _FINE_DRAWS else (_STEP,)
        if any(_driven(path, whole, values, step, scene) for step in steps):
            return True
    return False


def _angles(free_angle: float, draw: int, rng: np.random.Generator) -> FloatArray:
    """Angles (4,) rad at even places: one, an even change, or a bend, in turn."""
    first, last = rng.uniform(-free_angle, free_angle, 2)
    even = np.linspace(first, first if draw % 3 == 0 else last, 4)
    bend = rng.uniform(-_BEND, _BEND, 4) if draw % 3 == 2 else 0.0
    return np.clip(even + bend, -free_angle, free_angle)


def _driven(
    path: CartesianPath, whole: ToolPath, values: FloatArray, step: float, scene: PlanningScene
) -> bool:
    """Whether the path is driven with an angle through values (4,) rad, asked every `step` m."""
    s = np.linspace(0.0, whole.length, max(int(whole.length / step), 20))
    angle = PchipInterpolator(np.linspace(0.0, whole.length, len(values)), values)
    middle = 0.5 * (s[1:] + s[:-1])
    poses = _turned(whole, s, angle)
    between = _turned(whole, middle, angle)
    found = scene.inverse_kinematics.solve(poses)
    sets = [found.of_pose(k) for k in range(len(s))]
    slowest = path.tool_speed * (1.0 - _SLOWER * path.speed_tolerance)
    for q in sets[0]:
        chain = _followed(q, sets)
        if chain is None or not _on_path(make_interp_spline(s, chain, k=5)(middle), between, scene):
            continue
        if any(_drivable(chain, s, speed, scene) for speed in (path.tool_speed, slowest)):
            return True
    return False


def _turned(whole: ToolPath, s: FloatArray, angle: PchipInterpolator) -> FloatArray:
    """Poses (M, 4, 4) at s (M,) m, turned about the tool's axis."""
    poses = whole.poses(s)
    poses[:, :3, :3] = poses[:, :3, :3] @ Rotation.from_euler("x", angle(s)[:, None]).as_matrix()
    return poses


def _on_path(q: FloatArray, poses: FloatArray, scene: PlanningScene) -> bool:
    """Whether configurations between samples, where a spline joins them, are still on the path."""
    away = scene.chain.tcp_poses(q) - poses
    turned = np.linalg.norm(away[:, :3, :3], axis=(1, 2)).max()
    return bool(np.linalg.norm(away[:, :3, 3], axis=1).max() < _ERROR and turned < _TURNED)


def _followed(q: FloatArray, sets: list[FloatArray]) -> FloatArray | None:
    chain = [q]
    for near in sets[1:]:
        if len(near) == 0:
            return None
        away = np.abs(near - chain[-1]).max(axis=1)
        if away.min() > _JUMP:
            return None
        chain.append(near[int(np.argmin(away))])
    return np.array(chain)


def _drivable(q: FloatArray, s: FloatArray, speed: float, scene: PlanningScene) -> bool:
    """Whether the chain is free and can be driven from rest to rest, with one of some ramps at each
    end.
    """
    if not scene.collision.is_free(q, scene.thresholds(MARGIN)).all():
        return False
    if any(np.abs(b - a).max() > _JUMP for a, b in itertools.pairwise(q)):
        return False
    spline = make_interp_spline(s, q, k=5)
    ramps = np.geomspace(_SHORTEST, max(s[-1] / speed, 2.0 * _SHORTEST), _RAMPS)
    return all(
        any(_within(_half(spline, s[-1], speed, ramp, back), scene) for ramp in ramps)
        for back in (0, 1)
    )


def _half(
    spline: BSpline, length: float, speed: float, ramp: float, back: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """q and its derivatives by time (M, n) from one end to the middle, speed rising as 3 x^2 - 2
    x^3.
    """
    x = np.linspace(0.0, 1.0, _ASKED)
    v = speed * x**2 * (3 - 2 * x)
    a = speed / ramp * 6 * x * (1 - x)
    j = speed / ramp**2 * (6 - 12 * x)
    at = speed * ramp * x**3 * (1.0 - 0.5 * x)
    even = np.linspace(at[-1], max(0.5 * length, at[-1]), _ASKED)
    at = np.concatenate([at, even])
    v = np.concatenate([v, np.full(_ASKED, speed)])
    a, j = (np.concatenate([one, np.zeros(_ASKED)])[:, None] for one in (a, j))
    if at[-1] > length:  # the ramp is longer than the path
        return tuple(np.full((1, spline.c.shape[1]), np.inf) for _ in range(4))  # type: ignore[return-value]
    sign = -1.0 if back else 1.0  # a stop is a start back in time, with speed and jerk turned round
    q, first, second, third = (
        spline(length - at if back else at, nu=k) * sign**k for k in range(4)
    )
    v = v[:, None]
    return (
        q,
        sign * first * v,
        second * v**2 + first * a,
        sign * (third * v**3 + 3.0 * second * v * a + first * j),
    )


def _within(
    motion: tuple[FloatArray, FloatArray, FloatArray, FloatArray], scene: PlanningScene
) -> bool:
    q, qd, qdd, qddd = motion
    robot = scene.cell.robot
    bounds = ((qd, robot.velocity_max), (qdd, robot.acceleration_max), (qddd, robot.jerk_max))
    if any((np.abs(values) > bound).any() for values, bound in bounds):
        return False
    drives = Drives(scene)
    share = np.abs(drives.torque(q, qd, qdd)) / drives.envelope(qd)
    return bool(share.max() < scene.limits.torque_share)
