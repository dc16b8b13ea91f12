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
from ir_values.extensions import extension_modules, installed_extensions

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
    extensions = "".join(f", {each}" for each in installed_extensions())
    return (
        f"{versions}, kernels {kernels}, {platform.machine()}, sources {sources()}, "
        f"arithmetic {arithmetic()}{extensions}"
    )


def sources() -> str:
    """Digest of the Python and YAML files of the project and of packages that extend it, wherever
    they are installed.
    """
    digest = sha256()
    for package in (*PACKAGES, *extension_modules()):
        for name, path in _files_of(package):
            digest.update(f"{package}/{name}\n".encode())
            digest.update(sha256(path.read_bytes()).digest())
    return digest.hexdigest()[:_CHARACTERS]


def _files_of(package: str) -> list[tuple[str, Path]]:
    """Files of a package, or the one of a module, by their names in it."""
    found = find_spec(package)
    if found is None or not found.origin:
        return []
    origin = Path(found.origin)
    if origin.name != "__init__.py":
        return [(origin.name, origin)]
    folder = origin.parent
    files = sorted(file for file in folder.rglob("*") if file.suffix in (".py", ".yaml"))
    return [(file.relative_to(folder).as_posix(), file) for file in files]


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "none"
