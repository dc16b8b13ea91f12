"""Which pairs of a robot's capsules can touch, and what pairs keep that are near by construction.

Neighbours are left out: their bodies meet at the joint. Others that are near in many postures are
near by construction: they keep a distance of their own, so that capsules that are wider than the
bodies leave the robot its work. It is never below what the capsules were seen to be apart in a
posture in which the bodies meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ir_description import Capsule
from ir_description.files.convex_pieces import halved
from ir_description.files.making import LinkBody, UrdfArm, beside_axis
from ir_description.robot import ReducedDistance
from ir_kernels import Chain, CollisionModel
from ir_values.arrays import BoolArray, FloatArray, IntArray

SAFETY = 0.02
"""Safety distance [m] of a request that says nothing."""
POSTURES = 3000
NEAR = 0.25
"""Share of postures that a pair may take from the robot before it counts as near by
construction.
"""
ROOM = 0.002
"""m below the distance that a tenth of the postures do not reach."""
_DEEPEST = 0.1  # of the postures of a pair that is built so, which are not allowed
_BUILT_SO = 0.5  # of the postures in which points that meet do so by construction
_LEFT = 0.3  # of the postures that a pair must leave
LEAST_LEFT = 0.1
"""Share of postures that two links must leave to be told apart by their capsules."""
_WIDEST = 0.4  # of the postures, of links that can't be told apart
_WIDE = "that leaves no posture: lowered to what the widest 40 % keep"
_AT_HOME = "lowered to what the given home posture keeps"
_VOXELS = 60  # along a part: one point stands for the surface in each
_LOOKED_AT = 48  # postures, for what is built so and in a round around those that meet
_TRIED = 500  # postures in which capsules overlap, but by no more than usual
_DEEPER = 60  # in which they overlap by more
_FROM = 8  # postures that meet, around which others are looked at
_AROUND = 24
_STEPS = (0.06, 0.03, 0.015, 0.008)  # of the range of each joint


class Pairs(NamedTuple):
    """Pairs of capsules that can touch; those of them that keep a distance of their own."""

    pairs: tuple[tuple[str, str], ...]
    reduced: tuple[ReducedDistance, ...]


def pairs_of(
    arm: UrdfArm,
    capsules: tuple[Capsule, ...],
    bodies: Sequence[Sequence[LinkBody]],
    low: FloatArray,
    high: FloatArray,
    home: FloatArray | None,
) -> Pairs:
    """All pairs of capsules of links that are no neighbours; home: a given one [rad], at which the
    robot stands whatever its capsules say.
    """
    far = [
        (a.name, b.name)
        for k, a in enumerate(capsules)
        for b in capsules[k + 1 :]
        if abs(a.link - b.link) > 1
    ]
    chain = Chain(arm)
    model = CollisionModel(chain, capsules, (), far)
    q = np.random.default_rng(0).uniform(low, high, (POSTURES, len(low)))
    distance = model.distances(q)
    named = {capsule.name: capsule for capsule in capsules}
    surfaces = _Surfaces(arm, bodies)
    groups: dict[tuple[int, int], list[int]] = {}
    for z, (_, first, second) in enumerate(model.pairs):
        if float((distance[:, z] <= SAFETY).mean()) > NEAR:
            links = sorted((named[first].link, named[second].link))
            groups.setdefault((links[0], links[1]), []).append(z)
    least_at_home = np.full(distance.shape[1], np.inf)
    if home is not None:
        least_at_home = model.distances(home[None])[0] - ROOM
    reduced = []
    for near in groups.values():
        own = []
        for z in near:
            pair = (named[name] for name in model.pairs[z][1:])
            one, other = sorted(pair, key=lambda each: each.link)
            own.append(_own_distance(distance[:, z], _Meeting(chain, one, other, surfaces, q)))
        room = (distance[:, near] - [kept for kept, _ in own]).min(axis=1)
        lower = min(0.0, float(np.quantile(room, 1.0 - _WIDEST)))
        if float((room > 0.0).mean()) < LEAST_LEFT:
            own = [(kept + lower, f"{reason}; {_WIDE}") for kept, reason in own]
        for z, (kept, reason) in zip(near, own, strict=True):
            if least_at_home[z] < kept:
                kept = float(least_at_home[z])
                reason = f"{reason}; {_AT_HOME}"
            reduced.append(ReducedDistance(*model.pairs[z][1:], kept, reason))
    return Pairs(tuple(far), tuple(reduced))


def _own_distance(distance: FloatArray, meeting: _Meeting) -> tuple[float, str]:
    """What a pair with these distances in postures (N,) keeps, and the reason."""
    near = 100.0 * float((distance <= SAFETY).mean())
    usual = min(float(np.quantile(distance, _DEEPEST)) - ROOM, SAFETY)
    reason = f"nearer than {1e3 * SAFETY:g} mm in {near:.0f} % of {len(distance)} postures"
    if usual >= 0.0:
        return usual, reason
    least = meeting.largest_distance(usual)
    if meeting.built_so:
        reason += f"; the bodies of the URDF meet in most postures: {meeting.built_so}"
    if least <= usual:
        return usual, (
            f"{reason}; the bodies of the URDF were not seen to meet where the capsules overlap by "
            "less: they come no nearer than in nine of ten postures"
        )
    return least, (
        f"{reason}; the bodies of the URDF meet, or are too near to tell, in postures in which the "
        "capsules overlap by more"
    )


def kept_sentence(reduced: ReducedDistance) -> str:
    """What a pair that is near by construction keeps, and why."""
    first, second, distance, reason = reduced
    keep = (
        f"keep {1e3 * distance:.1f} mm, or the safety distance where that is less"
        if distance >= 0.0
        else f"are capsules that may overlap by {-1e3 * distance:.1f} mm"
    )
    return f"{first} and {second} {keep}: {reason}"


class _Points(NamedTuple):
    """Points (N, 3) of a surface, each of which stands for what is within its radius (N,) [m]."""

    at: FloatArray
    radius: FloatArray

    def chosen(self, which: BoolArray) -> _Points:
        return _Points(self.at[which], self.radius[which])

    def moved(self, pose: FloatArray) -> _Points:
        return _Points(self.at @ pose[:3, :3].T + pose[:3, 3], self.radius)


class _Surfaces:
    """Surfaces of the links by their capsules."""

    def __init__(self, arm: UrdfArm, bodies: Sequence[Sequence[LinkBody]]) -> None:
        self._rounding = arm.rounding
        self._bodies = bodies
        self._known: dict[str, _Points] = {}

    def within(self, capsule: Capsule) -> _Points:
        """Points of its link's surface in a capsule; of a link without a body, none."""
        if capsule.name not in self._known:
            self._known[capsule.name] = self._sampled(capsule)
        return self._known[capsule.name]

    def _sampled(self, capsule: Capsule) -> _Points:
        points = [np.zeros((0, 3))]
        radii = [np.zeros(0)]
        size = float(np.linalg.norm(capsule.p1 - capsule.p0)) + 2.0 * capsule.radius
        for body in self._bodies[capsule.link]:
            wider = body.beside + self._rounding
            if body.exact is not None:
                p0, p1, ball, _ = body.exact
                points.append(np.linspace(p0, p1, 20))
                half = 0.5 / 19.0 * float(np.linalg.norm(p1 - p0))
                radii.append(np.full(20, ball + half + wider))
            else:
                near = _in_capsule(body.triangles, capsule, size / _VOXELS)
                at, around = _voxels(near, size)
                points.append(at)
                radii.append(around + wider)
        return _Points(np.concatenate(points), np.concatenate(radii))


