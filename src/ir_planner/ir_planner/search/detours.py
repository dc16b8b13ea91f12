"""Simple searches: the straight movement, and detours over one or two via configurations.

Candidates of a detour run over the named postures, with the arm retracted first, or over scattered
vias; they are generated in one go and certified in one batch. For ends that lie deep in something,
as a box or a tunnel, the tool is retracted first along its -x, in closed form and in one branch, as
far as that is free. (The paper's withdrawal, eq. 7, asks less of the machine than a straight exit;
this is the cheap attempt before the trees.)
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ir_planner.checks import FreeSpace
from ir_planner.search.port import Ends, Found
from ir_planner.search.variety import NEAREST_GOALS, different_paths
from ir_values.arrays import FloatArray
from ir_values.settings import check_settings, setting

_SHARES = (0.25, 0.5, 0.75, 1.0)  # of the joint step to a posture by which the arm is retracted
_SPREADS = (0.15, 0.35, 0.7)  # rad: how far vias are scattered around the straight movement


def over_postures(
    start: FloatArray, goal: FloatArray, postures: list[FloatArray]
) -> list[FloatArray]:
    """Paths (3, n) over each posture, and over each turned to where start, goal or the middle
    look.
    """
    paths = []
    for posture in postures:
        paths.append(np.stack([start, posture, goal]))
        for first in (start[0], goal[0], 0.5 * (start[0] + goal[0])):
            turned = posture.copy()
            turned[0] = first
            paths.append(np.stack([start, turned, goal]))
    return paths


def over_retracted_arm(
    start: FloatArray, goal: FloatArray, postures: list[FloatArray]
) -> list[FloatArray]:
    """Paths (4, n) and (3, n): retract the arm towards a posture, turn, and reach out again.

    Once with all joints but the first, once with the arm (joints 2 and 3) alone.
    """
    n = len(start)
    arm = np.zeros(n, dtype=bool)
    arm[1:3] = True
    rest = np.ones(n, dtype=bool)
    rest[0] = False
    paths = []
    for posture in postures:
        for joints in (rest, arm):
            for share in _SHARES:
                back = [q + share * np.where(joints, posture - q, 0.0) for q in (start, goal)]
                paths.append(np.stack([start, *back, goal]))
                middle = 0.5 * (back[0] + back[1])
                paths.append(np.stack([start, middle, goal]))
    return paths


def scattered(
    start: FloatArray,
    goal: FloatArray,
    low: FloatArray,
    high: FloatArray,
    count: int,
    rng: np.random.Generator,
) -> list[FloatArray]:
    """`count` paths (3, n) over vias scattered around the straight movement, within the limits."""
    along = rng.uniform(0.2, 0.8, (count, 1))
    spread = rng.choice(_SPREADS, (count, 1))
    vias = start + along * (goal - start) + spread * rng.standard_normal((count, len(start)))
    vias = np.clip(vias, low, high)
    return [np.stack([start, via, goal]) for via in vias]


@dataclass(frozen=True)
class Detours:
    """Simple detours over one or two via configurations, all certified in one batch."""

    keeps_upright: ClassVar[bool] = True
    vias: int = setting(160, "Scattered via configurations per goal.", minimum=1, maximum=100_000)

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """Certify the candidates to the nearest goals."""
        cell = space.scene.cell
        postures = [np.array(cell.park), np.array(cell.machine_home)]
        rng = np.random.default_rng(seed)
        candidates: list[FloatArray] = []
        for goal in ends.goals[:NEAREST_GOALS]:
            candidates += over_postures(ends.start, goal, postures)
            candidates += over_retracted_arm(ends.start, goal, postures)
            candidates += scattered(ends.start, goal, space.low, space.high, self.vias, rng)
        candidates = [np.clip(path, space.low, space.high) for path in candidates]
        candidates = space.kept_upright(candidates)
        free = space.paths_free(candidates)
        paths = [path for path, is_free in zip(candidates, free, strict=True) if is_free]
        return Found(different_paths(paths, space.scene.weights))


_JUMP = 0.35  # rad between neighbours on the line: more is another branch, or a singularity
_PARTS = (1.0, 0.6, 0.3)  # of the free retraction from which detours are tried


@dataclass(frozen=True)
class Retract:
    """The tool is retracted along its axis at one end or both, then simple detours."""

    keeps_upright: ClassVar[bool] = True
    length: float = setting(1.0, "Longest retraction.", unit="m", minimum=0.05, maximum=5.0)
    spacing: float = setting(
        0.05, "Distance of the configurations along it.", unit="m", minimum=0.005, maximum=0.5
    )
    vias: int = setting(
        32, "Scattered via configurations per pair of ends.", minimum=1, maximum=10_000
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """Retract from the start and the nearest goals."""
        rng = np.random.default_rng(seed)
        goals = ends.goals[:NEAREST_GOALS]
        paths = [path for goal in goals for path in self._between(ends.start, goal, space, rng)]
        return Found(different_paths(paths, space.scene.weights))

    def _between(
        self, start: FloatArray, goal: FloatArray, space: FreeSpace, rng: np.random.Generator
    ) -> list[FloatArray]:
        """Free paths that retract at one end or at both, with a detour in between."""
        cell = space.scene.cell
        postures = [np.array(cell.park), np.array(cell.machine_home)]
        outward = free_retraction(start, space, self.length, self.spacing)
        inward = free_retraction(goal, space, self.length, self.spacing)
        lines: list[tuple[int, int]] = []
        inner: list[FloatArray] = []
        for first in _ends(outward):
            for last in _ends(inward):
                if first + last == 0:
                    continue
                a = outward[first]
                b = inward[last]
                between = [
                    np.stack([a, b]),
                    *over_postures(a, b, postures),
                    *over_retracted_arm(a, b, postures),
                    *scattered(a, b, space.low, space.high, self.vias, rng),
                ]
                inner.extend(np.clip(inner_path, space.low, space.high) for inner_path in between)
                lines.extend([(first, last)] * len(between))
        inner = space.kept_upright(inner)
        free = space.paths_free(inner)
        return [
            np.concatenate([outward[:first], inner_path, inward[:last][::-1]])
            for (first, last), inner_path, is_free in zip(lines, inner, free, strict=True)
            if is_free
        ]


def free_retraction(q: FloatArray, space: FreeSpace, length: float, spacing: float) -> FloatArray:
    """Configurations (M, n) from q (n,) on while the tool retracts along its -x, up to `length` m
    in steps of `spacing` m; M = 1 where it can't.
    """
    scene = space.scene
    tcp = scene.chain.tcp_poses(q[None])[0]
    back = np.arange(1, round(length / spacing) + 1) * spacing
    poses = np.repeat(tcp[None], len(back), axis=0)
    poses[:, :3, 3] -= back[:, None] * tcp[:3, 0]
    found = scene.inverse_kinematics_beside(q).solve(poses)
    line = [q]
    for k in range(len(poses)):
        candidates = found.of_pose(k)
        if len(candidates) == 0:
            break
        jump = np.abs(candidates - line[-1]).max(axis=1)
        if jump.min() > _JUMP:
            break
        line.append(candidates[int(np.argmin(jump))])
    points = np.array(line)
    free = space.edges_free(points[:-1], points[1:])
    steps = len(free) if free.all() else int(np.argmin(free))
    return points[: steps + 1]


def _ends(line: FloatArray) -> list[int]:
    """How far along a retraction (M, n) the detours may begin: not at all, or after a part of
    it.
    """
    return sorted({0, *(round(part * (len(line) - 1)) for part in _PARTS)})


@dataclass(frozen=True)
class Direct:
    """The straight movements to the goals that are free; where the tool has to stay upright, along
    configurations near them.
    """

    keeps_upright: ClassVar[bool] = True
    paths: int = setting(
        3, "Straight movements that are taken, to as many goals.", minimum=1, maximum=64
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """Certify the straight movement to every goal, also where no work is left: what is free at
        once is found with any work.
        """
        starts = np.repeat(ends.start[None], len(ends.goals), axis=0)
        free = np.flatnonzero(space.straight_free(starts, ends.goals))[: self.paths]
        straight = [np.stack([ends.start, goal]) for goal in ends.goals[free]]
        if straight or space.cone is None:
            return Found(straight)
        upright = space.kept_upright([np.stack([ends.start, goal]) for goal in ends.goals])
        held = space.paths_free(upright)
        paths = [path for path, is_free in zip(upright, held, strict=True) if is_free]
        return Found(paths[: self.paths])
