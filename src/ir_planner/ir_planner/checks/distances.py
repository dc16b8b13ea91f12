"""Metric distances at configurations and along a trajectory: the nearest pair, its closest points,
a profile.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ir_kernels.collision import FREE, MinDistance, Witnesses
from ir_msgs_py.report import DistancePair
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.curves import motion_at
from ir_planner.scene import PlanningScene, Stops
from ir_values.arrays import FloatArray

# s between the samples of a profile, and how many of them
_STEP = 0.01
_FEWEST = 32
_MOST = 2000
# each zoom looks at a fourth of the time before: 0.04 ms at last
_ZOOMS = 4
_PER_ZOOM = 9
_MINIMA = 4  # local minima of the samples that are looked at closely; the proof meets the others
# m by which the bound lies below the smallest distance found: finer costs, and nobody needs it
_TIGHT = 1e-5
# the same where a pair is that near for a larger share of the time, as a link that turns beside the
# base: there a tight proof looks at every instant
_TIGHT_FOR_LONG = 1e-4
_LONG = 0.2
_LOOSER = 4.0  # times as much where that can't be proved
_PROOFS = 12


class ClearanceProfile(NamedTuple):
    """times (N,) s and distances (N,) m of the nearest pair without a safety distance of its
    own (inf: no pair).

    bound [m]: proved, no distance at any instant is smaller; it lies 1e-5 m below the smallest one
    found, 1e-4 m where that lasts. smallest: that pair where it is nearest (None: no pair), and
    when. contacts: the pairs with a safety distance of their own, where they are nearest.
    path_length [m] of the tcp.
    """

    times: FloatArray
    distances: FloatArray
    bound: float
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
    """The pair nearest to violating its distance `offset` (Z,) at q (n,); None where there is no
    pair.
    """
    near = scene.collision.min_distance(q[None], offset)
    return _pair(scene, near, 0, False) if near.pair[0] >= 0 else None


def nearest_pairs(
    scene: PlanningScene, q: FloatArray, offset: FloatArray, count: int, station: str = ""
) -> tuple[DistancePair, ...]:
    """The `count` pairs at q (n,) nearest to violating their distance `offset` (Z,), nearest
    first.
    """
    distance = scene.collision.distances(q[None])[0]
    order = np.argsort(distance - offset, kind="stable")[:count]
    if len(order) == 0:
        return ()
    near = scene.collision.witnesses(np.repeat(q[None], len(order), axis=0), order)
    allowed = scene.own_distance(station)
    return tuple(_pair(scene, near, row, bool(allowed[z])) for row, z in enumerate(order))


def clearance_profile(
    trajectory: JointTrajectory, scene: PlanningScene, station: Stops = ""
) -> ClearanceProfile:
    """Distances along a trajectory, sampled every 10 ms or finer, and a proved bound of the
    smallest one.
    """
    begin = float(trajectory.times[0])
    span = trajectory.duration - float(trajectory.times[0])
    count = int(np.clip(np.ceil(span / _STEP), _FEWEST, _MOST)) + 1
    times = np.linspace(begin, begin + span, count)
    q = motion_at(trajectory, times).q
    allowed = scene.own_distance(station)
    offset = np.where(allowed, -np.inf, 0.0)
    near = scene.collision.min_distance(q, offset)
    lowest = _nearest_between(trajectory, scene, offset, times, near.distance)
    contacts: list[DistancePair] = []
    if allowed.any():
        closest = np.argmin(scene.collision.distances(q), axis=0)
        contacts.extend(
            pair_value(scene, q[closest[z]], int(z), True) for z in np.flatnonzero(allowed)
        )
    tcp = scene.chain.tcp_poses(q)[:, :3, 3]
    return ClearanceProfile(
        times=times,
        distances=near.distance,
        bound=lowest.bound,
        smallest=_pair(scene, lowest.near, 0, False) if lowest.near.pair[0] >= 0 else None,
        smallest_time=lowest.time,
        contacts=tuple(contacts),
        path_length=float(np.linalg.norm(np.diff(tcp, axis=0), axis=1).sum()),
    )


class _Lowest(NamedTuple):
    """When the nearest pair is nearest [s], its distance there, and what no distance at any instant
    is below.
    """

    time: float
    near: Witnesses
    bound: float


def _nearest_between(
    trajectory: JointTrajectory,
    scene: PlanningScene,
    offset: FloatArray,
    times: FloatArray,
    distances: FloatArray,
) -> _Lowest:
    """The smallest distance [m] at any instant, from samples (N,) at times [s]: looked for around
    the lowest samples, then proved; where the proof meets a smaller one, from there again.

    offset (Z,): 0 for pairs that count, -inf for those that may touch.
    """

    def looked_for(centres: FloatArray, width: float) -> tuple[float, MinDistance]:
        """The lowest instant near the centres [s], and its distance."""
        time = _zoomed(trajectory, scene, offset, centres, width)
        q = motion_at(trajectory, np.array([time])).q
        return time, scene.collision.min_distance(q, offset)

    step = float(times[1] - times[0])
    time, near = looked_for(times[_local_minima(distances)], step)
    coefficients, durations = trajectory.coefficients()
    lasting = np.mean(distances <= near.distance[0] + _TIGHT)
    tight = _TIGHT_FOR_LONG if lasting > _LONG else _TIGHT
    for _ in range(_PROOFS):
        lowest = float(near.distance[0])
        level = lowest - tight
        if near.pair[0] < 0 or len(durations) == 0:
            return _Lowest(time, near, lowest)
        found = scene.collision.certify_trajectory(coefficients, durations, offset + level)
        if found.verdict == FREE:
            return _Lowest(time, near, level)
        first = float(times[0]) + found.interval[0]
        last = float(times[0]) + found.interval[1]
        there, again = looked_for(np.array([0.5 * (first + last)]), last - first)
        if again.distance[0] < near.distance[0]:
            time = there
            near = again
        else:
            tight *= _LOOSER
    return _Lowest(time, near, -np.inf)  # nothing is proved, so nothing is promised


def _local_minima(distance: FloatArray) -> NDArray[np.intp]:
    """Where sampled distances (N,) are no larger than before and after, the smallest few first."""
    around = np.concatenate([[np.inf], distance, [np.inf]])
    minima = np.flatnonzero((distance <= around[:-2]) & (distance <= around[2:]))
    return np.asarray(minima[np.argsort(distance[minima], kind="stable")[:_MINIMA]])


def _zoomed(
    trajectory: JointTrajectory,
    scene: PlanningScene,
    offset: FloatArray,
    centres: FloatArray,
    half: float,
) -> float:
    """The instant [s] of the smallest distance found within `half` s of an instant of `centres`
    (M,).
    """
    begin = float(trajectory.times[0])
    end = float(trajectory.times[-1])
    best = np.inf
    time = float(centres[0])
    for _ in range(_ZOOMS):
        zoom = np.clip(centres[:, None] + np.linspace(-half, half, _PER_ZOOM), begin, end)
        distance = scene.collision.min_distance(
            motion_at(trajectory, zoom.ravel()).q, offset
        ).distance
        lowest = np.argmin(distance.reshape(zoom.shape), axis=1)
        centres = zoom[np.arange(len(zoom)), lowest]
        k = int(np.argmin(distance))
        if distance[k] < best:
            best = float(distance[k])
            time = float(zoom.ravel()[k])
        half /= (_PER_ZOOM - 1) / 2
    return time
