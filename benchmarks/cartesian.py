"""Are paths of the tool driven as asked for, whenever somebody could, and how soon is that known?

    python benchmarks/cartesian.py [--cell FILE]... [--seeds N] [--first SEED] [--quick] [--json
    FILE]
Random lines, circles, splines and rounded corners in every cell, with and without a free angle
about the tool's axis. What is certified is judged by Pinocchio (places, speed), Coal (distances at
0.0005 rad) and 10 kHz samples (limits); what is refused is put to an oracle that draws
configurations and angles.
"""

from __future__ import annotations

import itertools
import time
from dataclasses import asdict, dataclass

import numpy as np
import pinocchio
from _drives import Drives
from _pinocchio_arm import pinocchio_arm
from _results import at_least, at_most, command_line, finish, line_of
from _second_opinion import SecondOpinion
from scipy.interpolate import BSpline, CubicSpline, PchipInterpolator, make_interp_spline
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation, Slerp

from ir_description import bundled_cells
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import CartesianPlan, Planner
from ir_planner.cartesian.path_parts import parts_of
from ir_planner.cartesian.tool_path import ToolPath, joined
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

# Random paths of the tool in a cell, and an oracle that looks for somebody who can drive a
# path.

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


# A judge of paths of the tool that shares nothing with the planner: places by formulas of its own,
# the tool by Pinocchio, its speed by differences.

_DENSE = 2e-4  # m between the places of a path
_RATE = 1000.0  # Hz
_CUBIC = 4  # places from which on a spline is cubic


@dataclass(frozen=True)
class Seen:
    """error [m]: largest distance from the path outside rounded corners; axis [rad]: largest angle
    between the tool's axis and the one asked for, on single lines; speed: by what share the tool is
    off its speed.
    """

    error: float
    axis: float
    speed: float


def places(segment: CartesianSegment, start: FloatArray) -> FloatArray:
    """Dense places (M, 3) m of a segment from `start` (3,)."""
    ends = [start, *(pose[:3, 3] for pose in segment.poses)]
    if segment.kind == "circle":
        return _circle(*ends)
    if len(ends) == 2:
        return np.asarray(np.linspace(ends[0], ends[1], _count(ends)))
    u = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ends, axis=0), axis=1))])
    fine = np.linspace(0.0, u[-1], 2 * _count(ends))
    if len(ends) < _CUBIC:
        return np.column_stack(
            [np.polyval(np.polyfit(u, axis, 2), fine) for axis in np.transpose(ends)]
        )
    return np.asarray(CubicSpline(u, np.array(ends))(fine))


def _count(ends: list[FloatArray]) -> int:
    return int(np.ceil(np.linalg.norm(np.diff(ends, axis=0), axis=1).sum() / _DENSE)) + 2


def _circle(start: FloatArray, via: FloatArray, end: FloatArray) -> FloatArray:
    """The centre is as far from all three and in their plane: three linear equations."""
    normal = np.cross(via - start, end - start)
    rows = np.array([via - start, end - start, normal])
    right = [0.5 * (via @ via - start @ start), 0.5 * (end @ end - start @ start), normal @ start]
    centre = np.linalg.solve(rows, right)
    axis = normal / np.linalg.norm(normal)
    arm = start - centre
    to = end - centre
    angle = np.arctan2(np.cross(arm, to) @ axis, arm @ to) % (2.0 * np.pi)
    count = int(np.ceil(angle * np.linalg.norm(arm) / _DENSE)) + 2
    turns = Rotation.from_rotvec(np.linspace(0.0, angle, count)[:, None] * axis)
    return np.asarray(centre + turns.apply(arm))


