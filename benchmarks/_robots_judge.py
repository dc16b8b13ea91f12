"""Cells of two robots drawn at random, and a judge of their joint cycles that knows the programs
with their signals alone: it drives them with delays of its own, and measures distances with Coal.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
from _coal_shapes import along_z

from ir_description import Cell
from ir_kernels import Chain
from ir_msgs_py.report import PlannedMovement
from ir_planner.robots import RobotsPlan
from ir_values.arrays import FloatArray

RESOLUTION = 0.5e-3  # s: no two looks are nearer to each other
_BERNSTEIN = np.array([[math.comb(j, i) / math.comb(4, i) for i in range(5)] for j in range(5)])
_TOOL = (
    "{{name: {0}_tool, mass: 1.5, com: [0.06, 0, 0], inertia_box: [0.12, 0.1, 0.06], "
    "capsules: [{{name: {0}_body, p0: [0.03, 0, 0], p1: [0.1, 0, 0], radius: 0.04}}]}}"
)
_ROBOT = """\
  - name: {0}
    robot: kr6_r900_2
    base: {{xyz: [{1}, 0, 0], abc_deg: [{2}, 0, 0]}}
    park_deg: [{3}, -110, 120, 0, 60, 0]
    tool: {4}
    tcp: {{xyz: [0.16, 0, 0]}}
    program: [{5}, {{posture: park}}]
