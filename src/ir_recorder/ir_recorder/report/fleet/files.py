"""Which files a fleet is made of: recordings of folders, whose robot each one is of, none of them
twice.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path

from ir_msgs_py.errors import MsgsError
from ir_msgs_py.file_roots import FileRoots

Said = Callable[[str], None]
_BLOCK = 1 << 16  # bytes of the end of a file: the summary of a recording, which no other one has


@dataclass(frozen=True)
class RecordedFile:
    """A recording and the robot that it is of; folder: what makes two robots of one name different
    ones.
    """

    path: Path
    robot: str
    folder: Path


def recordings_below(
    paths: Sequence[str | Path], roots: FileRoots, said: Said
) -> list[RecordedFile]:
    """The recordings of files and folders, folders with all below them; `said` hears what is left
    out and why. A folder below one that is named is a robot, else the file is.
    """
    found: dict[Path, RecordedFile] = {}
    for path in map(Path, paths):
        try:
            inside = roots.inside(path)
        except MsgsError as error:
            said(f"{path}: left out: {error}")
            continue
        inner = sorted(inside.rglob("*.mcap")) if inside.is_dir() else [inside]
        if not inner:
            said(f"{path}: holds no recordings (.mcap)")
        for file in inner:
            one = _recorded(file, inside if inside.is_dir() else None)
            if one.path in found:
                said(f"{file}: named twice, counted once")
            found.setdefault(one.path, one)
    return _distinguished(_without_copies(list(found.values()), said))


def _recorded(path: Path, top: Path | None) -> RecordedFile:
    """The robot is the first folder below the one that was named, else the file."""
    if top is None or path.parent == top:
        return RecordedFile(path.resolve(), path.stem, path)
    robot = path.relative_to(top).parts[0]
    return RecordedFile(path.resolve(), robot, top / robot)


def _without_copies(files: Sequence[RecordedFile], said: Said) -> list[RecordedFile]:
    """Without files that are copies of another one of the same robot; those of another robot are
    named.
    """
    kept: dict[tuple[int, str], RecordedFile] = {}
    found = []
    for file in files:
        content = _content(file.path)
        first = kept.setdefault(content, file) if content is not None else file
        if first is not file and first.folder == file.folder:
            said(f"{file.path}: left out: it is a copy of {first.path.name}")
            continue
        if first is not file:
            said(f"{file.path}: is a copy of {first.path}, which counts as another robot's")
        found.append(file)
    return found


def _content(path: Path) -> tuple[int, str] | None:
    """Size and end of a file; None where it can't be read, or holds nothing."""
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            file.seek(max(size - _BLOCK, 0))
            return (size, sha256(file.read(_BLOCK)).hexdigest()) if size else None
    except OSError:
        return None


def _distinguished(files: Sequence[RecordedFile]) -> list[RecordedFile]:
    """Robots of one name in several folders get the name of the folder above as well, or the whole
    path.
    """
    above = [f"{file.folder.parent.name}/{file.robot}" for file in files]
    names = [file.robot for file in files]
    for longer in (above, [str(file.folder) for file in files]):
        folders: dict[str, set[Path]] = {}
        for name, file in zip(names, files, strict=True):
            folders.setdefault(name, set()).add(file.folder)
        names = [
            more if len(folders[name]) > 1 else name
            for name, more in zip(names, longer, strict=True)
        ]
    return [replace(file, robot=name) for file, name in zip(files, names, strict=True)]
