"""The fingerprint of what the bits of a result depend on beside its job: versions, sources, and
arithmetic.

Every x86-64 processor has the same arithmetic (law 26); another architecture, compiler or the NumPy
reference may have another. So a few numbers are computed with the functions that decide answers,
and the result is compared bit by bit.
"""

from __future__ import annotations

import platform
from functools import cache
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import scipy

from ir_description import load_robot
from ir_kernels import Chain, DynamicsModel, compiled, portable

PACKAGES = (
    "ir_description", "ir_kernels", "ir_krl", "ir_msgs_py", "ir_planner", "ir_recorder", "ir_sim_driver", "ir_values",  # noqa: E501
    "ir_studies",
)  # fmt: skip
_WITH_OMPL = "arena"  # the kind of study that asks OMPL's planners
_CHARACTERS = 12  # of a digest: for people to compare
_N = 37  # no multiple of what a processor adds at once


@cache
def computed_with(kind: str) -> str:
    """Versions, sources and arithmetic of this process, as far as a kind of study depends on
    them.
    """
    versions = (
        f"python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    )
    kernels = "reference" if compiled.NAME == "reference" else "compiled"
    if kind == _WITH_OMPL:
        versions += f", ompl {_version('ompl')}"
    return (
        f"{versions}, kernels {kernels}, {platform.machine()}, sources {sources()}, "
        f"arithmetic {arithmetic()}"
    )


def sources() -> str:
    """Digest of the project's Python and YAML files, wherever they are installed."""
    digest = sha256()
    for package in PACKAGES:
        found = find_spec(package)
        folder = Path(found.origin).parent if found is not None and found.origin else Path()
        for path in sorted(file for file in folder.rglob("*") if file.suffix in (".py", ".yaml")):
            digest.update(f"{package}/{path.relative_to(folder).as_posix()}\n".encode())
            digest.update(sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:_CHARACTERS]


def arithmetic() -> str:
    """Digest of numbers that another architecture or compiler may compute otherwise in the last
    bit.
    """
    x = np.linspace(-3.0, 3.0, _N * _N)
    A = portable.sin(np.add.outer(np.arange(_N), np.square(np.arange(_N, dtype=float))))
    regular = A + _N * np.eye(_N)
    robot = load_robot()
    joints = np.arange(len(robot.joint_names))
    q = np.ascontiguousarray(portable.sin(np.add.outer(np.arange(_N), joints)))
    poses = Chain(robot).tcp_poses(q)
    torques = DynamicsModel(robot).inverse_dynamics(q, 2.0 * q, q[::-1].copy())
    computed = [
        *(portable.sin(x), portable.cos(x), portable.exp(x), portable.log(np.abs(x))),
        *(portable.arctan2(x, x[::-1]), portable.power(np.abs(x), 1.7)),
        *(
            np.cumsum(x),
            np.array(x.sum()),
            np.linalg.norm(A, axis=1),
            np.einsum("ij,j->i", A, A[0]),
        ),
        *(portable.matmul(A, A), portable.solve(regular, x[:_N]), portable.singular_values(A)),
        *(poses, torques),
    ]
    return sha256(b"".join(each.tobytes() for each in computed)).hexdigest()[:_CHARACTERS]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
