"""xacro files expanded to URDF by the package of that name, in a process of its own: their
expressions are Python.
"""

from __future__ import annotations

import json
import re
import resource
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

from ir_description.files.making.link_bodies import Meshes
from ir_values.errors import InvalidValueError, listed, one_line

PROGRAM = f"from {__name__} import main; main()"
SECONDS = 60
MEMORY_BYTES = 2_000_000_000
_FINDS_FROM = "ament_index_python.packages"
_UNSET = re.compile(r"Undefined substitution argument (\w+)")


def expanded(path: Path, packages: Path | None, settings: Mapping[str, str]) -> str:
    """The URDF that a xacro file describes, its arguments by `settings`, else by their defaults;
    packages: a folder below which $(find NAME) looks beside those above the file. Raises
    InvalidValueError, also for a setting that the file never asks for.
    """
    if find_spec("xacro") is None:
        raise InvalidValueError(
            f"{path}: a xacro file is expanded by the package xacro, which is missing: pip install "
            "xacro, or expand it elsewhere (xacro FILE > robot.urdf)"
        )
    folder = str(packages.resolve()) if packages else ""
    given = json.dumps([str(path.resolve()), folder, dict(settings)])
    found = subprocess.run(
        [sys.executable, "-c", PROGRAM], input=given.encode(), capture_output=True
    )
    if found.returncode != 0:
        text = found.stderr.decode(errors="replace").strip()
        said = one_line(text.partition("Traceback")[0] or text.splitlines()[-1] if text else "")
        said = said[:300] or f"code {found.returncode}"
        unset = _UNSET.search(said)
        if unset:
            said = f"its argument {unset[1]} has no default: give --set {unset[1]}:=VALUE"
        raise InvalidValueError(f"{path}: xacro can't expand it: {said}")
    return found.stdout.decode()


class _Arguments(dict[str, str]):
    """Arguments by name, and which of them were asked for."""

    def __init__(self, settings: Mapping[str, str]) -> None:
        super().__init__(settings)
        self.asked = set[str]()

    def __contains__(self, name: object) -> bool:
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked.add(name)
        return super().__getitem__(name)


def main() -> None:
    """Read the names of a file and a folder from standard input, and write the URDF."""
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    file, packages, settings = json.loads(sys.stdin.buffer.read())
    homes = Meshes(Path(file).parent, Path(packages) if packages else None)

    def share(name: str) -> str:
        home = homes.package(name)
        if home is None:
            sys.exit(
                f"package {name} is not found; --packages FOLDER names a folder below which it lies"
            )
        return str(home)

    # xacro asks ROS's index of packages, which isn't installed everywhere
    index = ModuleType(_FINDS_FROM)
    index.get_package_share_directory = share  # type: ignore[attr-defined]
    top = ModuleType(_FINDS_FROM.partition(".")[0])
    top.packages = index  # type: ignore[attr-defined]
    sys.modules[top.__name__] = top
    sys.modules[_FINDS_FROM] = index
    import xacro

    arguments = _Arguments(settings)
    try:
        document = xacro.process_file(file, mappings=arguments)
    except Exception as error:  # of xacro and of the file's own expressions, of any kind
        sys.exit(f"{type(error).__name__}: {error}")
    if unknown := settings.keys() - arguments.asked:
        known = listed(sorted(arguments.keys() - unknown))
        sys.exit(f"--set {min(unknown)[:40]}: it has no such argument, it has {known}")
    sys.stdout.write(document.toprettyxml(indent=" "))
