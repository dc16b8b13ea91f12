"""Convex pieces of meshes, kept by their content: dividing a mesh takes seconds to minutes.

What is kept is checked again when it is taken: that the pieces contain the mesh is proved each
time.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np

from ir_description.files.coacd_process import CONCAVITY
from ir_description.files.convex_pieces import MARGINS, ConvexPieces, contains, convex_pieces
from ir_msgs_py.arrays import FloatArray

VERSION = "1"
FOLDER = "IR_CACHE"
"""Variable of the environment with the folder; the user's own cache where it is not set."""
_BYTES_MAX = 50_000_000


def pieces_of(triangles: FloatArray, most: int) -> ConvexPieces:
    """At most `most` convex pieces that contain a mesh (T, 3, 3) [m], divided now or before."""
    path = _folder() / f"{_key(triangles, most)}.npz"
    known = _read(path)
    if known is not None and contains(known.vertices, triangles):
        return known
    found = convex_pieces(triangles, most)
    with suppress(OSError):  # a cache that can't be written costs time only
        _write(path, found)
    return found


def _folder() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    return Path(os.environ.get(FOLDER) or Path(base) / "ir") / "pieces"


def _key(triangles: FloatArray, most: int) -> str:
    settings = f"{VERSION} {most} {CONCAVITY} {MARGINS}"
    return hashlib.sha256(settings.encode() + np.ascontiguousarray(triangles).tobytes()).hexdigest()


def _read(path: Path) -> ConvexPieces | None:
    """What was kept, None where nothing was, or something else stands there."""
    try:
        if path.stat().st_size > _BYTES_MAX:
            return None
        with np.load(path, allow_pickle=False) as kept:
            numbers = kept["numbers"]
            names = sorted(name for name in kept.files if name != "numbers")
            vertices = tuple(np.asarray(kept[name], dtype=np.float64) for name in names)
        margin, protrusion, volume, of_pieces = (float(each) for each in numbers)
    except Exception:  # whatever a broken file makes NumPy raise: it is made anew
        return None
    if not all(
        each.ndim == 2 and each.shape[1] == 3 and np.isfinite(each).all() for each in vertices
    ):
        return None
    return ConvexPieces(vertices, margin, protrusion, volume, of_pieces)


def _write(path: Path, pieces: ConvexPieces) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    numbers = np.array([pieces.margin, pieces.protrusion, pieces.volume, pieces.of_pieces])
    arrays = {f"piece_{k:04d}": each for k, each in enumerate(pieces.vertices)}
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".npz", delete=False) as file:
        np.savez(file, numbers=numbers, **arrays)  # type: ignore[arg-type]  # a name is no keyword of savez
    os.replace(file.name, path)
