"""The bodies of a scene as arrays: what the kernels and their reference compute with.

A body is a convex solid with a pose; a mesh stands for the convex hull of its vertices.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ir_kernels import data
from ir_kernels.data import BodyLike
from ir_kernels.errors import InputError
from ir_values.arrays import FloatArray, IntArray

KINDS = ("box", "cylinder", "sphere", "capsule", "plane", "mesh")
SIZES = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2, "plane": 0, "mesh": 0}


@dataclass(frozen=True, eq=False)
class Hull:
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
    """Convex hull of `vertices` (V, 3). InputError for fewer than four or for points that span no
    volume.
    """
    from scipy.spatial import ConvexHull, QhullError  # only scenes with meshes pay for this import

    try:
        found = ConvexHull(vertices)
    except (QhullError, ValueError) as error:
        reason = str(error).strip().splitlines()[0]
        raise InputError(
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
        raise InputError(
            f"{name}.size is {size.tolist()} m: a {body.kind} needs {used} positive lengths"
        )
    return size


def _poses(bodies: Sequence[BodyLike]) -> FloatArray:
    """(B, 4, 4), checked together; one by one only to name the body that is wrong."""
    stacked = np.array([body.pose for body in bodies], dtype=np.float64).reshape(-1, 4, 4)
    try:
        return data.poses(stacked, "bodies") if len(bodies) else stacked
    except InputError:
        return np.array([data.pose(body.pose, f"body {body.name!r}.pose") for body in bodies])


def scene(bodies: Sequence[BodyLike]) -> Scene:
    """The bodies as arrays, checked: InputError names the body and what is wrong with it."""
    names = data.unique_names(bodies, "bodies")
    for body in bodies:
        if body.kind not in KINDS:
            raise InputError(
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