def _in_capsule(triangles: FloatArray, capsule: Capsule, fine: float) -> FloatArray:
    """Triangles with edges of at most 2 fine [m] that together hold what of the surface is in a
    capsule.
    """
    while True:
        centres = triangles.mean(axis=1)
        radius = np.linalg.norm(triangles - centres[:, None], axis=2).max(axis=1)
        beside = beside_axis(centres, capsule.p0, capsule.p1)
        triangles = triangles[beside <= capsule.radius + radius]
        edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        long = edges.max(axis=1, initial=0.0) > 2.0 * fine
        if not long.any():
            return triangles
        triangles = np.concatenate([triangles[~long], halved(triangles[long])])


def _voxels(triangles: FloatArray, size: float) -> tuple[FloatArray, FloatArray]:
    """One point (N, 3) for the triangles in each voxel, and the radius (N,) that holds these."""
    if not len(triangles):
        return np.zeros((0, 3)), np.zeros(0)
    centres = triangles.mean(axis=1)
    cells = np.floor(centres / (size / _VOXELS)).astype(np.int64)
    _, which = np.unique(cells, axis=0, return_inverse=True)
    which = which.ravel()
    count = np.bincount(which)
    at = np.stack([np.bincount(which, centres[:, k]) / count for k in range(3)], axis=1)
    radius = np.zeros(len(at))
    far = np.linalg.norm(triangles - at[which][:, None], axis=2).max(axis=1)
    np.maximum.at(radius, which, far)
    return at, radius


