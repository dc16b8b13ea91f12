"""What a fleet keeps of each recording: totals only, so that hundreds of them fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ir_msgs_py.errors import MsgsError
from ir_msgs_py.file_roots import FileRoots
from ir_recorder.analysis import Analysis, analyse
from ir_recorder.analysis.levers import levers
from ir_recorder.analysis.results import Share
from ir_recorder.errors import ReadError, RecorderError
from ir_recorder.format import contents
from ir_recorder.format.parts import is_further_part
from ir_recorder.read.reader import read_recording

MOST = 200  # recordings of a fleet
PLANNED = "its program as planned"  # a measure beside the levers
Said = Callable[[str], None]


@dataclass(frozen=True)
class Member:
    """A recording of a robot. robot: the folder that the file lies in, or its own name; origin: "measured",
    "simulated", "recorded", or "predicted" for a plan that was not driven.

    seconds, joules: of a cycle; modes, movements: seconds and joules by name (modes: of the whole recording);
    measures: joules of a cycle that each could save at most.
    """

    robot: str
    file: str
    cell: str
    origin: str
    seconds: float
    joules: float
    modes: Mapping[str, Share]
    movements: Mapping[str, Share]
    measures: Mapping[str, float]


def read_members(
    paths: Sequence[str | Path], roots: FileRoots, left_out: Said, shown: Said = lambda _: None
) -> list[Member]:
    """The members of files and folders, folders with all recordings below them. What can't be read is
    handed to `left_out` as a sentence; `shown` hears each file before it is read. ReadError where nothing is
    left.
    """
    members = []
    files = list(_files(paths, roots, left_out))
    if len(files) > MOST:
        raise ReadError(f"{len(files)} recordings are too many for a page: at most {MOST}")
    for path, top in files:
        shown(str(path))
        try:
            recording = read_recording(path, roots)
            if is_further_part(path, recording.fact(contents.PART)):
                continue
            found = member_of(analyse(recording), _robot(path, top))
        except (RecorderError, MsgsError, OSError) as error:
            left_out(f"{path}: left out: {error}")
            continue
        if found is None:
            left_out(
                f"{path}: left out: it holds neither a program that was driven nor a plan with its savings"
            )
        else:
            members.append(found)
    if not members:
        raise ReadError(f"no recording could be used of {', '.join(map(str, paths))[:300]}")
    return members


def member_of(analysis: Analysis, robot: str) -> Member | None:
    """The totals of a recording; None where it has none."""
    recording, program, savings = analysis.recording, analysis.program, analysis.savings
    cell = analysis.cell.name if analysis.cell is not None else ""
    measures = {lever.name: lever.joules for lever in levers(analysis, most=20)}
    if program is not None and math.isfinite(program.whole.energy):
        movements = _by_name((r.step.label, r.seconds, r.energy) for r in analysis.steps)
        modes = {share.name: share for share in analysis.modes}
        whole = program.whole
        return Member(
            robot,
            recording.path.name,
            cell,
            recording.origin,
            whole.seconds,
            whole.energy,
            modes,
            movements,
            measures,
        )
    if savings is None:
        return None
    total = savings.total
    parts = {"movements": savings.movements, "pauses": savings.pauses}
    movements = {
        name: Share(name, one.seconds, one.planned) for name, one in parts.items() if one.seconds > 0.0
    }
    measures[PLANNED] = total.saved
    return Member(
        robot, recording.path.name, cell, "predicted", total.seconds, total.planned, {}, movements, measures
    )


def _by_name(rows: Iterator[tuple[str, float, float]]) -> dict[str, Share]:
    found: dict[str, Share] = {}
    for name, seconds, joules in rows:
        before = found.get(name, Share(name, 0.0, 0.0))
        found[name] = Share(
            name, before.seconds + seconds, before.energy + (joules if math.isfinite(joules) else 0.0)
        )
    return found


def _files(
    paths: Sequence[str | Path], roots: FileRoots, left_out: Said
) -> Iterator[tuple[Path, Path | None]]:
    """Recordings, each with the folder that it was found below."""
    for path in map(Path, paths):
        try:
            inside = roots.inside(path)
        except MsgsError as error:
            left_out(f"{path}: left out: {error}")
            continue
        if inside.is_dir():
            yield from ((file, inside) for file in sorted(inside.rglob("*.mcap")))
        else:
            yield inside, None


def _robot(path: Path, top: Path | None) -> str:
    """The first folder below the one that was named, else the name of the file."""
    if top is None or path.parent == top:
        return path.stem
    return path.relative_to(top).parts[0]
