"""Closed meshes of machines from CAD, as the convex pieces that contain them.

glTF's y axis points up, a cell's z: such meshes are turned. Nothing outside the cell file's folder
is ever opened, whatever a file refers to. Pieces are kept by the content of their mesh, because
dividing one takes seconds to minutes.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ir_description.files.collada import triangles_from_collada
from ir_description.files.curved_surfaces import KINDS as SURFACES
from ir_description.files.curved_surfaces import triangles_of_surfaces
from ir_description.files.stl_mesh import (
    BYTES_MAX,
    CELL_TRIANGLES_MAX,
    READ_MAX,
    TRIANGLES_MAX,
    check_triangles,
    mesh_path,
    triangles_from_stl,
)
from ir_kernels import portable
from ir_values.arrays import FloatArray, number_of
from ir_values.errors import InvalidValueError, listed, shown
from ir_values.files import read_regular_file
from ir_values.yaml_items import Table

if TYPE_CHECKING:  # only cells with solids pay for the division of meshes
    from ir_description.files.convex_pieces import ConvexPieces

SUFFIXES = (".stl", ".obj", ".glb", ".gltf", *SURFACES)
UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 0.001, "inch": 0.0254}
"""Metres of each unit; no file says its own reliably, so whoever names one does."""
MISSING = 'needs trimesh and coacd: pip install "ir_description[cad]", or pip install trimesh coacd'
_Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
_OBJ_VERTEX = b"v"
_OBJ_FACE = b"f"
_BUFFERS_MAX = 16


@dataclass(frozen=True, eq=False)
class SolidMesh:
    """Triangles (T, 3, 3) in the file's unit, z up; content: all bytes that they were read from.
    error [m]: how far the surfaces may be beside the triangles.
    """

    triangles: FloatArray
    content: bytes
    error: float = 0.0


def read_solid(folder: Path, name: str, suffixes: tuple[str, ...] = SUFFIXES) -> SolidMesh:
    """The mesh of a file beside the cell file; in metres where the file says its unit (Collada,
    STEP, IGES). Raises InvalidValueError.
    """
    path = mesh_path(folder, name, suffixes)
    content = read_regular_file(path, BYTES_MAX)
    suffix = path.suffix.lower()
    error = 0.0
    if suffix == ".stl":
        triangles = triangles_from_stl(content, READ_MAX)
    elif suffix in SURFACES:
        triangles, error = triangles_of_surfaces(content, suffix)
    elif suffix == ".dae":
        triangles = triangles_from_collada(content)
    elif suffix == ".obj":
        triangles = triangles_from_obj(content, READ_MAX)
    else:
        buffers = _buffers(path, content) if suffix == ".gltf" else {}
        triangles = _triangles_from_gltf(content, buffers, suffix)
        content += b"".join(buffers[key] for key in sorted(buffers))
    return SolidMesh(_checked(triangles), content, error)


def triangles_from_obj(content: bytes, most: int = TRIANGLES_MAX) -> FloatArray:
    """Triangles (T, 3, 3) of an OBJ, at most so many: faces with more corners become fans; all else
    is left out.
    """
    vertices: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    for number, line in enumerate(content.split(b"\n"), start=1):
        words = line.split()
        try:
            if words[:1] == [_OBJ_VERTEX]:
                vertices.append([number_of(word.decode("latin-1")) for word in words[1:4]])
                if len(vertices[-1]) < 3:
                    raise ValueError("a vertex has three numbers")
            elif words[:1] == [_OBJ_FACE]:
                corners = [_index(word, len(vertices)) for word in words[1:]]
                triangles += [
                    (corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)
                ]
        except ValueError as error:
            raise InvalidValueError(f"line {number} of the OBJ is wrong: {error}") from error
        if len(triangles) > most:
            check_triangles(len(triangles), most)
    if not triangles:
        raise InvalidValueError("the OBJ has no faces: only corners, lines or nothing")
    found: FloatArray = np.array(vertices)[np.array(triangles)]
    return found


def _index(word: bytes, count: int) -> int:
    """The number of a corner from 0: of 7, 7/1, 7//3 or, from the end, -1."""
    index = int(word.partition(b"/")[0])
    index = index - 1 if index > 0 else count + index
    if not 0 <= index < count:
        raise ValueError(f"corner {word[:20].decode(errors='replace')} of {count} is not there")
    return index


