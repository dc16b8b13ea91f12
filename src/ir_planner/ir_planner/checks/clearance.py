"""Metric distances at configurations and along a trajectory: the nearest pair, its closest points, a
profile.
"""

from dataclasses import dataclass

import numpy as np
from ir_kernels.collision import Witnesses
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import DistancePair
from ir_msgs_py.trajectory import JointTrajectory
from numpy.typing import NDArray

from ir_planner.scene import PlanningScene

_ZOOMS = 4
_PER_ZOOM = 9
_MINIMA = 4  # local minima that are looked at closely


@dataclass(frozen=True, eq=False)
class ClearanceProfile:
    """times (N,) s and distances (N,) m of the nearest pair without an allowed contact (inf: no pair).

    smallest: that pair where it is nearest (None: no pair), and when. contacts: the pairs with a safety
    distance of their own, where they are nearest. path_length [m] of the tcp.
    """

    times: FloatArray
    distances: FloatArray
    smallest: DistancePair | None
    smallest_time: float
    contacts: tuple[DistancePair, ...]
    path_length: float


def _pair(scene: PlanningScene, near: Witnesses, row: int, allowed: bool) -> DistancePair:
    pair = scene.collision.pairs[int(near.pair[row])]
    return DistancePair(
        pair.kind.lower(),
        pair.body_a,
        pair.body_b,
        float(near.distance[row]),
        near.point_a[row],
        near.point_b[row],
        allowed,
    )


def pair_value(scene: PlanningScene, q: FloatArray, z: int, allowed: bool = False) -> DistancePair:
    """Pair z at q (n,) with its closest points."""
    return _pair(scene, scene.collision.witnesses(q[None], np.array([z])), 0, allowed)


def nearest_pair(
    scene: PlanningScene, q: FloatArray, offset: FloatArray | None = None
) -> DistancePair | None:
    """The pair nearest to violating its distance `offset` (Z,) at q (n,); None where there is no pair."""
    near = scene.collision.min_distance(q[None], offset)
    return _pair(scene, near, 0, False) if near.pair[0] >= 0 else None


def nearest_pairs(
    scene: PlanningScene, q: FloatArray, offset: FloatArray, count: int, station: str = ""
) -> tuple[DistancePair, ...]:
    """The `count` pairs at q (n,) nearest to violating their distance `offset` (Z,), nearest first."""
    distance = scene.collision.distances(q[None])[0]
    order = np.argsort(distance - offset, kind="stable")[:count]
    if len(order) == 0:
        return ()
    near = scene.collision.witnesses(np.repeat(q[None], len(order), axis=0), order)
    allowed = scene.allowed(station)
    return tuple(_pair(scene, near, row, bool(allowed[z])) for row, z in enumerate(order))


def _lowest_minima(distance: FloatArray) -> NDArray[np.intp]:
    """Where sampled distances (N,) are no larger than before and after, the smallest few first."""
    around = np.concatenate([[np.inf], distance, [np.inf]])
    minima = np.flatnonzero((distance <= around[:-2]) & (distance <= around[2:]))
    return np.asarray(minima[np.argsort(distance[minima], kind="stable")[:_MINIMA]])


def clearance_profile(
    trajectory: JointTrajectory, scene: PlanningScene, station: str = ""
) -> ClearanceProfile:
    """Distances along a trajectory, sampled every 10 ms or finer, and the smallest one between samples."""
    begin, span = float(trajectory.times[0]), trajectory.duration - float(trajectory.times[0])
    count = int(np.clip(np.ceil(span / 0.01), 32, 2000)) + 1
    times = np.linspace(begin, begin + span, count)
    q = trajectory.sample(times).q
    allowed = scene.allowed(station)
    offset = np.where(allowed, -np.inf, 0.0)
    near = scene.collision.min_distance(q, offset)
    minima = _lowest_minima(near.distance)
    best, row = near, int(minima[0])
    at, centres, half = float(times[row]), times[minima], span / (count - 1)
    for _ in range(_ZOOMS):
        zoom = np.clip(centres[:, None] + np.linspace(-half, half, _PER_ZOOM), begin, begin + span)
        closer = scene.collision.min_distance(trajectory.sample(zoom.ravel()).q, offset)
        lowest = np.argmin(closer.distance.reshape(zoom.shape), axis=1)
        centres = zoom[np.arange(len(zoom)), lowest]
        k = int(np.argmin(closer.distance))
        if closer.distance[k] < best.distance[row]:
            best, row, at = closer, k, float(zoom.ravel()[k])
        half /= (_PER_ZOOM - 1) / 2
    contacts: list[DistancePair] = []
    if allowed.any():
        lowest = np.argmin(scene.collision.distances(q), axis=0)
        contacts.extend(pair_value(scene, q[lowest[z]], int(z), True) for z in np.flatnonzero(allowed))
    tcp = scene.chain.tcp_poses(q)[:, :3, 3]
    return ClearanceProfile(
        times=times,
        distances=near.distance,
        smallest=_pair(scene, best, row, False) if best.pair[row] >= 0 else None,
        smallest_time=at,
        contacts=tuple(contacts),
        path_length=float(np.linalg.norm(np.diff(tcp, axis=0), axis=1).sum()),
    )
