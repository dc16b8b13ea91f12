"""Out the way the tool points, then round: for ends that lie deep in something, as a box or a tunnel.

From start and goal the tool is drawn back along its -x, in closed form and in one branch, as far as that is
free; between the drawn back ends the simple detours are tried. (The paper's withdrawal, eq. 7, asks less of
the machine than a straight way out; this is the cheap attempt before the trees.)
"""

import numpy as np
from ir_msgs_py.arrays import FloatArray

from ir_planner.checks import FreeSpace
from ir_planner.search.detours import drawn_back, over_postures, scattered

SPACING = 0.05  # m
LENGTH = 1.0  # m
_JUMP = 0.35  # rad
_PARTS = (1.0, 0.6, 0.3)  # of the free retreat that are tried
_SCATTERED = 32  # vias per pair of ends


def free_retreat(q: FloatArray, space: FreeSpace) -> FloatArray:
    """Configurations (M, n) from q on while the tool draws back along its -x; M = 1 where it can't."""
    scene = space.scene
    tcp = scene.chain.tcp_poses(q[None])[0]
    back = np.arange(1, round(LENGTH / SPACING) + 1) * SPACING
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
    length = len(free) if free.all() else int(np.argmin(free))
    return points[: length + 1]


def retreating_paths(
    start: FloatArray, goal: FloatArray, space: FreeSpace, rng: np.random.Generator
) -> list[FloatArray]:
    """Free paths that draw back at one end or at both, and go round in between."""
    cell = space.scene.cell
    postures = [np.array(cell.park), np.array(cell.machine_home)]
    outward, inward = free_retreat(start, space), free_retreat(goal, space)
    lines: list[tuple[int, int]] = []
    inner: list[FloatArray] = []
    for first in _ends(outward):
        for last in _ends(inward):
            if first + last == 0:
                continue
            a, b = outward[first], inward[last]
            ways = [
                np.stack([a, b]),
                *over_postures(a, b, postures),
                *drawn_back(a, b, postures),
                *scattered(a, b, space.low, space.high, _SCATTERED, rng),
            ]
            inner.extend(np.clip(way, space.low, space.high) for way in ways)
            lines.extend([(first, last)] * len(ways))
    free = space.paths_free(inner)
    return [
        np.concatenate([outward[:first], way, inward[:last][::-1]])
        for (first, last), way, is_free in zip(lines, inner, free, strict=True)
        if is_free
    ]


def _ends(line: FloatArray) -> list[int]:
    """How far along a retreat the detours may begin: not at all, or after a part of it."""
    return sorted({0, *(round(part * (len(line) - 1)) for part in _PARTS)})
