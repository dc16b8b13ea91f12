"""Mesh files of machines and robots, of any format, as triangles.

glTF's y axis points up, a cell's z: such meshes are turned. Nothing outside the cell file's folder
is ever opened, whatever a file refers to.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from ir_description.files.collada import triangles_from_collada
from ir_description.files.curved_surfaces import KINDS as SURFACES
from ir_description.files.curved_surfaces import triangles_of_surfaces
from ir_description.files.stl_mesh import (
    BYTES_MAX,
    READ_MAX,
    TRIANGLES_MAX,
    check_triangles,
    mesh_path,
    triangles_from_stl,
)
from ir_kernels import portable
from ir_values.arrays import FloatArray, number_of
from ir_values.errors import InvalidValueError, shown
from ir_values.files import read_regular_file

SUFFIXES = (".stl", ".obj", ".glb", ".gltf", *SURFACES)
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
    return SolidMesh(_checked_triangles(triangles), content, error)


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
        buffers = json.loads(content).get("buffers", [])
        names = [str(each.get("uri", "")) for each in buffers]
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


def _checked_triangles(triangles: FloatArray) -> FloatArray:
    check_triangles(len(triangles), READ_MAX)
    if not np.isfinite(triangles).all():
        raise InvalidValueError("the mesh has corners that are not finite")
    return triangles + 0.0  # no zeros that differ by their sign