def _thinned(rows: IntArray, most: int) -> IntArray:
    """Rows, evenly taken, not many more than `most`."""
    return rows[:: max(1, len(rows) // most)]


class _Meeting:
    """Postures in which the bodies in two capsules meet, of a link and of one beyond the next.

    built_so: what of it is left out because they are built so, as a shaft in its housing, in words;
    "" for nothing. Of the rest of both surfaces counts what meets anything.
    """

    def __init__(
        self, chain: Chain, one: Capsule, other: Capsule, surfaces: _Surfaces, q: FloatArray
    ) -> None:
        self._chain = chain
        self._capsules = (one, other)
        self._model = CollisionModel(chain, (one, other), (), [(one.name, other.name)])
        self._q = q
        self._joints = np.arange(one.link, other.link)
        self._sides = (surfaces.within(one), surfaces.within(other))
        self._counted = tuple(np.ones(len(each.at), dtype=bool) for each in self._sides)
        self._trees: tuple[cKDTree, ...] = ()
        self.built_so = ""

    def largest_distance(self, usual: float) -> float:
        """What the capsules are apart at most [m] where the bodies meet, in all postures that were
        looked at, most of which keep `usual` [m]: -inf where they never do, 0 for capsules without
        bodies.
        """
        if not all(len(each.at) for each in self._sides):
            return 0.0
        self._trees = tuple(cKDTree(each.at) for each in self._sides)
        few = self._q[:_LOOKED_AT]
        distance = self._distances(self._q)
        found = self._found(distance, usual)
        if float((distance > found).mean()) >= _LEFT:
            return found
        counts = self._meetings(few)
        self._counted = tuple(each < _BUILT_SO * len(few) for each in counts)
        self.built_so = "places that do so in half of all postures are taken for built so"
        return self._found(distance, usual)

    def _found(self, distance: FloatArray, usual: float) -> float:
        """The largest distance with what counts of the surfaces; distance (N,) of the capsules."""
        order = np.argsort(-distance, kind="stable")
        kept = order[(distance[order] <= 0.0) & (distance[order] > usual)]
        deeper = order[distance[order] <= usual]
        tried = np.concatenate([_thinned(kept, _TRIED), _thinned(deeper, _DEEPER)])
        met = self._meet(self._q[tried])
        if not met.any():
            return -np.inf
        first = tried[met][:_FROM]
        return self._climbed(self._q[first], distance[first])

    def _climbed(self, q: FloatArray, distance: FloatArray) -> float:
        """The largest distance of the capsules in postures near those q (N, n) that meet."""
        generator = np.random.default_rng(0)
        span = np.ptp(self._q[:, self._joints], axis=0)
        for size in _STEPS:
            near = np.repeat(q, _AROUND, axis=0)
            step = generator.normal(size=(len(near), len(self._joints)))
            near[:, self._joints] += size * span * step
            near = np.clip(near, self._q.min(axis=0), self._q.max(axis=0))
            apart = self._distances(near)
            better = (apart > distance.max()) & (apart <= 0.0)
            if not better.any():
                continue
            near = near[better][:_LOOKED_AT]
            met = self._meet(near)
            q = np.concatenate([q, near[met]])
            distance = np.concatenate([distance, apart[better][:_LOOKED_AT][met]])
            best = np.argsort(-distance, kind="stable")[:_FROM]
            q = q[best]
            distance = distance[best]
        return float(distance.max())

    def _distances(self, q: FloatArray) -> FloatArray:
        return np.asarray(self._model.distances(q)[:, 0])

    def _meet(self, q: FloatArray) -> BoolArray:
        """Whether the surfaces meet or may meet, by the radii of their points (N,)."""
        sides = (0, 1) if self.built_so else (0,)
        result = np.zeros(len(q), dtype=bool)
        for k, poses in enumerate(self._relative(q)):
            result[k] = any(len(self._meeting(side, poses[side])) for side in sides)
        return result

    def _relative(self, q: FloatArray) -> FloatArray:
        """Poses (N, 2, 4, 4) of each link in the other one."""
        first, second = (self._chain.link_poses(q)[:, each.link] for each in self._capsules)
        there = np.linalg.inv(second) @ first
        return np.stack([there, np.linalg.inv(there)], axis=1)

    def _meeting(self, side: int, pose: FloatArray) -> IntArray:
        """Which points of a side may meet the other one; pose: of their link in the other one."""
        facing = self._capsules[1 - side]
        chosen = np.flatnonzero(self._counted[side])
        points = self._sides[side].chosen(self._counted[side]).moved(pose)
        beside = beside_axis(points.at, facing.p0, facing.p1)
        inside = beside <= facing.radius + points.radius
        if not inside.any():
            return chosen[:0]
        most = float(self._sides[1 - side].radius.max())
        own = points.radius[inside]
        limit = most + float(own.max())
        far, _ = self._trees[1 - side].query(points.at[inside], distance_upper_bound=limit)
        return np.asarray(chosen[inside][far <= own + most])

    def _meetings(self, q: FloatArray) -> list[FloatArray]:
        """In how many postures each point of both sides may meet the other one."""
        counts = [np.zeros(len(each.at)) for each in self._sides]
        for poses in self._relative(q):
            for side in (0, 1):
                counts[side][self._meeting(side, poses[side])] += 1.0
        return counts
