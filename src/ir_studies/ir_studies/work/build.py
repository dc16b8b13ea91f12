"""What the bits of a result depend on beside its job: versions, sources, and how a processor adds
up.

Equal versions are not enough: NumPy and OpenBLAS choose their loops by the processor, and a sum in
another order has other last bits. So a few numbers are computed, and what came out is compared bit
by bit.
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
from ir_kernels import Chain, DynamicsModel, compiled

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
    if kind == _WITH_OMPL:
        versions += f", ompl {_version('ompl')}"
    return (
        f"{versions}, kernels {compiled.NAME}, {platform.machine()}, sources {sources()}, "
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
    """Digest of numbers that another processor, BLAS or compiler may compute otherwise in the last
    bit.
    """
    x = np.linspace(-3.0, 3.0, _N * _N)
    A = np.sin(np.add.outer(np.arange(_N), np.arange(_N) ** 2.0))
    regular = A + _N * np.eye(_N)
    robot = load_robot()
    q = np.stack([np.sin(np.arange(_N) + joint) for joint in range(len(robot.joint_names))], axis=1)
    computed = [
        np.sin(x), np.cos(x), np.exp(x), np.log1p(np.abs(x)), np.tanh(x), np.arctan2(x, x[::-1]),
        np.abs(x) ** 1.7, np.cumsum(x), np.array(x.sum()), np.array(x @ x), A @ A, A @ x[:_N],
        np.linalg.norm(A, axis=1),
        np.linalg.solve(regular, x[:_N]), np.linalg.svd(A, compute_uv=False), scipy.linalg.eigvalsh(A + A.T),  # noqa: E501
        Chain(robot).tcp_poses(q), DynamicsModel(robot).inverse_dynamics(q, 2.0 * q, q[::-1].copy()),  # noqa: E501
    ]  # fmt: skip
    return sha256(b"".join(each.tobytes() for each in computed)).hexdigest()[:_CHARACTERS]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