def _buffers(path: Path, content: bytes) -> dict[str, bytes]:
    """What a .gltf keeps in other files, each in its own folder or below; data in the text is left
    there.
    """
    try:
        listed = json.loads(content).get("buffers", [])
        names = [str(each.get("uri", "")) for each in listed]
    except (ValueError, AttributeError, TypeError, RecursionError) as error:
        raise InvalidValueError("the glTF is not JSON with a list of buffers") from error
    names = [name for name in names if not name.startswith("data:")]
    if len(names) > _BUFFERS_MAX:
        raise InvalidValueError(
            f"the glTF has {len(names)} buffers, must have at most {_BUFFERS_MAX}"
        )
    return {
        name: read_regular_file(mesh_path(path.parent, name, (".bin",)), BYTES_MAX)
        for name in names
    }


def _triangles_from_gltf(content: bytes, buffers: dict[str, bytes], suffix: str) -> FloatArray:
    if find_spec("trimesh") is None:
        raise InvalidValueError(f"a {suffix} file {MISSING}")
    import trimesh

    try:
        scene: Any = trimesh.load_scene(
            io.BytesIO(content), file_type=suffix[1:], resolver=_Resolver(buffers), process=False
        )
        meshes = [each for each in scene.dump() if isinstance(each, trimesh.Trimesh)]
        triangles = [
            np.asarray(mesh.triangles, dtype=np.float64).reshape(-1, 3, 3) for mesh in meshes
        ]
    except Exception as error:  # of trimesh, of any kind
        raise InvalidValueError(f"the glTF can't be read: {shown(str(error), 120)}") from error
    if not triangles:
        raise InvalidValueError("the glTF has no triangles")
    turned: FloatArray = portable.matmul(np.concatenate(triangles), _Y_UP.T)
    return turned


class _Resolver:
    """Gives trimesh the buffers that were read, and nothing else: no image, no file elsewhere."""

    def __init__(self, buffers: dict[str, bytes]) -> None:
        self._buffers = buffers

    def __getitem__(self, name: str) -> bytes:
        if name not in self._buffers:
            raise ValueError(f"{name[:60]!a} is not one of its buffers")
        return self._buffers[name]

    get = __getitem__


def _checked(triangles: FloatArray) -> FloatArray:
    check_triangles(len(triangles), READ_MAX)
    if not np.isfinite(triangles).all():
        raise InvalidValueError("the mesh has corners that are not finite")
    return triangles + 0.0  # no zeros that differ by their sign


# Pieces that were kept are checked again when they are taken: that they contain the mesh is proved
# each time.

VERSION = "2"
FOLDER = "IR_CACHE"
"""Variable of the environment with the folder; the user's own cache where it is not set."""
_BYTES_MAX = 50_000_000


def pieces_of(triangles: FloatArray, most: int, error: float = 0.0) -> ConvexPieces:
    """At most `most` convex pieces that contain all within `error` [m] of a mesh (T, 3, 3) [m],
    divided now or before.
    """
    from ir_description.files.convex_pieces import contains, convex_pieces

    path = _folder() / f"{_key(triangles, most, error)}.npz"
    known = _read(path)
    if known is not None and contains(known.vertices, triangles):
        return known
    found = convex_pieces(triangles, most, error)
    with suppress(OSError):  # a cache that can't be written costs time only
        _write(path, found)
    return found


def _folder() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(os.environ.get(FOLDER) or Path(base) / "ir") / "pieces"


def _key(triangles: FloatArray, most: int, error: float) -> str:
    from ir_description.files.convex_pieces import CONCAVITY, MARGINS

    settings = f"{VERSION} {most} {error} {CONCAVITY} {MARGINS}"
    return hashlib.sha256(settings.encode() + np.ascontiguousarray(triangles).tobytes()).hexdigest()


