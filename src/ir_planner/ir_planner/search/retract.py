"""The tool is retracted first: for ends that lie deep in something, as a box or a tunnel.

From start and goal the tool is retracted along its -x, in closed form and in one branch, as far as
that is free; between the retracted ends the simple detours are tried. (The paper's withdrawal, eq.
7, asks less of the machine than a straight exit; this is the cheap attempt before the trees.)
"""

from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.settings import check_settings, setting
from ir_planner.checks import FreeSpace
from ir_planner.request import Work
from ir_planner.search.port import Ends, Found
from ir_planner.search.variety import NEAREST_GOALS, different_paths
from ir_planner.search.vias import over_postures, over_retracted_arm, scattered

_JUMP = 0.35  # rad between neighbours on the line: more is another branch, or a singularity
_PARTS = (1.0, 0.6, 0.3)  # of the free retraction from which detours are tried


@dataclass(frozen=True)
class Retract:
    """The tool is retracted along its axis at one end or both, then simple detours."""

    length: float = setting(1.0, "Longest retraction.", unit="m", minimum=0.05, maximum=5.0)
    spacing: float = setting(
        0.05, "Distance of the configurations along it.", unit="m", minimum=0.005, maximum=0.5
    )
    vias: int = setting(
        32, "Scattered via configurations per pair of ends.", minimum=1, maximum=10_000
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int, work: Work) -> Found:
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
    found = scene.inverse_kinematics.solve(poses)
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
