"""Modules of a project: the files of a folder or of an archive, as a controller or WorkVisual keeps
them, read as one program.
"""

from __future__ import annotations

import re
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from ir_krl.errors import KrlError, SourcePlace
from ir_krl.language import Routine, SourceFile, SyntaxTree, parse
from ir_krl.run.built_in import CONTROLLERS
from ir_krl.run.notes import Effect, Note
from ir_values.files import ANYWHERE

BYTES_MAX = 4_000_000  # of a file
FILES_MAX = 20_000
ARCHIVES = (".zip", ".wvs")
_DATABASE_AT = 16
_DATABASE = bytes.fromhex("9d7b3500")
"""What stands there in a file of SQL Server Compact 3.5, in which WorkVisual keeps projects."""
_KINDS = (".src", ".dat", ".sub")
_ROBOT = re.compile(r"R\d{1,2}", re.IGNORECASE)
_MOTIONS = ("ptp", "lin", "circ", "spline_block")
_NAMED = 8  # programs that a sentence names
CONFIGURATION = "$CONFIG"
_UTF16 = (b"\xff\xfe", b"\xfe\xff")


@dataclass(frozen=True)
class File:
    """One file: its path in the project, and its bytes."""

    path: PurePosixPath
    content: bytes

    @property
    def module(self) -> str:
        """The module that it belongs to: a .src and its .dat have one."""
        return self.path.stem.upper()

    @property
    def text(self) -> str:
        """What it says. Raises KrlError for a file of another encoding or size."""
        return text_of(self.content, str(self.path))


def text_of(content: bytes, name: str) -> str:
    """The text of a file, which `name` names. Raises KrlError."""
    if len(content) > BYTES_MAX:
        raise KrlError(
            f"{len(content)} bytes: at most {BYTES_MAX} are read, split it", SourcePlace(name)
        )
    if content.startswith(_UTF16):
        raise KrlError(
            "the file is UTF-16 text, must be UTF-8: save it with that encoding",
            SourcePlace(name, 1, 1),
        )
    return content.decode("utf-8", errors="replace")


@dataclass
class Project:
    """Files of a robot's programs; those that can't be read are known as such when they are
    needed.
    """

    name: str
    files: tuple[File, ...]
    _read: dict[PurePosixPath, SourceFile | KrlError] = field(default_factory=dict)

    def source(self, file: File) -> SourceFile | KrlError:
        """A file as it is read, or why it isn't."""
        if file.path not in self._read:
            try:
                self._read[file.path] = parse(file.text, str(file.path))
            except KrlError as error:
                self._read[file.path] = error
        return self._read[file.path]

    def programs(self) -> list[File]:
        """Files whose first routine takes no arguments and, itself or by routines of its file,
        moves the robot; those that can't be read but name motions too.
        """
        return [one for one in self.files if self._is_program(one)]

    def _is_program(self, file: File) -> bool:
        if file.path.suffix.lower() != ".src" or file.module in CONTROLLERS:
            return False
        source = self.source(file)
        if isinstance(source, KrlError):
            return _names_motions(file)
        moving = any(_moves(one.body) for one in source.routines)
        return moving and not source.routines[0].parameters

    def main(self, routine: str = "") -> File:
        """The file that begins with `routine`, or where "" the one program that no other calls.
        Raises KrlError, with the programs that there are.
        """
        programs = self.programs()
        if routine:
            wanted = [one for one in self.files if routine.upper() in self._names(one)]
            found = [one for one in wanted if self._names(one)[0] == routine.upper()] or wanted
        else:
            called = {name for one in self.files for name in self._calls(one)}
            found = [one for one in programs if one.module not in called] or programs
        if len(found) == 1:
            return found[0]
        named = ", ".join(str(one.path) for one in (found or programs)[:_NAMED])
        if not found:
            unread = [one for one in map(self.source, self.files) if isinstance(one, KrlError)]
            listed = "; ".join(map(str, unread[:_NAMED])) or named or "there is no other"
            raise KrlError(
                f"{self.name}: no file has a routine {routine or 'that moves'}: {listed}"
            )
        if routine:
            raise KrlError(f"{self.name}: {routine} is in {len(found)} files, give one: {named}")
        raise KrlError(f"{self.name} has {len(found)} programs: give --routine or one of {named}")

    def _names(self, file: File) -> list[str]:
        source = self.source(file) if file.path.suffix.lower() != ".dat" else None
        return [one.name for one in source.routines] if isinstance(source, SourceFile) else []

    def _calls(self, file: File) -> Iterator[str]:
        source = self.source(file)
        if isinstance(source, SourceFile):
            for routine in source.routines:
                yield from (name for name in _called(routine) if name != file.module)

    def sources(self, main: File) -> tuple[tuple[SourceFile, ...], tuple[Note, ...]]:
        """What the program in `main` is followed with, its own module first, and what is left out
        since it can't be read. Of modules of one name the nearest file counts. Raises KrlError for
        a file of the program's own module.
        """
        found = []
        notes = []
        nearest = _nearest(self.files, main)
        names = {(one.module, one.path.suffix.lower()): one.path for one in nearest}
        for file in self.files:
            taken = names.get((file.module, file.path.suffix.lower()))
            if taken is not None and taken != file.path and file.module not in CONTROLLERS:
                said = f"{file.path} is left out: {taken} has the same name and is nearer"
                notes.append(Note(SourcePlace(), said, Effect.MOTIONS))
        for file in nearest:
            source = self.source(file)
            if isinstance(source, SourceFile):
                found.append(source)
            elif file.module == main.module:
                raise source
            elif file.module not in CONTROLLERS:
                notes.append(Note(source.place, f"left out: {source.reason}", Effect.MOTIONS))
        return tuple(found), tuple(notes)


