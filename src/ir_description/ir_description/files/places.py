"""Files that a file names: beside it or below, never elsewhere."""

from __future__ import annotations

import os
from pathlib import Path

from ir_description.errors import shown
from ir_msgs_py.errors import InvalidValueError


def is_path(text: str) -> bool:
    """Whether a text is the path of a file, and not the name of something bundled."""
    return os.sep in text or text.endswith((".yaml", ".yml"))


def inside(folder: Path | None, name: str) -> Path:
    """The path of a YAML file that another file names, relative to that file's folder; nothing
    leads out.
    """
    if folder is None:
        raise InvalidValueError(
            f"file {shown(name)} can't be named in a text; write out what it says"
        )
    path = Path(name)
    if "://" in name or "\\" in name or path.is_absolute() or ".." in path.parts:
        raise InvalidValueError(
            f"file {shown(name)} must stand beside this file or below, named relative to it, "
            "without '..'"
        )
    resolved = (folder / path).resolve()
    if not resolved.is_relative_to(folder.resolve()):
        raise InvalidValueError(f"file {shown(name)} leads out of the folder of this file")
    return resolved
