"""Capsules of a robot that is made from a URDF, and which of them can touch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from ir_description import Capsule
from ir_description.files.convex_pieces import halved
from ir_description.files.making import CapsuleFit, LinkBody, UrdfArm, encloses, fitted
from ir_description.robot import ReducedDistance
from ir_kernels import Chain, CollisionModel
from ir_values.arrays import FloatArray

WRITTEN = 1e-9  # m: by which the digits of a file may move a capsule
_LONG = 5e-3  # m: a link without a body that is shorter needs no capsule


class Shapes(NamedTuple):
    """Capsules of a robot, and a sentence for each that says how well it fits."""

    capsules: tuple[Capsule, ...]
    sentences: tuple[str, ...]


def capsules_of(
    arm: UrdfArm,
    bodies: Sequence[Sequence[LinkBody]],
    names: Sequence[str],
    radii: FloatArray | None,
) -> Shapes:
    """Fitted to the bodies of each link; without any, from its joint to the next with the sheet's
    radius (7,), or with that of the link before.
    """
    capsules: list[Capsule] = []
    sentences: list[str] = []
    for k, own in enumerate(bodies):
        to = arm.origin[k] if k < len(arm.origin) else np.zeros(3)
        wider = arm.rounding + max((body.beside for body in own), default=0.0) + WRITTEN
        if own:
            fits, said = _fits(own, to, wider)
        else:
            fits, said = _without_body(to, k, capsules, radii)
            if not fits:
                sentences.append(f"{names[k]}: no body; nothing of it is checked")
        for n, (fit, how) in enumerate(zip(fits, said, strict=True)):
            name = f"{names[k]}_{n}"
            radius = fit.radius + wider
            capsules.append(Capsule(name=name, link=k, p0=fit.p0, p1=fit.p1, radius=radius))
            sentences.append(f"{name}: radius {1e3 * radius:.0f} mm, {how}")
    return Shapes(tuple(capsules), tuple(sentences))


def _fits(
    bodies: Sequence[LinkBody], to: FloatArray, wider: float
) -> tuple[list[CapsuleFit], list[str]]:
    """Capsules of a link's bodies, with words on each; to (3,): the next joint; wider [m]: by what
    their radii will be larger.
    """
    fits: list[CapsuleFit] = []
    said: list[str] = []
    around = [body for body in bodies if body.exact is None]
    if around:
        slack = max(body.slack for body in around) + wider
        fits += fitted(np.concatenate([body.triangles for body in around]), to)
        stands = [f"stands out {_millimetres(fit.overhang + slack)} mm at most" for fit in fits]
        holds = f"{around[0].place}" if len(around) == 1 else f"{len(around)} bodies"
        said += [f"{words} from what it encloses: {holds}" for words in stands]
    for body in bodies:
        if body.exact is None:
            continue
        home = next((k for k, fit in enumerate(fits) if encloses(fit, body.exact)), None)
        if home is None:
            fits.append(body.exact)
            said.append(f"exact: {body.place}")
        else:
            said[home] += f", {body.place}"
    return fits, said


def _millimetres(length: float) -> int:
    """Whole ones that a length [m] is at most."""
    return int(np.ceil(1e3 * length))


def _without_body(
    to: FloatArray, link: int, before: Sequence[Capsule], radii: FloatArray | None
) -> tuple[list[CapsuleFit], list[str]]:
    """A capsule along a link that has no shape in the URDF; none where it is short."""
    if radii is None and (float(np.linalg.norm(to)) < _LONG or not before):
        return [], []
    radius = float(radii[link]) if radii is not None else 0.8 * before[-1].radius
    fit = CapsuleFit(np.zeros(3), to, radius, 0.0)
    return [fit], ["no shape in the URDF: along its axis, an estimate"]


FLOOR_ROOM = 0.03
"""m that moving links stay above the floor: more than the safety distance of a request."""
_TURNS = 24  # of axes 1 and 2


def floor_below(chain: Chain, capsules: Sequence[Capsule]) -> float:
    """Height [m] of the floor below the foot of an arm, rounded down to cm: 0, or less where
    capsules of links 1 and 2, which stand out from these, reach below the foot wherever they turn.
    """
    angles = np.linspace(-np.pi, np.pi, _TURNS)
    q = np.zeros((_TURNS * _TURNS, chain.n))
    q[:, 0] = np.repeat(angles, _TURNS)
    q[:, 1] = np.tile(angles, _TURNS)
    first, second = (
        lowest_points(chain, q, [each for each in capsules if each.link == link]) for link in (1, 2)
    )
    lowest = min(float(first.min()), float(second.max()))
    return 0.0 if lowest >= FLOOR_ROOM else float(np.floor(100.0 * (lowest - FLOOR_ROOM))) / 100.0


def lowest_points(chain: Chain, q: FloatArray, capsules: Sequence[Capsule]) -> FloatArray:
    """Height (N,) [m] of the lowest point of capsules in postures q (N, 6); inf without any."""
    poses = chain.link_poses(q)
    heights = [
        poses[:, each.link, 2, :3] @ end + poses[:, each.link, 2, 3] - each.radius
        for each in capsules
        for end in (each.p0, each.p1)
    ]
    return np.asarray(np.min(heights, axis=0)) if heights else np.full(len(q), np.inf)


# Which pairs can touch. Neighbours are left out: their bodies meet at the joint. Others that are
# near in many postures are near by construction: they keep a distance of their own, so that
# capsules that are wider than the bodies leave the robot its work.

SAFETY = 0.02
"""Safety distance [m] of a request that says nothing."""
POSTURES = 3000
NEAR = 0.25
"""Share of postures that a pair may take from the robot before it counts as near by
construction.
"""
ROOM = 0.002
"""m below the nearest posture in which the bodies were seen to be free."""
_BODY_POSTURES = 60
_LEFT = 0.3  # of the postures that a pair must leave to be told apart by its capsules
_DEEPEST = 0.1  # of the postures of a pair that is built so, which are not allowed
_SAMPLES = 6_000
_FAR = 0.05  # m: bodies that are farther apart need no figure


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
) -> Pairs:
    """All pairs of capsules of links that are no neighbours; low, high (6,) rad."""
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
    link = {capsule.name: capsule.link for capsule in capsules}
    shapes = _Bodies(bodies, chain)
    groups: dict[tuple[int, int], list[int]] = {}
    for z, pair in enumerate(model.pairs):
        if float((distance[:, z] <= SAFETY).mean()) > NEAR:
            groups.setdefault((link[pair.body_a], link[pair.body_b]), []).append(z)
    reduced = []
    for (one, other), near in groups.items():
        apart = shapes.apart(q[:_BODY_POSTURES], one, other)
        own = [_own_distance(distance[:, z], apart) for z in near]
        together = (distance[:, near] > [kept for kept, _ in own]).all(axis=1).mean()
        if together < _LEFT:  # each leaves enough, all together do not
            own = [_own_distance(distance[:, z], apart, told_apart=False) for z in near]
        reduced += [
            ReducedDistance(model.pairs[z].body_a, model.pairs[z].body_b, *each)
            for z, each in zip(near, own, strict=True)
        ]
    return Pairs(tuple(far), tuple(reduced))


def _own_distance(
    distance: FloatArray, apart: FloatArray, *, told_apart: bool = True
) -> tuple[float, str]:
    """What a pair with these distances in postures (N,) keeps, and the reason; apart: lower bounds
    of the distance of the bodies in the first of them; told_apart: whether postures in which bodies
    are free are told from others by the distance of the capsules.
    """
    near = 100.0 * float((distance <= SAFETY).mean())
    often = f"nearer than {1e3 * SAFETY:g} mm in {near:.0f} % of {len(distance)} postures"
    taken = np.argsort(distance[: len(apart)], kind="stable")
    free = apart[taken]  # by rising distance of the capsules
    meeting = (free <= 0.0) & (distance[taken] <= 0.0)
    first = int(np.flatnonzero(meeting)[-1]) + 1 if meeting.any() else 0
    left = len(taken) - first
    if told_apart and left >= _LEFT * len(taken):
        kept = min(float(distance[taken[first]]) - ROOM, SAFETY)
        least = 1e3 * max(float(free[first:].min()), 0.0)
        return kept, often if kept >= 0.0 else (
            f"{often}; where the capsules overlap by less, the bodies of the URDF stay {least:.0f} "
            f"mm apart or more in the {left} postures that were looked at"
        )
    kept = min(float(np.quantile(distance, _DEEPEST)) - ROOM, SAFETY)
    if kept >= 0.0:
        return kept, often
    there = int(meeting[distance[taken] > kept].sum())
    return kept, (
        f"{often}; the bodies of the URDF themselves meet, or are too near to tell, in {there} of "
        f"{int((distance[taken] > kept).sum())} postures that were looked at: built so, they come "
        "no nearer than in nine of ten postures"
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


class _Bodies:
    """Surfaces of the links, and how far two of them are apart."""

    def __init__(self, bodies: Sequence[Sequence[LinkBody]], chain: Chain) -> None:
        self._bodies = bodies
        self._chain = chain
        self._known: dict[int, tuple[FloatArray, FloatArray]] = {}
        self._apart: dict[tuple[int, int], FloatArray] = {}

    def apart(self, q: FloatArray, one: int, other: int) -> FloatArray:
        """Lower bounds (N,) [m] of the distance of two links in postures q (N, 6), the same for
        each pair; at most _FAR.
        """
        if (one, other) not in self._apart:
            self._apart[one, other] = self._bounds(q, one, other)
        return self._apart[one, other]

    def _bounds(self, q: FloatArray, one: int, other: int) -> FloatArray:
        first, spread = self._surface(one)
        second, more = self._surface(other)
        if not len(first) or not len(second):
            return np.full(len(q), np.inf)
        tree = cKDTree(second)
        poses = self._chain.link_poses(q)
        result = np.zeros(len(q))
        for k, pose in enumerate(np.linalg.inv(poses[:, other]) @ poses[:, one]):
            points = first @ pose[:3, :3].T + pose[:3, 3]
            found = np.minimum(tree.query(points, distance_upper_bound=_FAR)[0], _FAR)
            result[k] = (found - spread).min() - more.max()
        return result

    def _surface(self, link: int) -> tuple[FloatArray, FloatArray]:
        """Points (N, 3) of a link's surface, and how far around each (N,) there are no others."""
        if link not in self._known:
            self._known[link] = _sampled(self._bodies[link])
        return self._known[link]


def _sampled(bodies: Sequence[LinkBody]) -> tuple[FloatArray, FloatArray]:
    triangles = [body.triangles for body in bodies if body.exact is None]
    parts = np.concatenate(triangles) if triangles else np.zeros((0, 3, 3))
    while 0 < len(parts) < _SAMPLES:
        edges = np.linalg.norm(parts - np.roll(parts, -1, axis=1), axis=2).max(axis=1)
        long = edges >= np.quantile(edges, 0.7)
        parts = np.concatenate([parts[~long], halved(parts[long])])
    centres = parts.mean(axis=1)
    spread = np.linalg.norm(parts - centres[:, None], axis=2).max(axis=1)
    points = [centres]
    spreads = [spread]
    for body in bodies:
        if body.exact is not None:
            p0, p1, radius, _ = body.exact
            points.append(np.linspace(p0, p1, 20))
            spreads.append(np.full(20, radius + 0.03 * float(np.linalg.norm(p1 - p0))))
    return np.concatenate(points), np.concatenate(spreads)
