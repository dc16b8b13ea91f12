"""The fingerprint of what the bits of a result depend on beside its job: versions, sources, and
arithmetic.
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

from ir_kernels import compiled
from ir_recorder.recording.arithmetic import arithmetic

PACKAGES = (
    "ir_description", "ir_kernels", "ir_krl", "ir_msgs_py", "ir_planner", "ir_recorder", "ir_sim_driver", "ir_values",  # noqa: E501
    "ir_studies",
)  # fmt: skip
_WITH_OMPL = "arena"  # the kind of study that asks OMPL's planners
_CHARACTERS = 12  # of a digest: for people to compare


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


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
