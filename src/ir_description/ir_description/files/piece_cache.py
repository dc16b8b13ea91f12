"""The convex pieces that contain a mesh, divided once: kept by the content of the mesh.

Dividing one takes seconds to minutes. Pieces that were kept are checked again when they are taken:
that they contain the mesh is proved each time.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ir_values.arrays import FloatArray

if TYPE_CHECKING:  # only cells with solids pay for the division of meshes
    from ir_description.files.convex_pieces import ConvexPieces

VERSION = "2"
FOLDER_VARIABLE = "IR_CACHE"
"""Of the environment: the cache's folder; the user's own cache where it is not set."""
_BYTES_MAX = 50_000_000
_MEASURES = ("margin", "protrusion", "volume", "of_pieces", "simplified")  # in the file's order


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
    return Path(os.environ.get(FOLDER_VARIABLE) or Path(base) / "ir") / "pieces"


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
        measures = {name: float(each) for name, each in zip(_MEASURES, numbers, strict=True)}
    except Exception:  # whatever a broken file makes NumPy raise: it is made anew
        return None
    if not all(
        each.ndim == 2 and each.shape[1] == 3 and np.isfinite(each).all() for each in vertices
    ):
        return None
    return ConvexPieces(
        vertices,
        margin=measures["margin"],
        protrusion=measures["protrusion"],
        volume=measures["volume"],
        of_pieces=measures["of_pieces"],
        simplified=int(measures["simplified"]),
    )


def _write(path: Path, pieces: ConvexPieces) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    numbers = np.array([float(getattr(pieces, name)) for name in _MEASURES])
    arrays = {f"piece_{k:04d}": each for k, each in enumerate(pieces.vertices)}
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".npz", delete=False) as file:
        np.savez(file, numbers=numbers, **arrays)  # type: ignore[arg-type]  # a name is no keyword of savez
    os.replace(file.name, path)
