"""Bodies of a link: what its collision shapes look like as triangles, and where their meshes are.

Every shape becomes one body. Balls and capsules stay exact; the triangles of all others contain
them.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ir_description.files.collada import triangles_from_collada
from ir_description.files.curved_surfaces import KINDS as SURFACES
from ir_description.files.curved_surfaces import triangles_of_surfaces
from ir_description.files.making.capsule_fit import CapsuleFit
from ir_description.files.making.urdf_arm import PlacedShape, SideMotion
from ir_description.files.making.urdf_tree import UrdfShape
from ir_description.files.solid_mesh import triangles_from_obj
from ir_description.files.stl_mesh import (
    BYTES_MAX,
    READ_MAX,
    TRIANGLES_MAX,
    refuse_surfaces,
    triangles_from_stl,
)
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, shown
from ir_values.files import read_regular_file

AROUND = 24  # corners of a circle
SIZE_MAX = 20.0
"""Farthest corner [m] of a mesh from its origin: beyond, its scale is hardly meant."""
_SWEEP = np.radians(15.0)  # between two postures of a joint that sweeps
_FOLDERS_MAX = 20_000
_SLABS = 32  # of a mesh of more than TRIANGLES_MAX triangles


@dataclass(frozen=True, eq=False)
class LinkBody:
    """place: which shape it is, for people. triangles (T, 3, 3) [m] in the planned link contain its
    surface but for `beside` [m]. exact: the capsule that it is, None for others. slack [m]: how far
    the triangles stand out from the shape at most.
    """

    place: str
    triangles: FloatArray
    exact: CapsuleFit | None = None
    slack: float = 0.0
    beside: float = 0.0


class Meshes:
    """Meshes of a URDF in a folder; `packages`: a folder below which packages lie. notes: what was
    assumed.
    """

    def __init__(self, folder: Path, packages: Path | None) -> None:
        self._folder = folder.resolve()
        self._packages = packages.resolve() if packages else None
        self._known: dict[str, tuple[FloatArray, float]] = {}
        self._homes: dict[str, Path | None] = {}
        self.notes: list[str] = []

    def triangles(self, name: str) -> tuple[FloatArray, float]:
        """Triangles (T, 3, 3) of a mesh as its file has them (Collada, STEP: in metres), and how
        far [m] its surface may be beside them. Raises InvalidValueError.
        """
        if name not in self._known:
            path = self._path(name)
            try:
                read, beside = _read(path)
                triangles = self._bounded(read, path)
            except InvalidValueError as error:
                raise InvalidValueError(f"{path}: {error}") from error
            if not len(triangles) or not np.isfinite(triangles).all():
                raise InvalidValueError(
                    f"{path}: the mesh is empty, or has corners that are not finite"
                )
            if beside:
                self.notes.append(
                    f"{path.name}: its curved surfaces are taken as triangles that OpenCASCADE "
                    f"lays within {1e3 * beside:g} mm of them, which is not proved; capsules are "
                    "wider by that"
                )
            self._known[name] = triangles, beside
        return self._known[name]

    def _bounded(self, triangles: FloatArray, path: Path) -> FloatArray:
        """The triangles; hulls that contain them where they are too many for capsules."""
        if len(triangles) <= TRIANGLES_MAX or not np.isfinite(triangles).all():
            return triangles
        slabs = _slabs(triangles)
        self.notes.append(
            f"{path.name}: {len(triangles)} triangles are taken as the hulls of {_SLABS} slabs of "
            "them, which contain it"
        )
        return slabs

    def _path(self, name: str) -> Path:
        if name.startswith(("package://", "model://")):
            package, _, rest = name.partition("://")[2].partition("/")
            home = self.package(package)
            path = None if home is None else home / rest
            missing = f"package {shown(package)}" if home is None else f"file {path}"
        else:
            path = self._folder / name.removeprefix("file://")
            missing = f"file {path}"
        if path is None or not path.is_file():
            raise InvalidValueError(
                f"mesh {name}: {missing} is not found; --packages FOLDER names a folder below "
                "which the package lies"
            )
        return path

    def package(self, name: str) -> Path | None:
        """The folder of a package, None where it is not found."""
        if name not in self._homes:
            self._homes[name] = next(self._homes_of(name), None)
        return self._homes[name]

    def _homes_of(self, name: str) -> Iterator[Path]:
        for above in (self._folder, *self._folder.parents):
            for home in (above, above / name):
                if _is_package(home, name):
                    yield home
        for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
            if prefix and (home := Path(prefix) / "share" / name).is_dir():
                yield home
        if self._packages is not None:
            below = (path for path in self._packages.rglob(name) if _is_package(path, name))
            yield from itertools.islice(below, _FOLDERS_MAX)
        ancestors = (self._folder, *self._folder.parents)
        if not any(
            (each / "package.xml").is_file() for each in ancestors
        ):  # files without a package
            for place in (self._packages, self._folder, self._folder.parent):
                if place is not None:
                    assumed = f"package {name} is not found by its name: {place} is taken for it"
                    self.notes.append(assumed)
                    yield place


def _is_package(folder: Path, name: str) -> bool:
    """Whether a folder is the package: by its package.xml, else by its own name."""
    manifest = folder / "package.xml"
    if manifest.is_file():
        text = manifest.read_text(encoding="utf-8", errors="replace")
        return f"<name>{name}</name>" in text.replace(" ", "")
    return folder.name == name and folder.is_dir()


def _read(path: Path) -> tuple[FloatArray, float]:
    """Triangles (T, 3, 3) of a file, and how far [m] its surfaces may be beside them."""
    suffix = path.suffix.lower()
    if suffix in SURFACES:
        return triangles_of_surfaces(read_regular_file(path, BYTES_MAX), suffix, READ_MAX)
    return _read_triangles(path), 0.0


def _read_triangles(path: Path) -> FloatArray:
    refuse_surfaces(path)
    content = read_regular_file(path, BYTES_MAX)
    suffix = path.suffix.lower()
    if suffix == ".stl":
        return triangles_from_stl(content, READ_MAX)
    if suffix == ".dae":
        return triangles_from_collada(content)
    if suffix == ".obj":
        return triangles_from_obj(content, READ_MAX)
    try:
        import trimesh
    except ImportError as error:
        raise InvalidValueError(
            f"{suffix or 'a file without an ending'} is no STL, OBJ or Collada file: "
            "pip install trimesh reads more"
        ) from error
    try:
        mesh: Any = trimesh.load_mesh(path)
        return np.array(mesh.triangles, dtype=np.float64)
    except Exception as error:  # of trimesh, of any kind
        raise InvalidValueError(f"it can't be read: {shown(str(error), 120)}") from error


def link_bodies(shapes: Sequence[PlacedShape], meshes: Meshes) -> list[LinkBody]:
    """One body for each shape. Raises InvalidValueError with the place of a mesh that can't be
    read.
    """
    return [_body(placed, meshes) for placed in shapes]


def _body(placed: PlacedShape, meshes: Meshes) -> LinkBody:
    shape = placed.shape
    if shape.kind in ("sphere", "capsule") and not placed.motions:
        radius, length, _ = shape.size
        half = 0.5 * length * shape.pose[:3, 2]
        middle = shape.pose[:3, 3]
        exact = CapsuleFit(middle - half, middle + half, float(radius), 0.0)
        return LinkBody(shape.place, np.zeros((0, 3, 3)), exact)
    beside = 0.0
    try:
        if shape.kind == "mesh":
            triangles, beside = meshes.triangles(shape.file)
            triangles = triangles * shape.size
            beside *= float(np.abs(shape.size).max())
        else:
            triangles = _triangles(shape)
    except InvalidValueError as error:
        raise InvalidValueError(f"{shape.place}: {error}") from error
    triangles = np.asarray(triangles @ shape.pose[:3, :3].T + shape.pose[:3, 3])
    far = float(np.abs(triangles).max())
    if far > SIZE_MAX:
        raise InvalidValueError(
            f"{shape.place} reaches {far:g} m, must stay within {SIZE_MAX:g} m: is a scale of "
            "0.001 missing (millimetres)?"
        )
    for motion in placed.motions:
        triangles = _swept(triangles, motion)
    slack = (
        shape.size[0] / np.cos(np.pi / AROUND) - shape.size[0] if shape.kind == "cylinder" else 0.0
    )
    return LinkBody(shape.place, triangles, slack=float(slack), beside=beside)


def _triangles(shape: UrdfShape) -> FloatArray:
    """Triangles (T, 3, 3) of a shape that is no mesh, in its own frame."""
    if shape.kind == "box":
        return _hull(np.array(list(itertools.product(*((-s / 2, s / 2) for s in shape.size)))))
    radius, length, _ = shape.size
    turn = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    out = radius / np.cos(np.pi / AROUND)  # the polygon encloses the circle
    rim = np.stack([out * np.cos(turn), out * np.sin(turn), np.zeros(AROUND)], axis=1)
    if shape.kind == "cylinder":
        up = np.array([0.0, 0.0, length / 2.0])
        return _hull(np.concatenate([rim + up, rim - up]))
    return _hull(
        np.array(
            list(
                itertools.product(
                    (-radius, radius),
                    (-radius, radius),
                    (-radius - length / 2, radius + length / 2),
                )
            )
        )
    )


def _swept(triangles: FloatArray, motion: SideMotion) -> FloatArray:
    """The hull of everything that a joint beside the planned axes can make of triangles: of a
    turning one with points pushed out so that chords hold the arcs between.
    """
    points = _hull(triangles.reshape(-1, 3)).reshape(-1, 3)
    points = np.unique(points, axis=0)
    count = 2
    if motion.kind == "revolute":
        count = max(2, int(np.ceil((motion.upper - motion.lower) / _SWEEP)) + 1)
        step = (motion.upper - motion.lower) / (count - 1)
        beside = points - np.outer(points @ motion.axis, motion.axis)
        points = np.concatenate([points, points + (1.0 / np.cos(0.5 * step) - 1.0) * beside])
    poses = [motion.at(value) for value in np.linspace(motion.lower, motion.upper, count)]
    return _hull(np.concatenate([points @ pose[:3, :3].T + pose[:3, 3] for pose in poses]))


def _slabs(triangles: FloatArray) -> FloatArray:
    """Hulls (T, 3, 3) of slabs of triangles across their longest direction; together they contain
    every triangle.
    """
    middles = triangles.mean(axis=1)
    longest = int(np.argmax(np.ptp(middles, axis=0)))
    parts = np.array_split(np.argsort(middles[:, longest], kind="stable"), _SLABS)
    return np.concatenate([_hull(triangles[part].reshape(-1, 3)) for part in parts])


def _hull(points: FloatArray) -> FloatArray:
    """Triangles (T, 3, 3) of the hull of points (N, 3); of flat ones, a fan through all of them."""
    try:
        return np.asarray(points[ConvexHull(points).simplices])
    except (QhullError, ValueError):
        points = np.unique(points, axis=0)
        first = np.repeat(points[:1], max(len(points) - 2, 1), axis=0)
        second = points[1:-1] if len(points) > 2 else points[-1:]
        third = points[2:] if len(points) > 2 else points[-1:]
        return np.stack([first, second, third], axis=1)


# Mass properties of a link that the URDF gives none, from the volume of its bodies.


def volume_of(bodies: Sequence[LinkBody]) -> tuple[float, FloatArray, FloatArray]:
    """Volume [m^3] of the hulls of bodies, its centre (3,) [m], and its second moments (3, 3) [m^5]
    about it as the inertia of a density of 1. What bodies share counts twice.
    """
    volume = 0.0
    first = np.zeros(3)
    second = np.zeros((3, 3))
    for body in bodies:
        points = _outline(body)
        try:
            hull = ConvexHull(points)
        except (QhullError, ValueError):
            continue
        a, b, c = (points[hull.simplices[:, k]] for k in range(3))
        inside = points.mean(axis=0)
        sizes = np.abs(np.einsum("ni,ni->n", a - inside, np.cross(b - inside, c - inside))) / 6.0
        corners = np.stack([a, b, c, np.broadcast_to(inside, a.shape)], axis=1)
        total = corners.sum(axis=1)
        volume += float(sizes.sum())
        first += (sizes[:, None] * total).sum(axis=0) / 4.0
        outer = np.einsum("nki,nkj->nij", corners, corners) + np.einsum("ni,nj->nij", total, total)
        second += np.einsum("n,nij->ij", sizes, outer) / 20.0
    if not volume > 0.0:
        return 0.0, np.zeros(3), np.zeros((3, 3))
    centre = first / volume
    central = second - volume * np.outer(centre, centre)
    return volume, centre, np.asarray(np.trace(central) * np.eye(3) - central)


def box_of(bodies: Sequence[LinkBody]) -> tuple[FloatArray, FloatArray]:
    """Least and largest coordinates (3,) [m] of bodies, of which there is one at least."""
    points = np.concatenate([_outline(body) for body in bodies])
    return points.min(axis=0), points.max(axis=0)


def _outline(body: LinkBody) -> FloatArray:
    if body.exact is None:
        return body.triangles.reshape(-1, 3)
    k = np.arange(200) + 0.5
    height = 1.0 - k / 100.0
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - height**2)
    ball = np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
    return np.concatenate([end + body.exact.radius * ball for end in body.exact[:2]])
