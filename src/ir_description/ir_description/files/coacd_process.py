"""CoACD in a process of its own: it is native code that hostile meshes can crash, and it takes its
time.

The seed is fixed: the same mesh gives the same pieces.
"""

from __future__ import annotations

import io
import resource
import subprocess
import sys
from importlib.util import find_spec

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError

MISSING = (
    'a mesh is divided by coacd, which is missing: pip install "ir_description[cad]", or '
    "pip install coacd"
)
CONCAVITY = 0.03
"""Concavity at which a piece is not divided any more, as a share of the mesh's size."""
PROCESSOR_SECONDS = 600
MEMORY_BYTES = 6_000_000_000
PROGRAM = f"from {__name__} import main; main()"
_SEED = 0
CORNERS = 64
"""Of a piece, at most."""


def decomposed(triangles: FloatArray, most: int, share: int = 1) -> list[FloatArray]:
    """Corners (V, 3) of at most `most` convex pieces of a closed mesh (T, 3, 3), in one of `share`
    parts of PROCESSOR_SECONDS. Raises InvalidValueError.
    """
    if find_spec("coacd") is None:
        raise InvalidValueError(MISSING)
    corners, index = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    stream = io.BytesIO()
    faces = index.reshape(-1, 3).astype(np.int32)
    seconds = max(PROCESSOR_SECONDS // share, 1)
    np.savez(stream, corners=corners, faces=faces, most=most, seconds=seconds)
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        input=stream.getvalue(),
        capture_output=True,
    )
    if process.returncode != 0:
        last = process.stderr.decode(errors="replace").strip().splitlines()[-1:]
        raise InvalidValueError(
            f"the mesh can't be divided into convex pieces (code {process.returncode}: "
            f"{''.join(last)[:120]})"
        )
    with np.load(io.BytesIO(process.stdout), allow_pickle=False) as found:
        pieces = [np.asarray(found[key], dtype=np.float64) for key in found.files]
    if not pieces:
        raise InvalidValueError("the mesh can't be divided into convex pieces: there are none")
    return pieces


def main() -> None:
    """Read a mesh from standard input, and write its pieces to standard output."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    import coacd

    with np.load(io.BytesIO(sys.stdin.buffer.read()), allow_pickle=False) as given:
        mesh = coacd.Mesh(given["corners"], given["faces"])
        most = int(given["most"])
        seconds = int(given["seconds"])
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    coacd.set_log_level("error")
    found = coacd.run_coacd(
        mesh,
        threshold=CONCAVITY,
        max_convex_hull=most,
        preprocess_mode="off",
        max_ch_vertex=CORNERS,
        seed=_SEED,
    )
    stream = io.BytesIO()
    np.savez(stream, **{f"piece_{k:04d}": corners for k, (corners, _) in enumerate(found)})
    sys.stdout.buffer.write(stream.getvalue())
