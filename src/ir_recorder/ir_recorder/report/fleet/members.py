"""What a fleet keeps of each recording: totals only, so that hundreds of them fit."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
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
from ir_recorder.report.fleet.files import Said, recordings_below

MOST = 200  # recordings of a fleet
PLANNED = "its program as planned"  # a measure beside the levers
ENDED = "ended"  # outcome of a step


@dataclass(frozen=True)
class Member:
    """A recording of a robot. robot: the folder that the file lies in, or its own name; origin:
    "measured", "simulated", "recorded", or "predicted" for a plan that was not driven.

    seconds, joules: of a cycle; modes, movements: seconds and joules by name (modes: of the whole
    recording);
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
        except (RecorderError, MsgsError, OSError) as error:
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
    recording = analysis.recording
    savings = analysis.savings
    cell = analysis.cell.name if analysis.cell is not None else ""
    measures = {lever.name: lever.joules for lever in levers(analysis, most=20)}
    if analysis.program is not None and math.isfinite(analysis.program.whole.energy):
        return _driven(analysis, robot, cell, measures, said)
    if savings is None:
        said("left out: it holds neither a program that was driven nor a plan with its savings")
        return None
    total = savings.total
    parts = {"movements": savings.movements, "pauses": savings.pauses}
    movements = {
        name: Share(name, one.seconds, one.planned)
        for name, one in parts.items()
        if one.seconds > 0.0
    }
    measures[PLANNED] = total.saved
    return Member(
        robot,
        recording.path.name,
        cell,
        "predicted",
        total.seconds,
        total.planned,
        {},
        movements,
        measures,
    )


def _driven(
    analysis: Analysis, robot: str, cell: str, measures: Mapping[str, float], said: Said
) -> Member | None:
    """The mean cycle of a program that was driven; None where no cycle was driven to its end."""
    recording = analysis.recording
    program = analysis.program
    assert program is not None  # asked before
    cycles, ended = _cycles(analysis)
    if cycles < 1.0:
        said(f"left out: its program was not driven to the end: {ended}")
        return None
    if cycles != round(cycles):
        said(
            f"its last cycle was not driven to the end ({ended}): it counts as "
            f"{cycles % 1.0:.2f} of one"
        )
    if program.unshortened is not None:
        said("the pauses of the run are shortened: its year is one of such cycles")
    return Member(
        robot,
        recording.path.name,
        cell,
        recording.origin,
        program.whole.seconds / cycles,
        program.whole.energy / cycles,
        {share.name: share for share in analysis.modes},
        _by_name((r.step.label, r.seconds / cycles, r.energy / cycles) for r in analysis.steps),
        {name: joules / cycles for name, joules in measures.items()},
    )


def _cycles(analysis: Analysis) -> tuple[float, str]:
    """How many cycles of its program a recording holds, and of the steps which ended, in words."""
    steps = [result.step for result in analysis.steps]
    ended = sum(step.outcome == ENDED for step in steps)
    total = steps[0].total
    return ended / max(total, 1), f"{ended % total or total} of {total} steps ended"


def _by_name(rows: Iterator[tuple[str, float, float]]) -> dict[str, Share]:
    found: dict[str, Share] = {}
    for name, seconds, joules in rows:
        before = found.get(name, Share(name, 0.0, 0.0))
        found[name] = Share(
            name,
            before.seconds + seconds,
            before.energy + (joules if math.isfinite(joules) else 0.0),
        )
    return found
