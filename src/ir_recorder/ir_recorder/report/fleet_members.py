"""Members of a fleet: which files of which folders, whose robot each one is of, and what is kept of
it; also as columns of numbers.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from pathlib import Path

from ir_recorder.analysis import Analysis, analyse
from ir_recorder.analysis.production import (
    Amount,
    Production,
    demand_watts,
    driven_and_predicted,
    idle_watts,
    levers,
    production_of,
    rest_measured,
    rest_saving,
    without_production,
)
from ir_recorder.errors import ReadError, RecorderError
from ir_recorder.format import contents
from ir_recorder.format.contents import is_further_part
from ir_recorder.reading.reader import read_recording
from ir_recorder.report.headline import started
from ir_recorder.report.number_text import (
    ENGLISH,
)
from ir_recorder.report.step_table import TableValue, write_columns
from ir_values.errors import FileRefusedError, IrError
from ir_values.files import ANYWHERE, FileRoots

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
        except IrError as error:
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
    """Size and end of a regular file; None where it can't be read, or holds nothing."""
    try:
        with ANYWHERE.open_to_read(path) as file:
            size = file.seek(0, os.SEEK_END)
            file.seek(max(size - _BLOCK, 0))
            return (size, sha256(file.read(_BLOCK)).hexdigest()) if size else None
    except (FileRefusedError, OSError):
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


MOST = 200  # recordings of a fleet


@dataclass(frozen=True)
class Member:
    """A recording of a robot. robot: the folder that the file lies in, or its own name; cycle: what
    its program takes in production; measures: joules of a cycle that each could save at most;
    demand [W]: of its largest quarter of an hour in shifts, common_demand that of the common
    program, 0 where no file says it; idle [W]: at rest by power mode; month: of its
    start, as "2026-05" (UTC); driven, predicted [J]: of its run, as it was driven; rest_saves
    [W]: what hibernation saves over closed brakes; rest_measured: whether powers at rest were.
    """

    robot: str
    file: str
    cell: str
    cycle: Production
    measures: Mapping[str, float]
    demand: float
    idle: Mapping[str, float]
    month: str
    driven: float
    predicted: float
    rest_saves: Amount | None = None
    rest_measured: bool = False
    common_demand: float = 0.0


def read_members(
    paths: Sequence[str | Path], roots: FileRoots, left_out: Said, shown: Said = lambda _: None
) -> list[Member]:
    """The members of files and folders, folders with all recordings below them. What can't be read
    is handed to `left_out` as a sentence; `shown` hears each file before it is read. ReadError
    where nothing is left.
    """
    members = []
    files = recordings_below(paths, roots, left_out)
    if len(files) > MOST:
        raise ReadError(f"{len(files)} recordings are too many for a page: at most {MOST}")
    for file in files:
        shown(str(file.path))
        try:
            recording = read_recording(file.path, roots)
            if is_further_part(file.path, recording.fact(contents.PART)):
                continue
            found = member_of(analyse(recording), file.robot, partial(_say, left_out, file.path))
        except (RecorderError, IrError, OSError) as error:
            left_out(f"{file.path}: left out: {error}")
            continue
        if found is not None:
            members.append(found)
    if not members:
        raise ReadError(f"no recording could be used of {', '.join(map(str, paths))[:300]}")
    return members


def _say(said: Said, path: Path, sentence: str) -> None:
    said(f"{path}: {sentence}")


def member_of(analysis: Analysis, robot: str, said: Said = lambda _: None) -> Member | None:
    """The totals of a recording; None where it has none, and `said` hears why, and what limits
    them.
    """
    cycle = production_of(analysis)
    if cycle is None:
        said(f"left out: {without_production(analysis)}")
        return None
    for note in cycle.notes:
        said(note)
    cell = analysis.cell.name if analysis.cell is not None else ""
    measures = {lever.name: lever.joules for lever in levers(analysis, most=20)}
    return Member(
        robot,
        analysis.recording.path.name,
        cell,
        cycle,
        measures,
        demand_watts(analysis, cycle),
        idle_watts(analysis),
        started(analysis.recording).strftime("%Y-%m"),
        *driven_and_predicted(analysis),
        rest_saving(analysis),
        rest_measured(analysis),
        0.0 if cycle.savings is None else cycle.savings.common_demand,
    )


START = b"robot,"


def fleet_columns(members: Sequence[Member]) -> dict[str, list[TableValue]]:
    """A row for every cycle, mode, movement and measure of every recording."""
    rows: list[tuple[TableValue, ...]] = []
    for member in members:
        cycle = member.cycle
        whose = (member.robot, member.file, cycle.origin)
        rows.append((*whose, "cycle", "", cycle.seconds, cycle.energy))
        rows.append((*whose, "driven", member.month, float("nan"), member.driven))
        rows.append((*whose, "predicted", member.month, float("nan"), member.predicted))
        if cycle.computed is not None:
            rest = cycle.computed
            rows.append((*whose, "computed", rest.name, rest.seconds, rest.energy))
        if cycle.savings is not None:
            total = cycle.savings.total
            rows.append((*whose, "saved", "by its plan", total.seconds, total.saved))
        for what, shares in (("mode", cycle.modes), ("movement", cycle.steps)):
            rows += [
                (*whose, what, name, share.seconds, share.energy) for name, share in shares.items()
            ]
        rows += [
            (*whose, "measure", name, float("nan"), joules)
            for name, joules in member.measures.items()
        ]
    names = ("robot", "recording", "origin", "what", "name", "seconds_s", "energy_j")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def write_fleet_table(
    members: Sequence[Member],
    path: str | Path,
    roots: FileRoots = ANYWHERE,
    locale: str = ENGLISH,
) -> Path:
    """Writes the rows as .csv, .xlsx or .parquet below `roots`; RecorderError for another
    ending.
    """
    return write_columns(fleet_columns(members), path, START, roots, locale)