def _read(path: Path) -> ConvexPieces | None:
    """The pieces kept in a file, None where nothing was, or something else stands there."""
    from ir_description.files.convex_pieces import ConvexPieces

    try:
        if path.stat().st_size > _BYTES_MAX:
            return None
        with np.load(path, allow_pickle=False) as kept:
            numbers = kept["numbers"]
            names = sorted(name for name in kept.files if name != "numbers")
            vertices = tuple(np.asarray(kept[name], dtype=np.float64) for name in names)
        margin, protrusion, volume, of_pieces, simplified = (float(each) for each in numbers)
    except Exception:  # whatever a broken file makes NumPy raise: it is made anew
        return None
    if not all(
        each.ndim == 2 and each.shape[1] == 3 and np.isfinite(each).all() for each in vertices
    ):
        return None
    return ConvexPieces(vertices, margin, protrusion, volume, of_pieces, int(simplified))


def _write(path: Path, pieces: ConvexPieces) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    measures = (pieces.margin, pieces.protrusion, pieces.volume, pieces.of_pieces)
    numbers = np.array([*measures, float(pieces.simplified)])
    arrays = {f"piece_{k:04d}": each for k, each in enumerate(pieces.vertices)}
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".npz", delete=False) as file:
        np.savez(file, numbers=numbers, **arrays)  # type: ignore[arg-type]  # a name is no keyword of savez
    os.replace(file.name, path)


# The entry `mesh: press.stl` of a cell file.

PIECES = 32
"""Pieces of a mesh, unless its entry says otherwise."""
PIECES_MAX = 200
SIZE_MAX = 100.0
"""Farthest corner [m] of a mesh from its origin: beyond, the unit is hardly meant."""


class SolidReader:
    """Reads the meshes of one cell; those that it names twice once."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._triangles = 0
        self._known: dict[tuple[str, str, int], tuple[FloatArray, ...]] = {}

    def read(self, table: Table) -> tuple[FloatArray, ...]:
        """Return the corners (V, 3) [m] of each piece of the mesh that an entry describes."""
        name = table["mesh"].text()
        unit = table["unit"].choice(tuple(UNITS)) if "unit" in table else ""
        most = table["pieces"].integer(1, PIECES_MAX) if "pieces" in table else PIECES
        with table["mesh"].blamed():
            if (name, unit, most) not in self._known:
                self._known[name, unit, most] = self.pieces(name, unit, most).vertices
            return self._known[name, unit, most]

    def pieces(self, name: str, unit: str, most: int) -> ConvexPieces:
        """Return the pieces of a mesh file; unit: "" of a file that says its own. Raises
        InvalidValueError.
        """
        if self._folder is None:
            raise InvalidValueError("a mesh file can be named only in a cell file, this is a text")
        says_its_own = Path(name).suffix.lower() in SURFACES
        if says_its_own and unit:
            raise InvalidValueError(f"{shown(name)} says its unit itself: leave unit out")
        if not says_its_own and not unit:
            raise InvalidValueError(f"{shown(name)} has no unit: say one of {listed(UNITS)}")
        solid = read_solid(self._folder, name)
        triangles = solid.triangles * UNITS[unit or "m"]
        self._triangles += min(len(triangles), TRIANGLES_MAX)
        if self._triangles > CELL_TRIANGLES_MAX:
            raise InvalidValueError(
                f"the cell's mesh files have {self._triangles} triangles so far, "
                f"must have at most {CELL_TRIANGLES_MAX} together"
            )
        reach = float(np.abs(triangles).max())
        if reach > SIZE_MAX:
            raise InvalidValueError(
                f"the mesh reaches {reach:g} m in {unit or 'm'}, must stay within {SIZE_MAX:g} m: "
                "is its unit another?"
            )
        return pieces_of(triangles, most, solid.error)


def piece_names(name: str, count: int) -> tuple[str, ...]:
    """Names of the bodies that stand for a mesh: its own where it is one, else name.1, name.2 and
    so on.
    """
    return (name,) if count == 1 else tuple(f"{name}.{k}" for k in range(1, count + 1))
