"""Where allowed contacts of a station hold: while the tcp is in its machine's zone, or nearer to it
than S_m.

Outside, every pair keeps S_m. A trajectory is cut where its tcp leaves or enters; the parts outside
are checked with the plain safety distance.
"""

import numpy as np

from ir_kernels import portable
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import motion_at
from ir_planner.scene.planning_scene import PlanningScene
from ir_values.arrays import BoolArray, FloatArray

_SAMPLES = 400
# 2^30 parts of the time between two samples
_PARTS = 32
_ROUNDS = 6


def tcp_inside(q: FloatArray, scene: PlanningScene, station: str, margin: float) -> BoolArray:
    """Whether the tcp at q (N, n) is in the zone of the station's machine, or within `margin` m of
    it; never where a path belongs to no machine.
    """
    zone = scene.zone_of(station)
    if zone is None:
        return np.zeros(len(q), dtype=bool)
    tcp = scene.chain.tcp_poses(q)[:, :3, 3]
    local = portable.matmul(tcp - zone.pose[:3, 3], zone.pose[:3, :3])
    beyond = np.maximum(np.abs(local) - 0.5 * zone.size, 0.0)
    return np.asarray(np.linalg.norm(beyond, axis=1) <= margin)


def spans_outside(
    trajectory: JointTrajectory, scene: PlanningScene, station: str, margin: float
) -> list[tuple[float, float]]:
    """Times [s] between which the tcp is outside, found by sampling and dividing; each a little
    longer than it is.
    """

    def inside(times: FloatArray) -> BoolArray:
        return tcp_inside(motion_at(trajectory, times).q, scene, station, margin)

    times = np.linspace(trajectory.times[0], trajectory.times[-1], _SAMPLES)
    flags = inside(times)
    edges = [float(times[0])] if not flags[0] else []
    for k in np.flatnonzero(flags[:-1] != flags[1:]):
        low = float(times[k])
        high = float(times[k + 1])
        for _ in range(_ROUNDS):
            parts = np.linspace(low, high, _PARTS + 1)
            changed = int(np.argmax(np.append(inside(parts[1:-1]) != flags[k], True))) + 1
            low = float(parts[changed - 1])
            high = float(parts[changed])
        edges.append(low if flags[k] else high)
    if not flags[-1]:
        edges.append(float(times[-1]))
    return list(zip(edges[::2], edges[1::2], strict=True))


def polynomials_between(
    trajectory: JointTrajectory, begin: float, end: float
) -> tuple[FloatArray, FloatArray]:
    """Coefficients (S, n, 6) and durations (S,) of the part of a trajectory between two times
    [s].
    """
    coefficients, durations = trajectory.coefficients()
    if begin <= trajectory.times[0] and end >= trajectory.times[-1]:
        return coefficients, durations
    starts = trajectory.times[:-1]
    first = np.clip(begin - starts, 0.0, durations)
    last = np.clip(end - starts, 0.0, durations)
    kept = np.flatnonzero(last > first)
    return shifted(coefficients[kept], first[kept]), (last - first)[kept]


def shifted(coefficients: FloatArray, by: FloatArray) -> FloatArray:
    """Coefficients (S, n, 6) of the same polynomials with time counted from `by` (S,) s on."""
    c = coefficients.copy()
    top = c.shape[-1] - 1
    for first in range(top):
        for k in range(top - 1, first - 1, -1):
            c[..., k] += by[:, None] * c[..., k + 1]
    return c
