"""Geometry of a collision model as arrays: capsules on links, bodies of the scene, and the pairs of
both.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ir_kernels import data
from ir_kernels.chain import Chain
from ir_kernels.data import BodyLike, CapsuleLike
from ir_kernels.errors import KernelError
from ir_values.arrays import FloatArray, IntArray

# What a proof of motion can end in.

FREE = 0  # proved: every distance stays above its threshold
COLLIDES = 1  # at some time a distance isn't above its threshold
UNDECIDED = 2  # neither could be shown: count it as unsafe


# The bodies of a scene as arrays: what the kernels and their reference compute with.
#
# A body is a convex solid with a pose; a mesh stands for the convex hull of its vertices.

KINDS = ("box", "cylinder", "sphere", "capsule", "plane", "mesh")
SIZES = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2, "plane": 0, "mesh": 0}


class Hull(NamedTuple):
    """A convex polytope: vertices (V, 3), triangles (F, 3) and edges (E, 2) of vertex indices,
    outward face normals (F, 3) and their offsets (F,): x is inside when normals @ x <= offsets.
    """

    vertices: FloatArray
    triangles: IntArray
    edges: IntArray
    normals: FloatArray
    offsets: FloatArray

    @property
    def sides(self) -> FloatArray:
        """(E, 3): the edges as vectors."""
        vectors: FloatArray = self.vertices[self.edges[:, 1]] - self.vertices[self.edges[:, 0]]
        return vectors


NO_HULL = Hull(
    np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros((0, 2), int), np.zeros((0, 3)), np.zeros(0)
)


@dataclass(frozen=True, eq=False)
class Scene:
    """B bodies: kind (B,) as index into KINDS, pose (B, 4, 4) in the world, size (B, 3), hull of
    each mesh.
    """

    names: tuple[str, ...]
    kind: IntArray
    pose: FloatArray
    size: FloatArray
    hulls: tuple[Hull, ...] = field(default=())


def hull(vertices: FloatArray, name: str) -> Hull:
    """Convex hull of `vertices` (V, 3). KernelError for fewer than four or for points that span no
    volume.
    """
    from scipy.spatial import ConvexHull, QhullError  # only scenes with meshes pay for this import

    try:
        found = ConvexHull(vertices)
    except (QhullError, ValueError) as error:
        reason = str(error).strip().splitlines()[0]
        raise KernelError(
            f"{name}: {len(vertices)} vertices have no convex hull with a volume: {reason}"
        ) from error
    corners = vertices[found.vertices]
    position = np.full(len(vertices), -1)
    position[found.vertices] = np.arange(len(corners))
    triangles = position[found.simplices].astype(np.int64)
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    normals = found.equations[:, :3].copy()
    offsets = -found.equations[:, 3]
    return Hull(corners, triangles, np.unique(sides, axis=0), normals, offsets)


def _size(body: BodyLike, name: str) -> FloatArray:
    size = data.array(body.size, f"{name}.size", (3,))
    used = SIZES[body.kind]
    if (size[:used] <= 0.0).any() and not (
        body.kind == "capsule" and size[0] > 0.0 and size[1] == 0.0
    ):
        raise KernelError(
            f"{name}.size is {size.tolist()} m: a {body.kind} needs {used} positive lengths"
        )
    return size


def _poses(bodies: Sequence[BodyLike]) -> FloatArray:
    """(B, 4, 4), checked together; one by one only to name the body that is wrong."""
    stacked = np.array([body.pose for body in bodies], dtype=np.float64).reshape(-1, 4, 4)
    try:
        return data.poses(stacked, "bodies") if len(bodies) else stacked
    except KernelError:
        return np.array([data.pose(body.pose, f"body {body.name!r}.pose") for body in bodies])


def scene(bodies: Sequence[BodyLike]) -> Scene:
    """The bodies as arrays, checked: KernelError names the body and what is wrong with it."""
    names = data.unique_names(bodies, "bodies")
    for body in bodies:
        if body.kind not in KINDS:
            raise KernelError(
                f"body {body.name!r} is a {body.kind!r}: known kinds are {', '.join(KINDS)}"
            )
    hulls = []
    for body in bodies:
        points = body.vertices if body.kind == "mesh" else None
        label = f"body {body.name!r}.vertices"
        hulls.append(
            NO_HULL if points is None else hull(data.array(points, label, (None, 3)), label)
        )
    count = len(bodies)
    return Scene(
        names=names,
        kind=np.array([KINDS.index(body.kind) for body in bodies], dtype=np.int64),
        pose=_poses(bodies),
        size=np.array([_size(body, f"body {body.name!r}") for body in bodies]).reshape(count, 3),
        hulls=tuple(hulls),
    )


ENVIRONMENT = "ENVIRONMENT"
SELF = "SELF"


class Pair(NamedTuple):
    """Two bodies whose distance is kept: a capsule (body_a) and a body of the scene, or another
    capsule (body_b).
    """

    kind: str
    body_a: str
    body_b: str


class Capsules(NamedTuple):
    """C capsules: link (C,), ends (C, 2, 3) in the link frames, radius (C,)."""

    names: tuple[str, ...]
    link: IntArray
    ends: FloatArray
    radius: FloatArray


class Geometry(NamedTuple):
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
    """The capsules as arrays, checked against a chain of n joints. Raises KernelError for a link
    that the chain has not, and for a radius or an end that makes no sense.
    """
    names = data.unique_names(items, "capsules")
    for item in items:
        label = f"capsule {item.name!r}"
        if not 0 <= item.link <= n:
            raise KernelError(f"{label} is on link {item.link}: the chain has links 0 to {n}")
        if not (np.isfinite(item.radius) and item.radius >= 0.0):
            raise KernelError(
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
        raise KernelError(f"{argument} names {name!r}: known are {listed}")


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
            raise KernelError(
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
    KernelError for unknown names.
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
