"""`ir robot new`: a robot file from a URDF and a sheet of drive figures."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ir_cli.errors import CommandError, InputError
from ir_description import Capsule, DescriptionError, InvalidValueError, RobotFileError
from ir_description.files import read_regular_file, text_of
from ir_description.files.making import (
    DriveSheet,
    UrdfArm,
    drive_sheet,
    fitted,
    robot_text,
    urdf_arm,
)
from ir_description.files.making.robot_text import link_names
from ir_description.files.making.urdf_arm import UrdfShape
from ir_description.files.mesh import read_stl
from ir_kernels import Chain, CollisionModel
from ir_msgs_py.arrays import FloatArray
from ir_values.output_files import write_file

# Capsules from the collision shapes of the URDF, and the pairs of them that can touch.

SAMPLES = 2000  # configurations in which pairs are tried
ALWAYS = 0.9  # of them: what touches so often is built so
SAME = 1e-3  # m: a distance that changes less is one of the build, not of the posture
AROUND = 24  # corners of a circle
ON_SPHERE = 300


class Shapes(NamedTuple):
    """Capsules of a robot, and a sentence for each that says how well it fits."""

    capsules: tuple[Capsule, ...]
    sentences: tuple[str, ...]


def capsules_of(arm: UrdfArm, sheet: DriveSheet, names: tuple[str, ...], folder: Path) -> Shapes:
    """Fitted to the shapes of each link; without any, from its joint to the next with the sheet's
    radius.
    """
    capsules = []
    sentences = []
    for k, link in enumerate(arm.links):
        to = arm.origin[k] if k < len(arm.origin) else np.zeros(3)
        if link.shapes:
            triangles = np.concatenate([_triangles(shape, folder) for shape in link.shapes])
            for n, fit in enumerate(fitted(triangles, to)):
                name = f"{names[k]}_{n}"
                capsules.append(Capsule(name=name, link=k, p0=fit.p0, p1=fit.p1, radius=fit.radius))
                size = f"radius {1e3 * fit.radius:.0f} mm"
                sentences.append(
                    f"{name}: {size}, stands out {1e3 * fit.overhang:.0f} mm from the shape at most"
                )
        elif sheet.radii is not None:
            radius = float(sheet.radii[k])
            capsules.append(
                Capsule(name=f"{names[k]}_0", link=k, p0=np.zeros(3), p1=to, radius=radius)
            )
            sentences.append(
                f"{names[k]}_0: no shape; radius {1e3 * radius:.0f} mm along its axis, an estimate"
            )
        else:
            raise CommandError(
                f"link {link.name} has no collision shape: give capsule_radius_m in the drive sheet"
            )
    return Shapes(tuple(capsules), tuple(sentences))


def touching_pairs(
    arm: UrdfArm, capsules: tuple[Capsule, ...], low: FloatArray, high: FloatArray
) -> list[tuple[str, str]]:
    """Pairs of capsules of links that are no neighbours, but for those that touch in nearly every
    posture, or whose distance hardly changes; low, high (6,) rad.
    """
    origins = np.tile(np.eye(4), (len(arm.origin), 1, 1))
    origins[:, :3, 3] = arm.origin
    origins[-1, :3, :3] = arm.flange
    chain = Chain(SimpleNamespace(joint_origin=origins, joint_axis=arm.axis))
    far = [
        (a.name, b.name) for a, b in itertools.combinations(capsules, 2) if abs(a.link - b.link) > 1
    ]
    model = CollisionModel(chain, capsules, (), far)
    q = np.random.default_rng(0).uniform(low, high, (SAMPLES, len(low)))
    distance = model.distances(q)
    touching = (distance <= 0.0).mean(axis=0)
    moving = np.ptp(distance, axis=0) > SAME
    known = {frozenset((pair.body_a, pair.body_b)): z for z, pair in enumerate(model.pairs)}
    return [pair for pair in far if touching[z := known[frozenset(pair)]] < ALWAYS and moving[z]]


def _triangles(shape: UrdfShape, folder: Path) -> FloatArray:
    """Triangles (T, 3, 3) of a shape in its link."""
    if shape.kind == "mesh":
        points = _mesh(shape.file, folder) * shape.size
    else:
        points = _hull_triangles(
            {"box": _box, "cylinder": _cylinder, "sphere": _sphere}[shape.kind](shape.size)
        )
    return np.asarray(points @ shape.pose[:3, :3].T + shape.pose[:3, 3])


def _mesh(name: str, folder: Path) -> FloatArray:
    path = next((path for path in _places(name, folder) if path.is_file()), None)
    if path is None:
        raise CommandError(f"mesh {name} is not found in {folder} or above it (--packages FOLDER)")
    if path.suffix.lower() == ".stl":
        try:
            return read_stl(path)
        except InvalidValueError as error:
            raise CommandError(f"{path}: {error}") from error
    try:
        import trimesh
    except ImportError as error:
        raise CommandError(f"{path.name} is no STL file: pip install trimesh reads it") from error
    return np.array(trimesh.load_mesh(path).triangles, dtype=np.float64)


def _places(name: str, folder: Path) -> Iterator[Path]:
    """Where a mesh may be: package://NAME/REST below a folder called NAME, or below this one or one
    above.
    """
    rest = name.removeprefix("package://").removeprefix("file://")
    yield Path(rest) if Path(rest).is_absolute() else folder / rest
    inner = rest.partition("/")[2]
    for above in (folder, *folder.resolve().parents):
        yield above / rest
        yield above / inner


def _hull_triangles(points: FloatArray) -> FloatArray:
    from scipy.spatial import ConvexHull

    return np.asarray(points[ConvexHull(points).simplices])


def _box(size: FloatArray) -> FloatArray:
    return np.array(list(itertools.product(*((-s / 2, s / 2) for s in size))))


def _cylinder(size: FloatArray) -> FloatArray:
    turn = np.linspace(0.0, 2.0 * np.pi, AROUND, endpoint=False)
    radius = size[0] / np.cos(np.pi / AROUND)  # the polygon encloses the circle
    rim = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.zeros(AROUND)], axis=1)
    up = np.array([0.0, 0.0, size[1] / 2.0])
    return np.concatenate([rim + up, rim - up])


def _sphere(size: FloatArray) -> FloatArray:
    k = np.arange(ON_SPHERE) + 0.5
    height = 1.0 - 2.0 * k / ON_SPHERE
    turn = np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - height**2)
    return np.asarray(
        size[0] * 1.02 * np.stack([flat * np.cos(turn), flat * np.sin(turn), height], axis=1)
    )


BYTES_MAX = 8_000_000


def write_robot(urdf: Path, drives: Path, tip: str, packages: Path | None, out: Path) -> None:
    """Write the robot file, and say how well its capsules fit. Raises CommandError."""
    try:
        arm = urdf_arm(_text(urdf), str(urdf), tip)
        sheet = drive_sheet(_text(drives), str(drives), arm)
    except (DescriptionError, InvalidValueError) as error:
        raise InputError(str(error)) from error
    shapes = capsules_of(arm, sheet, link_names(arm, sheet), packages or urdf.parent)
    low, high = (np.radians(sheet.values[f"position_{end}_deg"].numbers) for end in ("min", "max"))
    pairs = touching_pairs(arm, shapes.capsules, low, high)
    try:
        write_file(
            out, robot_text(arm, sheet, shapes.capsules, pairs, _comments(urdf, drives, shapes))
        )
    except OSError as error:
        raise CommandError(f"{out} can't be written: {error.strerror}") from error
    _say(out, arm, sheet, shapes, len(pairs))


def _comments(urdf: Path, drives: Path, shapes: Shapes) -> list[str]:
    return [
        f"Written from {urdf.name} and {drives.name}. Frames: parallel to the base at q = 0, the "
        "last at the",
        "flange with x out. Capsules, and how far they stand out from what they enclose:",
        *(f"  {sentence}" for sentence in shapes.sentences),
    ]


def _say(out: Path, arm: UrdfArm, sheet: DriveSheet, shapes: Shapes, pairs: int) -> None:
    guessed = sorted(key for key, value in sheet.values.items() if value.confidence == "L")
    sys.stdout.write("\n".join(shapes.sentences) + "\n")
    sys.stdout.write(f"{pairs} pairs of capsules can touch\n")
    if guessed:
        sys.stdout.write(f"estimated: {', '.join(guessed)}\n")
    sys.stdout.write(
        f"{out}: robot {sheet.name} of {len(arm.joints)} axes; next: ir robot check {out}\n"
    )


def _text(path: Path) -> str:
    return text_of(read_regular_file(path, BYTES_MAX), str(path), RobotFileError)
