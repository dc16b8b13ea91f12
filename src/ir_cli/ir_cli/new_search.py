"""`ir new search`: a package of one's own with a search that works, to begin with."""

from __future__ import annotations

import argparse
import keyword
import sys
from pathlib import Path

from ir_cli.errors import InputError
from ir_planner.search import SEARCHES
from ir_planner.search.registry import NAMES_OF_SETTINGS
from ir_values.output_files import write_file

_NAME_MAX = 40

PROJECT = """\
[build-system]
requires = ["setuptools>=68"]
build-backend = "setuptools.build_meta"

[project]
name = "ir-search-{dashed}"
version = "0.1.0"
description = "A search for free paths, for ir_planner."
requires-python = ">=3.11"
dependencies = ["ir_planner", "numpy"]

[project.entry-points."ir_planner.searches"]
{name} = "ir_search_{name}:{type}"

[tool.setuptools]
py-modules = ["ir_search_{name}"]
"""

MODULE = '''\
"""A search for free paths over one random via configuration."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ir_planner.checks import FreeSpace
from ir_planner.scene import path_cost
from ir_planner.search import Ends, Found
from ir_values.settings import check_settings, setting


@dataclass(frozen=True)
class {type}:
    """Paths over one via configuration, drawn within the limits of the joints."""

    keeps_upright: ClassVar[bool] = True  # as `_free` does; without it tilt_max is refused
    vias: int = setting(200, "Via configurations drawn at once.", minimum=1, maximum=10_000)

    def __post_init__(self) -> None:
        check_settings(self)

    def find(self, ends: Ends, space: FreeSpace, seed: int) -> Found:
        """The straight movements, and paths over vias until some are free or the work is spent."""
        rng = np.random.default_rng(seed)
        candidates = [np.stack([ends.start, goal]) for goal in ends.goals]
        free = self._free(candidates, space)
        while not free and not space.work.exhausted:
            vias = rng.uniform(space.low, space.high, (self.vias, len(ends.start)))
            goals = ends.goals[rng.integers(len(ends.goals), size=self.vias)]
            pairs = zip(vias, goals, strict=True)
            free = self._free([np.stack([ends.start, via, goal]) for via, goal in pairs], space)
        free.sort(key=lambda path: path_cost(space.scene.weights, path))
        return Found(free, "" if free else f"no via of {{self.vias}} at once leads there")

    def _free(self, paths: list[np.ndarray], space: FreeSpace) -> list[np.ndarray]:
        """Those whose every step is certified, which is charged to the work. With a tilt_max they
        get points on which the tool is upright.
        """
        paths = space.kept_upright(paths)
        proved = space.paths_free(paths)
        return [path for path, is_free in zip(paths, proved, strict=True) if is_free]
'''

README = """\
# ir-search-{dashed}

A search for free paths, asked for by its name only:

    pip install -e .
    ir ask move demo home park --planner {name}
    pytest --pyargs ir_planner.contract -k {name}

`planners: [portfolio, {name}]` in the settings of `ir study arena` compares it with the others.
"""


def add_new_search(new: argparse.ArgumentParser) -> None:
    """Arguments of `ir new search`."""
    new.add_argument("name", metavar="NAME", help="letters, digits and underscores: over_the_top")
    words = "folder to write (NAME)"
    new.add_argument("-o", "--output", type=Path, metavar="FOLDER", help=words)
    new.set_defaults(run=run_new_search)


def run_new_search(arguments: argparse.Namespace) -> int:
    """Write the package; no file is overwritten."""
    name = _free_name(arguments.name)
    words = {
        "name": name,
        "dashed": name.replace("_", "-"),
        "type": "".join(part.capitalize() for part in name.split("_")),
    }
    # not the module's name: beside the folder, Python would import it instead of what is installed
    folder = arguments.output or Path(name)
    folder.mkdir(parents=True, exist_ok=True)
    files = {"pyproject.toml": PROJECT, f"ir_search_{name}.py": MODULE, "README.md": README}
    for file, text in files.items():
        write_file(folder / file, text.format(**words), new=True)
    sys.stdout.write(
        f"{folder}: pip install -e {folder.resolve()}, then --planner {name}; see README.md\n"
    )
    return 0


def _free_name(name: str) -> str:
    """The name. InputError where it can't be one, or is taken."""
    plain = name.isascii() and name.isidentifier() and name == name.lower() and name[0] != "_"
    if not plain or keyword.iskeyword(name) or len(name) > _NAME_MAX:
        raise InputError(
            f"{name[:60]!a} must be at most {_NAME_MAX} small letters, digits and underscores, "
            "a letter first"
        )
    if name in SEARCHES or name in NAMES_OF_SETTINGS:
        raise InputError(f"{name!r} is taken: the planner has a search or settings of this name")
    return name