"""


def drawn_cell(seed: int, distance: tuple[float, float] = (0.8, 1.3)) -> str:
    """The text of a cell: two KR 6 face each other, `distance` [m] apart, and visit stations
    between them, from above.
    """
    rng = np.random.default_rng(seed)
    apart = float(rng.uniform(*distance))
    stations = []
    robots = []
    for name, x, turn in (("left", 0.0, 0.0), ("right", apart, 180.0)):
        visits = []
        for k in range(int(rng.integers(2, 4))):
            angle = np.radians(turn + rng.uniform(-60.0, 60.0))
            reach = rng.uniform(0.4, 0.6)
            place = [x + reach * np.cos(angle), reach * np.sin(angle), rng.uniform(0.25, 0.5)]
            pose = f"{{xyz: {np.round(place, 4).tolist()}, abc_deg: [0, 90, 0]}}"
            stations.append(f"      - {{name: {name}_{k}, pose: {pose}, approach_distance: 0.08}}")
            visits.append(f"{{station: {name}_{k}, dwell: {rng.uniform(0.1, 0.6):.3f}}}")
        park = round(float(rng.uniform(-150.0, 150.0)), 2)
        tool = _TOOL.format(name)
        robots.append(_ROBOT.format(name, round(x, 4), turn, park, tool, ", ".join(visits)))
    return "\n".join(
        [
            "format: ir_cell/1",
            f"name: drawn_{seed}",
            "equipment:",
            "  - name: places",
            "    bodies: []",
            "    zone: {kind: OPEN, size: [0.1, 0.1, 0.1], xyz: [0, 0, 5]}",
            "    stations:",
            *stations,
            "robots:",
            *robots,
        ]
    )


@dataclass(frozen=True)
class Piece:
    """What a robot does from a time on [s]: a step, or standing before it (moving: False)."""

    begin: float
    step: PlannedMovement
    moving: bool


def driven(
    plan: RobotsPlan, rng: np.random.Generator, cycles: int, *, delay: float = 1.0
) -> list[list[Piece]]:
    """The steps of every robot over some cycles, each begun up to `delay` s late, and never before
    its signals are there. Raises RuntimeError where all wait for each other.
    """
    signals = {zone.signal: False for zone in plan.zones}
    todo = [list(program.movements) * cycles for program in plan.programs]
    pieces: list[list[Piece]] = [[] for _ in todo]
    done = [0] * len(todo)
    waiting: set[int] = set()
    events: list[tuple[float, int, bool]] = []
    for robot in range(len(todo)):
        heapq.heappush(events, (0.0, robot, False))
    now = 0.0
    while events:
        now, robot, ended = heapq.heappop(events)
        if ended:
            for text in todo[robot][done[robot]].set_signals:
                signals[text.removesuffix("=0")] = not text.endswith("=0")
            done[robot] += 1
            if done[robot] < len(todo[robot]):
                heapq.heappush(events, (now + rng.uniform(0.0, delay), robot, False))
                pieces[robot].append(Piece(now, todo[robot][done[robot]], moving=False))
        elif not pieces[robot]:
            pieces[robot].append(Piece(0.0, todo[robot][0], moving=False))
            waiting.add(robot)
        else:
            waiting.add(robot)
        for each in sorted(waiting):
            step = todo[each][done[each]]
            if all(signals[w.removesuffix("=0")] != w.endswith("=0") for w in step.wait_for):
                waiting.discard(each)
                pieces[each].append(Piece(now, step, moving=True))
                heapq.heappush(events, (now + step.duration, each, True))
    if waiting:
        raise RuntimeError(f"robots {sorted(waiting)} wait for ever, from {now:.2f} s on")
    return pieces


@dataclass(frozen=True, eq=False)
class Path:
    """Recorded joint values q (N, n) at times (N,) [s], and from when on which load is carried."""

    times: FloatArray
    q: FloatArray
    loads: list[tuple[float, str]]

    def at(self, time: float) -> tuple[FloatArray, str]:
        """Joint values between the two that are nearest in time, and the load."""
        load = next((load for when, load in reversed(self.loads) if when <= time), "")
        return np.array([np.interp(time, self.times, own) for own in self.q.T]), load


class Judge:
    """Distances between two robots by Coal."""

    def __init__(self, cells: tuple[Cell, Cell]) -> None:
        self._cells = cells
        self._chains = [Chain(cell.robot, cell.base_pose, cell.tcp) for cell in cells]
        self._shapes: list[dict[str, list[tuple[int, Any, FloatArray]]]] = [{}, {}]
        self._request = coal.DistanceRequest()
        self._request.gjk_tolerance = 1e-9
        self._levers = [_levers(cell) for cell in cells]
        # no point of an arm is faster than all joints at full speed
        limits = [cell.robot.velocity_max for cell in cells]
        self.speed = sum(map(float, map(np.dot, self._levers, limits)))
        self._speeds: dict[tuple[int, str], float] = {}

    def least(
        self, pieces: list[list[Piece]], margin: float, *, first: bool = False
    ) -> tuple[float, float]:
        """The least distance [m] and when it is [s]; between two looks nothing nearer than the
        margin is missed unless it is over within the resolution. first: the first one below the
        margin is enough.
        """
        end = max(own[-1].begin + own[-1].step.duration for own in pieces)
        stands = [_begin(own) for own in pieces]
        best = (np.inf, 0.0)
        at = [0, 0]
        q = [stands[0], stands[1]]
        time = 0.0
        while time <= end:
            for robot, own in enumerate(pieces):
                while at[robot] + 1 < len(own) and own[at[robot] + 1].begin <= time:
                    q[robot] = _posture(own[at[robot]], np.inf, q[robot])
                    at[robot] += 1
            now = [_posture(own[at[k]], time, q[k]) for k, own in enumerate(pieces)]
            loads = [own[at[k]].step.load for k, own in enumerate(pieces)]
            distance = self.distance((now[0], now[1]), (loads[0], loads[1]))
            best = min(best, (distance, time))
            if first and distance < margin:
                return best
            time += max(self._free(pieces, at, time, distance - margin), RESOLUTION)
        return best

    def _free(
        self, pieces: list[list[Piece]], at: Sequence[int], time: float, above: float
    ) -> float:
        """How long they can't come nearer by so much [s]: a robot that stands doesn't."""
        now = [own[k] for own, k in zip(pieces, at, strict=True)]
        speed = sum(self._speed(robot, piece) for robot, piece in enumerate(now))
        later = [own[k + 1].begin for own, k in zip(pieces, at, strict=True) if k + 1 < len(own)]
        until = min(later, default=np.inf) - time
        return min(above / speed, until) if speed > 0.0 else until

    def _speed(self, robot: int, piece: Piece) -> float:
        """Speed [m/s] that no point of a robot exceeds in a piece: by the polynomials of its
        joints, whose speeds are nowhere beyond their Bernstein coefficients.
        """
        trajectory = piece.step.trajectory
        if trajectory is None or not piece.moving:
            return 0.0
        key = robot, trajectory.trajectory_id
        if key not in self._speeds:
            polynomials, seconds = trajectory.coefficients()
            powers = np.arange(1, 6)
            slopes = powers * polynomials[..., 1:] * seconds[:, None, None] ** (powers - 1)
            bound = np.abs(slopes @ _BERNSTEIN.T).max(axis=-1)
            self._speeds[key] = float((bound @ self._levers[robot]).max())
        return self._speeds[key]

    def least_recorded(
        self, paths: Sequence[Path], margin: float, resolution: float = RESOLUTION
    ) -> tuple[float, float]:
        """The same of two robots whose joint values were recorded; resolution [s]: of the looks."""
        end = min(path.times[-1] for path in paths)
        best = (np.inf, 0.0)
        time = max(path.times[0] for path in paths)
        while time <= end:
            now = [path.at(time) for path in paths]
            distance = self.distance((now[0][0], now[1][0]), (now[0][1], now[1][1]))
            best = min(best, (distance, time))
            time += max((distance - margin) / self.speed, resolution)
        return best

    def distance(self, q: tuple[FloatArray, FloatArray], loads: tuple[str, str]) -> float:
        """Of two arms at q with what they carry [m]."""
        placed = [self._placed(k, q[k], loads[k]) for k in (0, 1)]
        centres = [np.array([pose[:3, 3] for _, pose in own]) for own in placed]
        radii = [np.array([s.radius + s.halfLength for s, _ in own]) for own in placed]
        apart = np.linalg.norm(centres[0][:, None] - centres[1][None], axis=-1)
        below = apart - radii[0][:, None] - radii[1][None]  # by spheres around the capsules
        best = np.inf
        for index in below.argsort(axis=None):
            a, b = divmod(int(index), below.shape[1])
            if below[a, b] >= best:
                break
            best = min(best, self._between(placed[0][a], placed[1][b]))
        return best

    def _placed(self, robot: int, q: FloatArray, load: str) -> list[tuple[Any, FloatArray]]:
        links = self._chains[robot].link_poses(np.ascontiguousarray(q[None]))[0]
        return [(s, links[link] @ local) for link, s, local in self._capsules(robot, load)]

    def _between(self, one: tuple[Any, FloatArray], other: tuple[Any, FloatArray]) -> float:
        (a, here), (b, there) = (
            (shape, coal.Transform3s(pose[:3, :3].copy(), pose[:3, 3].copy()))
            for shape, pose in (one, other)
        )
        return float(coal.distance(a, here, b, there, self._request, coal.DistanceResult()))

    def _capsules(self, robot: int, load: str) -> list[tuple[int, Any, FloatArray]]:
        known = self._shapes[robot]
        if load not in known:
            cell = self._cells[robot]
            held = [part.name for part in cell.parts if part.name in load.split("+")]
            known[load] = [
                (
                    c.link,
                    coal.Capsule(c.radius, float(np.linalg.norm(c.p1 - c.p0))),
                    along_z(c.p0, c.p1) if (c.p0 != c.p1).any() else _at(c.p0),
                )
                for c in cell.capsules(held[0] if held else "")
                if c.link > 0
            ]
        return known[load]


def _at(point: FloatArray) -> FloatArray:
    pose = np.eye(4)
    pose[:3, 3] = point
    return pose


def _levers(cell: Cell) -> FloatArray:
    """How far from each joint's axis no point of an arm is, with what it carries (n,) [m]."""
    lengths = [float(np.linalg.norm(origin[:3, 3])) for origin in cell.robot.joint_origin]
    tip = float(np.linalg.norm(cell.tcp[:3, 3])) + 0.5
    return np.array([sum(lengths[k + 1 :]) + tip for k in range(len(lengths))])


def _begin(pieces: list[Piece]) -> FloatArray:
    """Where a robot stands before its first movement (n,)."""
    return next(p.step.trajectory.positions[0] for p in pieces if p.step.trajectory is not None)


def _posture(piece: Piece, time: float, before: FloatArray) -> FloatArray:
    """Where a robot is at a time [s] in a piece (n,)."""
    trajectory = piece.step.trajectory
    if trajectory is None or not piece.moving:
        return before
    local = min(time - piece.begin, trajectory.duration)
    return np.asarray(trajectory.sample([max(local, 0.0)]).q[0])
