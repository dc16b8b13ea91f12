"""Which pairs of a robot's capsules can touch, and what pairs keep that are near by construction.

Neighbours are left out: their bodies meet at the joint. Others that are near in many postures are
near by construction: they keep a distance of their own, so that capsules that are wider than the
bodies leave the robot its work. It is never below what the capsules are apart in a posture in which
what they stand for meets: each piece of a link's surface stands for one capsule, the narrowest that
holds it. That is proved for all postures within the limits, by triangles of both surfaces and by
how far these can move in a box of postures. Only links that meet in every posture, as a shaft does
in its housing, are let off where they do so all around.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence, Set
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ir_description.files.convex_pieces import fine_triangles, halved
from ir_description.files.making import LinkBody, UrdfArm, beside_axis
from ir_description.robot import ReducedDistance
from ir_description.shapes import Capsule
from ir_kernels import Chain, CollisionModel
from ir_kernels.surfaces import Surface
from ir_values.arrays import BoolArray, FloatArray, IntArray

SAFETY = 0.02
"""Safety distance [m] of a request that says nothing."""
POSTURES = 3000
NEAR = 0.25
"""Share of postures that a pair may take from the robot before it counts as near by construction.
"""
ROOM = 0.002
"""m below the distance that a tenth of the postures do not reach."""
_DEEPEST = 0.1  # of the postures of a pair that is built so, which are not allowed
_RING = 0.01  # m: width and height of a ring
_BESIDE = 0.02  # m from a ring that is built so: taken for built so, too
_LEFT = 0.3  # of the postures that a pair must leave
LEAST_LEFT = 0.1
"""Share of postures that two links must leave to be told apart by their capsules."""
_VOXELS = 60  # along a capsule: one point stands for the surface in each
_FINE = 0.006  # m: edge of a voxel of a link that is looked at more closely, at most
_SMALL = 200_000  # triangles of a link that is looked at more closely
_ALONG = 20  # points along a body that is a capsule
_TOUCH = 1e-9  # m: of rounding, by which a corner may be out of its capsule
_HALVINGS = 16
_LOOKED_AT = 48  # postures at once
_TRIED = 500  # postures in which capsules overlap, but by no more than usual
_GAP = 1e-3  # m: within which what a pair keeps is found
_ENOUGH = 0.8  # of the postures that the exact distance would leave
_POSTURES_MAX = 20_000  # looked at to find it
_NEAREST = 5e-4  # m: surfaces that are nearer count as meeting
_ROUGHLY = 2e-3  # m: the same where rings are counted
_BOXES = 100_000_000  # pairs, after which what is left counts as if the surfaces met
_ALWAYS = 300  # postures: links that meet in all of them are built so
_COUNTED = 16  # of them, in which rings are counted


class Pairs(NamedTuple):
    """Pairs of capsules that can touch; those of them that keep a distance of their own; unclear:
    pairs of links, the lower one first, whose capsules leave hardly a posture, or forbid the given
    home; left: share of the sampled postures that all pairs leave, 0 where they forbid that home.
    """

    pairs: tuple[tuple[str, str], ...]
    reduced: tuple[ReducedDistance, ...]
    unclear: frozenset[tuple[int, int]] = frozenset()
    left: float = 1.0


def _far_pairs(capsules: Sequence[Capsule]) -> list[tuple[str, str]]:
    """Names of two capsules each, of links that no joint connects."""
    found = []
    for one, other in itertools.combinations(capsules, 2):
        if abs(one.link - other.link) > 1:
            found.append((one.name, other.name))
    return found


def pairs_of(
    arm: UrdfArm,
    capsules: tuple[Capsule, ...],
    bodies: Sequence[Sequence[LinkBody]],
    low: FloatArray,
    high: FloatArray,
    home: FloatArray | None,
    finer: Set[tuple[int, int]] = frozenset(),
) -> Pairs:
    """All pairs of capsules of links that are no neighbours, within limits low and high [rad];
    home: a given posture [rad]; finer: pairs of links whose surfaces are looked at in small pieces.

    A pair that is too near in many random postures gets a distance of its own, by the surfaces
    within its capsules.
    """
    far = _far_pairs(capsules)
    chain = Chain(arm)
    model = CollisionModel(chain, capsules, (), far)
    q = np.random.default_rng(0).uniform(low, high, (POSTURES, len(low)))
    distance = model.distances(q)
    named = {capsule.name: capsule for capsule in capsules}
    finer_links = {link for pair in finer for link in pair}
    surfaces = _Surfaces(arm, capsules, bodies, finer_links)

    # pairs that are too near in many postures, by the links that they belong to
    groups: dict[tuple[int, int], list[int]] = {}
    for z, (_, first, second) in enumerate(model.pairs):
        share_too_near = float((distance[:, z] <= SAFETY).mean())
        if share_too_near > NEAR:
            one, other_link = sorted((named[first].link, named[second].link))
            groups.setdefault((one, other_link), []).append(z)

    reduced = []
    unclear: set[tuple[int, int]] = set()
    least = np.full(len(model.pairs), SAFETY)
    for links, near in groups.items():
        rings = _Rings(chain, *links, surfaces, q)
        distances = []
        reasons = []
        for z in near:
            _, first, second = model.pairs[z]
            lower, upper = sorted((named[first], named[second]), key=lambda each: each.link)
            meeting = _Meeting(chain, lower, upper, rings, q, (low, high))
            own_distance, reason = _own_distance(distance[:, z], meeting)
            distances.append(own_distance)
            reasons.append(reason)
        kept = np.array(distances)
        least[near] = kept
        left = float((distance[:, near] > kept).all(axis=1).mean())
        free_at_home = home is None or (model.distances(home[None])[0, near] > kept).all()
        if left < LEAST_LEFT or not free_at_home:
            unclear.add(links)
        for z, own_distance, reason in zip(near, distances, reasons, strict=True):
            said = f"{reason}; leaves {100.0 * left:.1f} %" if left < LEAST_LEFT else reason
            reduced.append(ReducedDistance(*model.pairs[z][1:], own_distance, said))
    leaves = float((distance > least).all(axis=1).mean())
    if home is not None and (model.distances(home[None])[0] <= least).any():
        leaves = 0.0
    return Pairs(tuple(far), tuple(reduced), frozenset(unclear), leaves)


def _own_distance(distance: FloatArray, meeting: _Meeting) -> tuple[float, str]:
    """What a pair with these distances in postures (N,) keeps, and the reason."""
    near = 100.0 * float((distance <= SAFETY).mean())
    usual = min(float(np.quantile(distance, _DEEPEST)) - ROOM, SAFETY)
    reason = f"nearer than {1e3 * SAFETY:g} mm in {near:.0f} % of {len(distance)} postures"
    if usual >= 0.0:
        return usual, reason
    least = meeting.largest_distance(usual)
    if meeting.built_so:
        reason += f"; the links meet in all of {_ALWAYS} postures: {meeting.built_so}"
    whose = "the other parts of their bodies" if meeting.built_so else "the bodies of the URDF"
    if least <= usual:
        return usual, f"{reason}; {whose} meet nowhere beyond: it is proved"
    return least, (
        f"{reason}; {whose} meet up to there, or are too near to tell, and nowhere beyond: it is "
        "proved"
    )


def kept_sentences(reduced: Sequence[ReducedDistance], capsules: Sequence[Capsule]) -> list[str]:
    """What pairs of capsules keep that are near by construction, and why: a sentence for two links,
    on their pair that keeps least.
    """
    link = {each.name: each.link for each in capsules}
    groups: dict[tuple[int, ...], list[ReducedDistance]] = {}
    for each in reduced:
        groups.setdefault(tuple(sorted(link[name] for name in each[:2])), []).append(each)
    found = []
    for own in groups.values():
        first, second, distance, reason = min(own, key=lambda each: each.distance)
        keep = (
            f"keep {1e3 * distance:.1f} mm, or the safety distance where that is less"
            if distance >= 0.0
            else f"are capsules that may overlap by {-1e3 * distance:.1f} mm"
        )
        more = f" (the least of {len(own)} pairs of their links)" if len(own) > 1 else ""
        found.append(f"{first} and {second} {keep}{more}: {reason}")
    return found


class _Pieces(NamedTuple):
    """Pieces of a surface around points `at` (N, 3): triangles (T, 3, 3) of a piece (T,), which
    stand for what is within `beside` (T,) [m] of them.
    """

    at: FloatArray
    triangles: FloatArray
    piece: IntArray
    beside: FloatArray

    @classmethod
    def none(cls) -> _Pieces:
        return cls(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros(0, dtype=int), np.zeros(0))

    @classmethod
    def balls(cls, at: FloatArray, radius: float) -> _Pieces:
        """Balls around points (N, 3), all of one radius [m]."""
        points = np.repeat(at[:, None], 3, axis=1)
        return cls(at, points, np.arange(len(at)), np.full(len(at), radius))

    def and_of(self, other: _Pieces) -> _Pieces:
        """These and others behind them."""
        joined = [np.concatenate(both) for both in zip(self, other, strict=True)]
        joined[2][len(self.piece) :] += len(self.at)
        return _Pieces(*joined)


class _Part(NamedTuple):
    """Triangles (T, 3, 3) that stand for what is within `beside` [m] of them, in pieces of a size
    of `step` [m]; 0: each is one.
    """

    triangles: FloatArray
    beside: float
    step: float


class _Piecewise:
    """A surface of parts, and as pieces where these are asked for."""

    def __init__(self, parts: Sequence[_Part]) -> None:
        self._parts = parts
        self.triangles = np.concatenate([np.zeros((0, 3, 3)), *(each.triangles for each in parts)])
        self.beside = np.repeat(
            [each.beside for each in parts], [len(each.triangles) for each in parts]
        ).astype(np.float64)
        self.surface = Surface(self.triangles, self.beside)

    @cached_property
    def pieces(self) -> _Pieces:
        """All of it."""
        found = _Pieces.none()
        for part in self._parts:
            found = found.and_of(
                _voxels(part.triangles, part.step, part.beside)
                if part.step
                else _Pieces.balls(part.triangles[:, 0], part.beside)
            )
        return found

    @cached_property
    def _fine(self) -> Surface:
        return Surface(self.pieces.triangles, self.pieces.beside)

    def of_pieces(self, which: BoolArray) -> Surface:
        """The pieces (N,) alone."""
        rows = which[self.pieces.piece]
        return Surface(self.pieces.triangles[rows], self.pieces.beside[rows])

    def meets(self, other: _Piecewise, pose: FloatArray) -> bool:
        """Whether it meets another surface, or nearly does; pose (1, 4, 4): of this one in it."""
        return bool(self.surface.meets(other.surface, pose, _NEAREST, _BOXES)[0][0])

    def touching(self, other: _Piecewise, pose: FloatArray) -> IntArray:
        """Pieces that nearly meet another surface; pose: of this one in the other one."""
        return np.unique(self.pieces.piece[self._fine.touching(other.surface, pose, _ROUGHLY)])


class _Surfaces:
    """Surfaces of the links, shared out among their capsules."""

    def __init__(
        self,
        arm: UrdfArm,
        capsules: Sequence[Capsule],
        bodies: Sequence[Sequence[LinkBody]],
        finer: Set[int],
    ) -> None:
        self._finer = finer
        self._rounding = arm.rounding
        self._capsules = capsules
        self._bodies = bodies
        self._known: dict[str, _Piecewise] = {}

    def capsules(self, link: int) -> list[Capsule]:
        """Those of a link."""
        return [each for each in self._capsules if each.link == link]

    def has_body(self, link: int) -> bool:
        """Whether the URDF has a shape for it."""
        return bool(self._bodies[link])

    def of(self, capsule: Capsule) -> _Piecewise:
        """What a capsule stands for: nothing for a link without a body, or where the others of its
        link are narrower and hold all.
        """
        if capsule.name not in self._known:
            own = self.capsules(capsule.link)
            for each, parts in zip(own, self._shared(own), strict=True):
                self._known[each.name] = _Piecewise(parts)
        return self._known[capsule.name]

    def _shared(self, capsules: Sequence[Capsule]) -> list[list[_Part]]:
        """Parts of the surface of a link whose capsules are given, for each of them."""
        found: list[list[_Part]] = [[] for _ in capsules]
        for body in self._bodies[capsules[0].link]:
            wider = body.beside + self._rounding
            if body.exact is not None:
                p0, p1, ball, _ = body.exact
                half = 0.5 / (_ALONG - 1) * float(np.linalg.norm(p1 - p0))
                along = np.linspace(p0, p1, _ALONG if half > 0.0 else 1)
                points = np.repeat(along[:, None], 3, axis=1)
                k = _holder(along, ball, capsules)
                found[k].append(_Part(points, ball + half + wider, 0.0))
                continue
            for k, share in enumerate(_shared_out(body.triangles, capsules)):
                size = float(np.linalg.norm(capsules[k].p1 - capsules[k].p0))
                step = (size + 2.0 * capsules[k].radius) / _VOXELS
                if capsules[k].link in self._finer:
                    step = min(step, max(_FINE, _coarse_enough(share)))
                if len(share):
                    found[k].append(_Part(share, wider, step))
        return found


def _outside(points: FloatArray, capsules: Sequence[Capsule]) -> FloatArray:
    """How far points (.., 3) are out of each of K capsules (K, ..) [m], below 0 in it."""
    return np.array([beside_axis(points, each.p0, each.p1) - each.radius for each in capsules])


def _holder(points: FloatArray, ball: float, capsules: Sequence[Capsule]) -> int:
    """The narrowest of the capsules that holds balls around points (N, 3), else the one that holds
    most of them.
    """
    out = _outside(points, capsules).max(axis=1) + ball
    radius = np.array([each.radius for each in capsules])
    return int(np.argmin(np.where(out <= _TOUCH, radius, radius.max() + out)))


def _shared_out(triangles: FloatArray, capsules: Sequence[Capsule]) -> list[FloatArray]:
    """Triangles (T, 3, 3) by the narrowest of the capsules that holds each; those that none holds
    are cut.
    """
    order = np.argsort([each.radius for each in capsules], kind="stable")
    found: list[list[FloatArray]] = [[np.zeros((0, 3, 3))] for _ in capsules]
    for last in [*[False] * _HALVINGS, True]:
        for k in order:
            out = _outside(triangles, capsules[k : k + 1])[0].max(axis=1)
            inside = out <= _TOUCH
            found[k].append(triangles[inside])
            triangles = triangles[~inside]
        if not len(triangles):
            break
        if last:  # of rounding, or of shapes without a capsule
            nearest = _outside(triangles.mean(axis=1), capsules).argmin(axis=0)
            for k in range(len(capsules)):
                found[k].append(triangles[nearest == k])
        triangles = halved(triangles)
    return [np.concatenate(each) for each in found]


def _coarse_enough(triangles: FloatArray) -> float:
    """The edge of a voxel [m] with which a surface (T, 3, 3) has no more than some _SMALL
    triangles.
    """
    a, b, c = triangles.swapaxes(0, 1)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return float(np.sqrt(2.0 * doubled / _SMALL))


def _voxels(triangles: FloatArray, step: float, beside: float) -> _Pieces:
    """A piece for the triangles in each voxel of an edge of `step` [m], which stand for what is
    within `beside` [m] of them.
    """
    if not len(triangles):
        return _Pieces.none()
    triangles = fine_triangles(triangles, step)
    centres = triangles.mean(axis=1)
    cells = np.floor((centres - centres.min(axis=0)) / step).astype(np.int64)
    number = np.ravel_multi_index(cells.T, cells.max(axis=0) + 1)
    which = np.unique(number, return_inverse=True)[1].ravel()
    count = np.bincount(which)
    at = np.stack([np.bincount(which, centres[:, k]) / count for k in range(3)], axis=1)
    return _Pieces(at, triangles, which, np.full(len(triangles), beside))


def _thinned(rows: IntArray, most: int) -> IntArray:
    """Rows, evenly taken, not many more than `most`."""
    return rows[:: max(1, len(rows) // most)]


class _Rings:
    """Rings about the joint that leads from a link towards another one, in which their surfaces
    meet by construction, as a shaft in its housing: what turns in something meets it all around.

    q (N, n): postures, in the first of which they are counted.
    """

    def __init__(
        self, chain: Chain, first: int, second: int, surfaces: _Surfaces, q: FloatArray
    ) -> None:
        self._every = q[:_ALWAYS]
        self.surfaces = surfaces
        self._chain = chain
        self._links = (first, second)
        self._q = q[:_COUNTED]

    @cached_property
    def always(self) -> bool:
        """Whether the links meet, or nearly do, in every posture."""
        sides = [
            [self.surfaces.of(each) for each in self.surfaces.capsules(link)]
            for link in self._links
        ]
        pairs = [*itertools.product(*sides)]
        for pose in _relative(self._chain, *self._links, self._every)[:, :1]:
            met = next((k for k, (a, b) in enumerate(pairs) if a.meets(b, pose)), None)
            if met is None:
                return False
            pairs.insert(0, pairs.pop(met))  # most likely to do so again
        return True

    def away(self, side: int, pieces: _Pieces) -> BoolArray:
        """Which pieces (N,) of the first link, or of the second, lie beside no ring that is built
        so.
        """
        count = self._counts[side]
        usual = [ring for ring, times in count.items() if times == len(self._q)]
        places, of = self._cells(side, pieces.at)
        if not (len(usual) and len(places)):
            return np.ones(len(of), dtype=bool)
        far, _ = cKDTree(np.array(usual)).query(places)
        return np.asarray(far > _BESIDE / _RING)[of]

    @cached_property
    def _counts(self) -> tuple[Counter[tuple[float, ...]], ...]:
        """In how many postures a piece of each ring of both links meets the other link, or nearly
        does: with any of its capsules.
        """
        counts: tuple[Counter[tuple[float, ...]], ...] = (Counter(), Counter())
        sides = [self.surfaces.capsules(link) for link in self._links]
        for poses in _relative(self._chain, *self._links, self._q):
            met: tuple[set[tuple[float, ...]], ...] = (set(), set())
            for pair in itertools.product(*sides):
                for side in (0, 1):
                    own = self.surfaces.of(pair[side])
                    other = self.surfaces.of(pair[1 - side])
                    touching = own.touching(other, poses[side])
                    places, _ = self._cells(side, own.pieces.at[touching])
                    met[side].update(map(tuple, places))
            for count, rings in zip(counts, met, strict=True):
                count.update(rings)
        return counts

    def _cells(self, side: int, points: FloatArray) -> tuple[FloatArray, IntArray]:
        """Rings (M, 2), along the axis and beside it [widths of a ring], and which of them points
        (N, 3) of a link lie in.
        """
        link = self._links[side]
        joint = link if side == 0 else link - 1
        poses = self._chain.link_poses(np.zeros((1, self._chain.n)))[0]
        own = poses[link]
        axis = own[:3, :3].T @ poses[joint + 1, :3, :3] @ self._chain.joint_axis[joint]
        foot = own[:3, :3].T @ (poses[joint + 1, :3, 3] - own[:3, 3])
        along = (points - foot) @ axis
        beside = np.linalg.norm(points - foot - along[:, None] * axis, axis=1)
        cells = np.floor(np.stack([along, beside], axis=1) / _RING)
        rings, of = np.unique(cells, axis=0, return_inverse=True)
        return rings, np.asarray(of).ravel()


def _relative(chain: Chain, one: int, other: int, q: FloatArray) -> FloatArray:
    """Poses (N, 2, 4, 4) of each of two links in the other one."""
    first, second = (chain.link_poses(q)[:, link] for link in (one, other))
    there = np.linalg.inv(second) @ first
    return np.stack([there, np.linalg.inv(there)], axis=1)


class _Meeting:
    """Postures in which what two capsules stand for meets, of a link and of one beyond the next.

    built_so: what of it is left out because they are built so, in words; "" for nothing. Of what
    lies away from such rings counts what meets anything.
    """

    def __init__(
        self,
        chain: Chain,
        one: Capsule,
        other: Capsule,
        rings: _Rings,
        q: FloatArray,
        limits: tuple[FloatArray, FloatArray],
    ) -> None:
        low, high = limits
        self._chain = chain
        self._capsules = (one, other)
        self._model = CollisionModel(chain, (one, other), (), [(one.name, other.name)])
        self._q = q
        self._joints = np.arange(one.link, other.link)
        self._rings = rings
        self._surfaces = (rings.surfaces.of(one), rings.surfaces.of(other))
        fewer = int(np.argmin([len(each.triangles) for each in self._surfaces]))
        self._counted = {fewer: self._surfaces[fewer].surface}
        self.built_so = ""
        self._left = _BOXES
        self._range = np.stack([low, high])[:, self._joints]
        self._reach = self._reaches()

    def largest_distance(self, usual: float) -> float:
        """A bound [m] of what the capsules are apart where the bodies meet, most of which keep
        `usual` [m]: not above it where that suffices, 0 for links without bodies.
        """
        if not all(self._rings.surfaces.has_body(each.link) for each in self._capsules):
            return 0.0
        if not all(len(each.triangles) for each in self._surfaces):
            return -np.inf
        distance = self._distances(self._q)
        found = self._bound(distance, usual)
        if float((distance > found).mean()) >= _LEFT or not self._rings.always:
            return found
        away = [self._rings.away(k, each.pieces) for k, each in enumerate(self._surfaces)]
        if all(each.all() for each in away):
            return found
        self._counted = {k: each.of_pieces(away[k]) for k, each in enumerate(self._surfaces)}
        self.built_so = (
            "rings about a joint that do so in all that were counted, and what is within "
            f"{1e3 * _BESIDE:g} mm, are taken for built so"
        )
        return self._bound(distance, usual)

    def _bound(self, distance: FloatArray, usual: float) -> float:
        """What the capsules are apart at most in a posture in which what counts meets; distance
        (N,): of the sampled ones.

        Boxes of postures are halved until in none of those left the capsules can be farther apart
        than found, or nothing can meet: how far anything moves within a box is bounded. What is
        left counts as if it met once that takes few postures, or after very many boxes.
        """
        self._left = _BOXES
        found = max(usual - _GAP, self._seen(distance, usual))
        centres = np.mean(self._range, axis=0)[None]
        half = 0.5 * np.ptp(self._range, axis=0)
        looked_at = 0
        while True:
            q = np.repeat(self._q[:1], len(centres), axis=0)
            q[:, self._joints] = centres
            moved = float(half @ self._reach)
            apart = self._distances(q)
            open_ = (apart + moved > found + _GAP) & (apart - moved <= 0.0)
            looked_at += int(open_.sum())
            if looked_at > _POSTURES_MAX:
                return min(float(np.max(apart[open_] + moved)), 0.0)
            open_[open_] = self._meet(q[open_], moved + _NEAREST)
            meeting = open_ & (apart > found)
            meeting[meeting] = self._meet(q[meeting], _NEAREST)
            found = max(found, float(np.max(apart[meeting], initial=found)))
            open_ &= apart + moved > found + _GAP
            if not open_.any():
                return min(found + _GAP, 0.0)
            bound = min(float(np.max(apart[open_] + moved)), 0.0)
            if (distance > bound).mean() >= _ENOUGH * (distance > found).mean():
                return bound
            longest = int(np.argmax(half * self._reach))
            step = np.zeros(len(half))
            step[longest] = 0.5 * half[longest]
            half = half - step
            centres = np.concatenate([centres[open_] - step, centres[open_] + step])

    def _seen(self, distance: FloatArray, usual: float) -> float:
        """The largest distance of sampled postures that meet, above `usual`; else -inf."""
        order = np.argsort(-distance, kind="stable")
        tried = _thinned(order[(distance[order] <= 0.0) & (distance[order] > usual)], _TRIED)
        for begin in range(0, len(tried), _LOOKED_AT):
            rows = tried[begin : begin + _LOOKED_AT]
            met = self._meet(self._q[rows], _NEAREST)
            if met.any():
                return float(distance[rows[met]].max())
        return -np.inf

    def _reaches(self) -> FloatArray:
        """How far [m/rad] the links move against each other at most where one joint turns (J,)."""
        poses = self._chain.link_poses(np.zeros((1, self._chain.n)))[0]
        joints = self._joints
        axes = np.einsum("jab,jb->ja", poses[joints + 1, :3, :3], self._chain.joint_axis[joints])
        feet = poses[joints + 1, :3, 3]
        ends = []
        for capsule, surface in zip(self._capsules, self._surfaces, strict=True):
            beside = np.concatenate([np.repeat(surface.beside, 3), [0.0, 0.0]])
            points = np.concatenate([surface.triangles.reshape(-1, 3), [capsule.p0, capsule.p1]])
            pose = poses[capsule.link]
            ends.append((points @ pose[:3, :3].T + pose[:3, 3], beside))
        lower = _radii(*ends[0], feet, axes)
        upper = _radii(*ends[1], feet[::-1], axes[::-1])[::-1]
        return np.minimum(lower, upper)

    def _distances(self, q: FloatArray) -> FloatArray:
        if not len(q):
            return np.zeros(0)
        return np.asarray(self._model.distances(q)[:, 0])

    def _meet(self, q: FloatArray, near: float) -> BoolArray:
        """Whether the surfaces are within `near` [m] (N,); after very many pairs of boxes they
        count as if.
        """
        result = np.zeros(len(q), dtype=bool)
        if not len(q):
            return result
        one, other = (each.link for each in self._capsules)
        poses = _relative(self._chain, one, other, q)
        for side, counted in self._counted.items():
            open_ = np.flatnonzero(~result)
            if len(open_):
                facing = self._surfaces[1 - side].surface
                met, looked_at = counted.meets(facing, poses[open_, side], near, max(self._left, 0))
                result[open_] = met
                self._left -= looked_at
        return result


def _radii(
    points: FloatArray, beside: FloatArray, feet: FloatArray, axes: FloatArray
) -> FloatArray:
    """How far balls around points (N, 3) of radii (N,) [m] on one end of a chain can be from each
    of its axes (J, 3), through feet (J, 3), the nearest first, whatever angles these have.
    """
    found = []
    for k, (foot, axis) in enumerate(zip(feet, axes, strict=True)):
        if k == 0:
            out = points - foot
            far = float(np.max(np.linalg.norm(np.cross(out, axis), axis=1) + beside))
            ball = float(np.max(np.linalg.norm(out, axis=1) + beside))
        else:
            link = feet[k - 1] - foot
            far = ball + float(np.linalg.norm(np.cross(link, axis)))
            ball += float(np.linalg.norm(link))
        found.append(far)
    return np.array(found)
