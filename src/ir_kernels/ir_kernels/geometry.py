"""What a collision model computes with, as arrays: capsules on links, bodies of the scene, and the
pairs of both.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ir_kernels import data
from ir_kernels.chain import Chain
from ir_kernels.data import BodyLike, CapsuleLike
from ir_kernels.errors import InputError
from ir_kernels.scene import Scene, scene
from ir_values.arrays import FloatArray, IntArray

ENVIRONMENT = "ENVIRONMENT"
SELF = "SELF"


class Pair(NamedTuple):
    """Two bodies whose distance is kept: a capsule (body_a) and a body of the scene, or another
    capsule (body_b).
    """

    kind: str
    body_a: str
    body_b: str


@dataclass(frozen=True, eq=False)
class Capsules:
    """C capsules: link (C,), ends (C, 2, 3) in the link frames, radius (C,)."""

    names: tuple[str, ...]
    link: IntArray
    ends: FloatArray
    radius: FloatArray


@dataclass(frozen=True, eq=False)
class Geometry:
    """A chain with capsules in a scene; Z pairs, environment (E, 2: capsule, body) before self (S,
    2: capsules).
    """

    chain: Chain
    capsules: Capsules
    scene: Scene
    environment: IntArray
    self_pairs: IntArray

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """The Z pairs by name, in their fixed order."""
        capsule = self.capsules.names
        body = self.scene.names
        outside = [Pair(ENVIRONMENT, capsule[a], body[b]) for a, b in self.environment]
        return (*outside, *(Pair(SELF, capsule[a], capsule[b]) for a, b in self.self_pairs))


def capsules(items: Sequence[CapsuleLike], n: int) -> Capsules:
    """The capsules as arrays, checked against a chain of n joints."""
    names = data.unique_names(items, "capsules")
    for item in items:
        label = f"capsule {item.name!r}"
        if not 0 <= item.link <= n:
            raise InputError(f"{label} is on link {item.link}: the chain has links 0 to {n}")
        if not (np.isfinite(item.radius) and item.radius >= 0.0):
            raise InputError(
                f"{label} has radius {item.radius} m: expected a finite length of at least 0"
            )
    ends = [
        (
            data.array(item.p0, f"capsule {item.name!r}.p0", (3,)),
            data.array(item.p1, f"capsule {item.name!r}.p1", (3,)),
        )
        for item in items
    ]
    return Capsules(
        names=names,
        link=np.array([item.link for item in items], dtype=np.int64),
        ends=np.array(ends, dtype=np.float64).reshape(len(items), 2, 3),
        radius=np.array([item.radius for item in items], dtype=np.float64),
    )


def _known(name: str, names: Sequence[str], argument: str) -> None:
    if name not in names:
        listed = ", ".join(list(names)[:40]) or "none"
        raise InputError(f"{argument} names {name!r}: known are {listed}")


def _self_pairs(
    pairs: Iterable[tuple[str, str]], names: tuple[str, ...], ignored: set[frozenset[str]]
) -> list[tuple[int, int]]:
    """Numbers of the capsules of each pair that is not ignored."""
    index = {name: k for k, name in enumerate(names)}
    own = []
    for first, second in pairs:
        _known(first, names, "self_pairs")
        _known(second, names, "self_pairs")
        if first == second:
            raise InputError(
                f"self_pairs holds ({first!r}, {second!r}): a capsule has no distance from itself"
            )
        if frozenset((first, second)) not in ignored:
            own.append((index[first], index[second]))
    return own


def geometry(
    chain: Chain,
    items: Sequence[CapsuleLike],
    bodies: Sequence[BodyLike],
    self_pairs: Iterable[tuple[str, str]],
    ignored_pairs: Iterable[tuple[str, str]],
) -> Geometry:
    """Capsules, bodies and their pairs, checked.

    Every capsule meets every body, but capsules of link 0 (they don't move: the cell's business)
    and the pairs in `ignored_pairs` (capsule and body in either order; also of self pairs). Raises
    InputError for unknown names.
    """
    robot = capsules(items, chain.n)
    environment = scene(bodies)
    ignored = {frozenset(pair) for pair in ignored_pairs}
    known = (*robot.names, *environment.names)
    for name in sorted({name for pair in ignored for name in pair}.difference(known)):
        _known(name, known, "ignored_pairs")
    kept = [
        (a, b)
        for a, capsule in enumerate(robot.names)
        if robot.link[a] > 0
        for b, body in enumerate(environment.names)
        if not ignored or frozenset((capsule, body)) not in ignored
    ]
    own = _self_pairs(self_pairs, robot.names, ignored)
    return Geometry(
        chain,
        robot,
        environment,
        np.array(kept, dtype=np.int64).reshape(-1, 2),
        np.array(own, dtype=np.int64).reshape(-1, 2),
    )
