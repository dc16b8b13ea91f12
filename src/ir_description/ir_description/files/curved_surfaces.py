"""STEP and IGES files: their curved surfaces as triangles, by OpenCASCADE (package cascadio).

Such a file says its own unit. Its triangles lie inside of what bulges outwards, so their distance
from the surfaces is stated and every body that is made of them is wider by it.
"""

from __future__ import annotations

import io
import json
import re
import resource
import subprocess
import sys
from importlib.util import find_spec
from typing import Any

import numpy as np

from ir_description.files.stl_mesh import TRIANGLES_MAX
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, one_line

KINDS = {".step": "step", ".stp": "step", ".iges": "iges", ".igs": "iges"}
"""What OpenCASCADE calls the files of each ending."""

NOT_PROVED = (
    "its curved surfaces are taken as triangles that OpenCASCADE lays within what the pieces are "
    "widened by, which is not proved: for a proof export STL"
)
"""What certificates rest on where such a file is part of a cell."""
ERRORS = (0.002, 0.008, 0.032)
"""m of the triangles from the surfaces, which OpenCASCADE is believed; the first with which there
are not too many is taken.
"""
MISSING = (
    "curved surfaces are read by cascadio and trimesh, which are missing: pip install "
    '"ir_description[step]", or export it from CAD as .stl, .obj or .glb, with chords of about 1 mm'
)
PROGRAM = f"from {__name__} import main; main()"
SECONDS = 300
MEMORY_BYTES = 8_000_000_000
_SHARE = 0.25
"""Of the error that OpenCASCADE is asked for: of balls it reaches 2.1 times that, of free-form
surfaces that wave strongly more than 4 times.
"""
_ANGLE = 0.5  # rad between neighbouring triangles
_LOST = ("ERR", "without geometry data")
"""In messages of OpenCASCADE that something is left out."""
_COLOURS = re.compile("\x1b\\[[0-9;]*m")


def triangles_of_surfaces(
    content: bytes, suffix: str, most: int = TRIANGLES_MAX
) -> tuple[FloatArray, float]:
    """Triangles (T, 3, 3) [m] of a file with this ending, at most so many, and how far [m] its
    surfaces may be beside them. Raises InvalidValueError.
    """
    if find_spec("cascadio") is None or find_spec("trimesh") is None:
        raise InvalidValueError(MISSING)
    for error in ERRORS:
        triangles = _triangles(content, KINDS[suffix], error)
        if len(triangles) <= most:
            return triangles, error
    count = len(triangles)
    raise InvalidValueError(
        f"the surfaces need {count} triangles with an error of {1e3 * ERRORS[-1]:g} mm, "
        f"must be at most {most}: leave out what is small, or export its parts one by one"
    )


def _triangles(content: bytes, kind: str, error: float) -> FloatArray:
    """By a process of its own: native code that hostile files can crash."""
    head = json.dumps([kind, error]).encode() + b"\n"
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=head + content, capture_output=True
    )
    said = _COLOURS.sub("", process.stderr.decode(errors="replace")).split("\n")
    lost = [line.strip(" *") for line in said if any(word in line for word in _LOST)]
    if process.returncode != 0 or lost:
        why = one_line("; ".join(lost) or f"code {process.returncode}", 200)
        raise InvalidValueError(
            f"OpenCASCADE can't read all of its surfaces ({why}): was the file cut? Export it "
            "anew, or as .stl"
        )
    with np.load(io.BytesIO(process.stdout), allow_pickle=False) as found:
        triangles = np.asarray(found["triangles"], dtype=np.float64)
    if not len(triangles):
        raise InvalidValueError("the file has no surfaces: only lines, points or drawings")
    return triangles


def main() -> None:
    """Read kind, error [m] and a file from standard input, write triangles to standard output."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    import os

    import cascadio
    import trimesh

    kind, error = json.loads(sys.stdin.buffer.readline())
    out = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # OpenCASCADE talks to standard output
    tolerance = 1e3 * _SHARE * error  # in mm, whatever the unit of the file
    found = cascadio.load(
        sys.stdin.buffer.read(),
        kind,
        tol_linear=tolerance,
        tol_angular=_ANGLE,
        use_parallel=False,
    )
    if not found:
        sys.exit(1)
    scene: Any = trimesh.load_scene(io.BytesIO(found), file_type="glb", process=False)
    parts = [mesh.triangles for mesh in scene.dump() if isinstance(mesh, trimesh.Trimesh)]
    triangles = np.concatenate(parts) if parts else np.zeros((0, 3, 3))
    np.savez(out, triangles=triangles)
    out.close()