def seen(trajectory: JointTrajectory, path: CartesianPath, scene: PlanningScene) -> Seen:
    """What a trajectory makes of a path without approach and retract."""
    times = np.arange(0.0, trajectory.duration, 1.0 / _RATE)
    tcp = _tool(trajectory.sample(times).q, scene)
    whole = []
    corners = []
    start = path.start[:3, 3]
    for segment in path.segments:
        whole.append(places(segment, start))
        start = segment.poses[-1][:3, 3]
        corners.append(start)
    dense = np.concatenate(whole)
    away, along = _from_polyline(tcp[:, :3, 3], dense)
    inner = np.array(corners[:-1]).reshape(-1, 3)
    if len(inner):
        near = np.linalg.norm(tcp[:, None, :3, 3] - inner[None], axis=2).min(axis=1)
        away = away[near > path.blending_radius + 1e-3]
    return Seen(float(away.max()), _axis(tcp, along, path), _speed(tcp, path))


def _tool(q: FloatArray, scene: PlanningScene) -> FloatArray:
    """Poses (M, 4, 4) of the tcp by Pinocchio."""
    model = pinocchio_arm(scene.cell.robot, (), scene.cell.base_pose)
    data = model.createData()
    found = np.empty((len(q), 4, 4))
    for k, one in enumerate(q):
        pinocchio.forwardKinematics(model, data, one)
        found[k] = data.oMi[model.njoints - 1].homogeneous
    return np.asarray(scene.cell.base_pose @ found @ scene.cell.tcp)