def read_project(path: Path) -> Project:
    """The files of a folder or of an archive (.zip, .wvs). Raises KrlError where there are none, or
    those of several robots; OSError.
    """
    files = tuple(_of_folder(path) if path.is_dir() else _of_archive(path))
    robots = sorted({part.upper() for one in files for part in one.path.parts if _is_robot(part)})
    if len(robots) > 1:
        raise KrlError(
            f"{path.name} has the programs of {len(robots)} robots: {', '.join(robots)}; give the "
            "folder of one"
        )
    if not any(one.path.suffix.lower() == ".src" for one in files):
        raise KrlError(f"{path.name} has no .src file")
    return Project(path.name, files)


def _of_folder(path: Path) -> Iterator[File]:
    found = sorted(one for one in path.rglob("*") if one.suffix.lower() in _KINDS)
    for one in found[:FILES_MAX]:
        inside = PurePosixPath(one.relative_to(path).as_posix())
        if one.is_file() and _is_program_file(inside):
            with ANYWHERE.open_to_read(one) as stream:
                yield File(inside, stream.read(BYTES_MAX + 1))


def _of_archive(path: Path) -> Iterator[File]:
    try:
        with ANYWHERE.open_to_read(path) as stream:
            if stream.read(len(_DATABASE) + _DATABASE_AT)[_DATABASE_AT:] == _DATABASE:
                raise KrlError(
                    f"{path.name} is a project in WorkVisual's database, no archive: give the "
                    "folder of its files (KRC), or the archive (.zip) that the controller makes"
                )
        with ANYWHERE.open_to_read(path) as stream, zipfile.ZipFile(stream) as archive:
            for one in sorted(archive.infolist(), key=lambda one: one.filename)[:FILES_MAX]:
                inside = PurePosixPath(one.filename.replace("\\", "/"))
                if _is_program_file(inside) and not one.is_dir():
                    with archive.open(one) as entry:
                        yield File(inside, entry.read(BYTES_MAX + 1))
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError) as error:
        # damaged, truncated, encrypted, or packed in a way for which zipfile itself raises
        # NotImplementedError
        raise KrlError(f"{path.name} is no archive that can be read: {error}") from error


def _is_program_file(path: PurePosixPath) -> bool:
    """Whether a file may hold routines or data of programs: machine data don't."""
    machine = path.name.startswith("$") and path.stem.upper() != CONFIGURATION
    return path.suffix.lower() in _KINDS and not machine


def _is_robot(part: str) -> bool:
    return _ROBOT.fullmatch(part) is not None


def _nearest(files: Sequence[File], main: File) -> list[File]:
    """For each module and kind the file that shares most folders with `main`; its module first."""
    best: dict[tuple[str, str], File] = {}
    for file in sorted(files, key=lambda one: -_shared(one.path, main.path)):
        best.setdefault((file.module, file.path.suffix.lower()), file)
    own = [main, *(one for one in best.values() if one.module == main.module and one != main)]
    own = [one for one in own if one is main or one.path.suffix.lower() != main.path.suffix.lower()]
    return [*own, *(one for one in best.values() if one.module != main.module)]


def _shared(one: PurePosixPath, other: PurePosixPath) -> int:
    pairs = zip(one.parts[:-1], other.parts[:-1], strict=False)
    same = [a == b for a, b in pairs]
    return same.index(False) if False in same else len(same)


def _names_motions(file: File) -> bool:
    try:
        return re.search(r"^\s*S?(PTP|LIN|CIRC)\b", file.text, re.MULTILINE | re.I) is not None
    except KrlError:
        return False


def _moves(tree: SyntaxTree) -> bool:
    return any(one.data in _MOTIONS for one in _trees(tree))


def _called(routine: Routine) -> Iterable[str]:
    return (str(one.children[0]) for one in _trees(routine.body) if one.data == "call")


def _trees(tree: SyntaxTree) -> Iterator[SyntaxTree]:
    yield tree
    for child in tree.children:
        if isinstance(child, SyntaxTree):
            yield from _trees(child)
