"""Capsules of a robot that is made from a URDF, and the floor below it."""

from __future__ import annotations

import re
from collections.abc import Sequence, Set
from typing import NamedTuple

import numpy as np

from ir_description.files.convex_pieces import fine_triangles
from ir_description.files.making import (
    CapsuleFit,
    LinkBody,
    UrdfArm,
    encloses,
    fitted,
    with_overhang,
)
from ir_description.shapes import Capsule
from ir_kernels import Chain
from ir_values.arrays import FloatArray

WRITTEN = 1e-9  # m: by which the digits of a file may move a capsule
_AT_JOINT = (6, 0.01)  # capsules at a joint at most, and what one must save, where that helps
_ELSEWHERE = (4, 0.01)
_AROUND = 1.2  # of a link's radius: what is that near to a joint is looked at more closely
_LONG = 5e-3  # m: a link without a body that is shorter needs no capsule


class Shapes(NamedTuple):
    """Capsules of a robot, and a sentence for each that says how well it fits."""

    capsules: tuple[Capsule, ...]
    sentences: tuple[str, ...]

    def of(self, link: str) -> list[str]:
        """The sentences on the capsules of a link."""
        begin = re.compile(rf"{re.escape(link)}(_\d+)?: ")
        return [each for each in self.sentences if begin.match(each)]


def capsules_of(
    arm: UrdfArm,
    bodies: Sequence[Sequence[LinkBody]],
    names: Sequence[str],
    radii: FloatArray | None,
    before: Shapes | None = None,
    finer: Set[tuple[int, int]] = frozenset(),
) -> Shapes:
    """Fitted to the bodies of each link; without any, from its joint to the next with the sheet's
    radius (7,), or with that of the link before. before: those of all links, of which only the
    pairs of links in `finer` get more and tighter ones, above all at the joints between them.
    """
    capsules: list[Capsule] = []
    sentences: list[str] = []
    earlier = () if before is None else before.capsules
    for k, own in enumerate(bodies):
        ends = [k == lower for lower, upper in finer if k in (lower, upper)]
        if before is not None and not ends:
            capsules += [each for each in earlier if each.link == k]
            sentences += before.of(names[k])
            continue
        to = arm.origin[k] if k < len(arm.origin) else np.zeros(3)
        wider = arm.rounding + max((body.beside for body in own), default=0.0) + WRITTEN
        if own:
            joints = [to if is_lower else np.zeros(3) for is_lower in sorted(set(ends))]
            radii_before = [each.radius for each in earlier if each.link == k]
            near = _AROUND * max(radii_before, default=0.0)
            fits, said = _fits(own, to, wider, joints, near)
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
    bodies: Sequence[LinkBody],
    to: FloatArray,
    wider: float,
    joints: Sequence[FloatArray],
    near: float,
) -> tuple[list[CapsuleFit], list[str]]:
    """Capsules of a link's bodies, with words on each; to (3,): the next joint; wider [m]: by what
    their radii will be larger; joints: within `near` [m] of which they are to be tighter.
    """
    fits: list[CapsuleFit] = []
    said: list[str] = []
    around = [body for body in bodies if body.exact is None]
    if around:
        slack = max(body.slack for body in around) + wider
        triangles = np.concatenate([body.triangles for body in around])
        fits += _tight(triangles, to, joints, near) if joints else fitted(triangles, to)
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


def _tight(
    triangles: FloatArray, to: FloatArray, joints: Sequence[FloatArray], around: float
) -> tuple[CapsuleFit, ...]:
    """Capsules of triangles (T, 3, 3), of which those at the joints have their own."""
    left = fine_triangles(triangles, 0.2 * around)
    fits: list[CapsuleFit] = []
    for joint in joints:
        there = np.linalg.norm(left.mean(axis=1) - joint, axis=1) < around
        if there.any():
            fits += fitted(left[there], to, *_AT_JOINT)
        left = left[~there]
    if len(left):
        fits += fitted(left, to, *_ELSEWHERE)
    return with_overhang(fits, triangles)


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