def _from_polyline(points: FloatArray, dense: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Distances (M,) m from a polyline, and how far along it [m] the nearest places are."""
    steps = np.linalg.norm(np.diff(dense, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    nearest = cKDTree(dense).query(points)[1]
    best = np.full(len(points), np.inf)
    along = np.zeros(len(points))
    for shift in (-1, 0):
        k = np.clip(nearest + shift, 0, len(dense) - 2)
        edge = dense[k + 1] - dense[k]
        size = np.maximum((edge * edge).sum(axis=1), 1e-18)
        share = np.clip(((points - dense[k]) * edge).sum(axis=1) / size, 0.0, 1.0)
        distance = np.linalg.norm(points - dense[k] - share[:, None] * edge, axis=1)
        along = np.where(distance < best, length[k] + share * np.sqrt(size), along)
        best = np.minimum(best, distance)
    return best, along


def _axis(tcp: FloatArray, along: FloatArray, path: CartesianPath) -> float:
    """The tool's axis on a single line of given orientation; 0 elsewhere."""
    segment = path.segments[0]
    if len(path.segments) > 1 or segment.kind != "line" or path.orientation == "tangent":
        return 0.0
    end = path.start if path.orientation == "constant" else segment.poses[0]
    ends = Rotation.from_matrix(np.stack([path.start[:3, :3], end[:3, :3]]))
    length = float(np.linalg.norm(segment.poses[0][:3, 3] - path.start[:3, 3]))
    asked = Slerp([0.0, 1.0], ends)(np.clip(along / length, 0.0, 1.0)).as_matrix()[:, :, 0]
    return float(np.linalg.norm(np.cross(asked, tcp[:, :3, 0]), axis=1).max())


def _speed(tcp: FloatArray, path: CartesianPath) -> float:
    """By what share the tool is off its speed between the first and the last time it reaches it."""
    speed = np.linalg.norm(np.diff(tcp[:, :3, 3], axis=0), axis=1) * _RATE
    reached = np.flatnonzero(speed >= path.tool_speed * (1.0 - 0.1 * path.speed_tolerance))
    if len(reached) == 0:
        return 1.0
    kept = speed[reached[0] : reached[-1] + 1]
    return float(np.abs(kept / path.tool_speed - 1.0).max())


SEEDS = 200
QUICK_SEEDS = 8
CELLS = tuple(sorted(bundled_cells()))
# share of a limit, m of a distance, that rounding may cost
_LIMIT = 1.0 + 1e-6
_NEAR = 2e-6


@dataclass(frozen=True)
class Row:
    """One path: what it is, how it was answered in `process_s`, what the judges saw of a certified
    one.
    """

    cell: str
    seed: int
    kind: str
    free_angle: float
    process_s: float
    certified: bool
    oracle: bool
    tool_error_mm: float = 0.0
    claimed_mm: float = 0.0
    speed_off: float = 0.0
    clearance_left_mm: float = 0.0
    largest_share: float = 0.0
    refused: str = ""


def row_of(cell: str, seed: int, planner: Planner, judge: SecondOpinion) -> Row:
    """Plan a random path and judge the answer."""
    scene = planner.scene()
    rng = np.random.default_rng(seed)
    path = random_path(rng, scene)
    plan, took = timed(planner, path)
    kind = "corner" if len(path.segments) > 1 else path.segments[0].kind
    if plan.trajectory is None:
        can = oracle(path, scene, rng)
        return Row(cell, seed, kind, path.free_angle, took, False, can, refused=plan.status.message)
    found = seen(plan.trajectory, path, scene)
    left = 1e3 * judge.clearance_left(plan.trajectory, MARGIN)[0]
    share = judge.largest_share(plan.trajectory)
    figures = (1e3 * found.error, 1e3 * plan.tool_error, found.speed, left, share)
    return Row(cell, seed, kind, path.free_angle, took, plan.report.certified, True, *figures)


def timed(planner: Planner, path: CartesianPath) -> tuple[CartesianPlan, float]:
    """The answer, and its seconds of processor time."""
    began = time.process_time()
    plan = planner.plan_cartesian(path, options=PlanOptions(safety_distance=MARGIN))
    return plan, time.process_time() - began


def line_seconds(planner: Planner, scene: PlanningScene, count: int) -> list[float]:
    """Processor time of lines of 1 m that are certified."""
    took: list[float] = []
    rng = np.random.default_rng(1)
    while len(took) < count:
        start = np.array(random_path(rng, scene).start)
        end = np.array(start)
        ahead = rng.normal(size=3)
        end[:3, 3] += ahead / np.linalg.norm(ahead)
        path = CartesianPath(start, (CartesianSegment("line", (end,)),), tool_speed=0.25)
        plan, seconds = timed(planner, path)
        if plan.status.ok:
            took.append(seconds)
    return took


def main() -> None:
    """Run all cells and seeds."""
    parser = command_line(__doc__, CELLS, SEEDS, f"{QUICK_SEEDS} paths of each cell")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="of the paths (0)")
    arguments = parser.parse_args()
    seeds = QUICK_SEEDS if arguments.quick else arguments.seeds
    rows: list[Row] = []
    lines: list[float] = []
    for cell in arguments.cell or CELLS:
        planner = Planner(cell)
        judge = SecondOpinion(planner.scene())
        for seed in range(arguments.first, arguments.first + seeds):
            rows.append(row_of(cell, seed, planner, judge))
            print(line_of(asdict(rows[-1])), flush=True)
        lines += line_seconds(planner, planner.scene(), max(seeds // 10, 2))
    certified = [row for row in rows if row.certified]
    objected = [
        r for r in certified if r.clearance_left_mm < -1e3 * _NEAR or r.largest_share > _LIMIT
    ]
    beyond = max(row.tool_error_mm - row.claimed_mm for row in certified)
    missed = [row for row in rows if row.oracle and not row.certified]
    claims = [
        at_least("paths certified", len(certified) / len(rows), "share", 0.5),
        at_most("refused that the oracle drives", len(missed), "paths", 0),
        at_most("tool error", max(row.tool_error_mm for row in certified), "mm", 0.1),
        at_most("tool error above its bound", beyond, "mm", 1e-3),
        at_most("speed off", max(row.speed_off for row in certified), "share", 0.01),
        at_most("certified that a judge objects to", len(objected), "paths", 0),
        at_most("line of 1 m, median", 1e3 * float(np.median(lines)), "ms", 50.0),
    ]
    finish(arguments.json, [asdict(row) for row in rows], claims, lines_s=lines)


if __name__ == "__main__":
    main()
