"""Fleet: many robots and shifts on one page, with energy by robot, mode and movement."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from pathlib import Path

from ir_recorder.analysis import Analysis, analyse
from ir_recorder.analysis.flows import levers
from ir_recorder.analysis.results import Share
from ir_recorder.errors import ReadError, RecorderError
from ir_recorder.format import contents
from ir_recorder.format.contents import is_further_part
from ir_recorder.reading.reader import read_recording
from ir_recorder.report.costs import SETTINGS, Costs, money
from ir_recorder.report.files import write_output
from ir_recorder.report.number_text import joules, kilowatt_hours, number, seconds, text
from ir_recorder.report.page import PAGE_START, asset
from ir_recorder.report.step_table import TableValue, write_columns
from ir_recorder.report.tables import table
from ir_values.errors import IrError
from ir_values.files import ANYWHERE, FileRoots

# Which files a fleet is made of: recordings of folders, whose robot each one is of, none of them
# twice.

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


# What a fleet keeps of each recording: totals only, so that hundreds of them fit.

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
    for name, time, energy in rows:
        before = found.get(name, Share(name, 0.0, 0.0))
        found[name] = Share(
            name,
            before.seconds + time,
            before.energy + (energy if math.isfinite(energy) else 0.0),
        )
    return found


# Sums over the members of a fleet, in production: joules of a year by robot, mode, movement and
# measure.


@dataclass(frozen=True)
class Robot:
    """All members of one robot: recordings, mean seconds and joules of a cycle, joules of a
    year.
    """

    name: str
    cell: str
    origins: tuple[str, ...]
    recordings: int
    seconds: float
    joules: float
    yearly: float


def robots_of(members: Sequence[Member], costs: Costs) -> list[Robot]:
    """The robots, those that take most first. Several recordings of a robot (shifts) are
    averaged.
    """
    found = []
    for name in dict.fromkeys(member.robot for member in members):
        own = [member for member in members if member.robot == name]
        seconds, joules = (
            sum(values) / len(own) for values in ([m.seconds for m in own], [m.joules for m in own])
        )
        yearly = sum(yearly_of(member, costs) for member in own) / len(own)
        origins = tuple(dict.fromkeys(member.origin for member in own))
        cells = ", ".join(dict.fromkeys(member.cell for member in own if member.cell))
        found.append(Robot(name, cells, origins, len(own), seconds, joules, yearly))
    return sorted(found, key=lambda robot: -robot.yearly)


def yearly_of(member: Member, costs: Costs) -> float:
    """Joules of a year, one cycle after the other."""
    return member.joules * costs.cycles_per_year(member.seconds) if member.seconds > 0.0 else 0.0


def by_mode(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year by robot and mode: a recording's modes share its year as they share its
    joules.
    """
    return _summed(
        members,
        ((m, s.name, s.energy) for m in members for s in m.modes.values()),
        costs,
        share=True,
    )


def by_movement(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year by robot and movement or pause."""
    return _summed(
        members, ((m, s.name, s.energy) for m in members for s in m.movements.values()), costs
    )


def by_measure(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year that each measure could save at most, by robot."""
    return _summed(
        members, ((m, name, joules) for m in members for name, joules in m.measures.items()), costs
    )


def _summed(
    members: Sequence[Member],
    rows: Iterator[tuple[Member, str, float]],
    costs: Costs,
    share: bool = False,
) -> dict[str, dict[str, float]]:
    """By name, then by robot; largest names first."""
    count = {m.robot: sum(other.robot == m.robot for other in members) for m in members}
    found: dict[str, dict[str, float]] = {}
    for member, name, energy in rows:
        whole = sum(one.energy for one in member.modes.values()) if share else member.joules
        if whole <= 0.0:
            continue
        yearly = energy / whole * yearly_of(member, costs) / count[member.robot]
        own = found.setdefault(name, {})
        own[member.robot] = own.get(member.robot, 0.0) + yearly
    return dict(sorted(found.items(), key=lambda item: -sum(item[1].values())))


# The page of a fleet: tables with sums, and bars of each robot's year.

_ROWS = 40  # of movements: the rest is one row
REST = "all others"


def write_fleet(
    members: Sequence[Member],
    path: str | Path,
    left_out: Sequence[str] = (),
    costs: Costs | None = None,
    roots: FileRoots = ANYWHERE,
) -> Path:
    """Writes the page below `roots`; its absolute path. PathError when it can't be written."""
    return write_output(path, fleet_html(members, left_out, costs).encode(), PAGE_START, roots)


def fleet_html(
    members: Sequence[Member], left_out: Sequence[str] = (), costs: Costs | None = None
) -> str:
    """The page as text; left_out: a sentence for each file that could not be used."""
    prices = costs or Costs()
    robots = robots_of(members, prices)
    sections = [
        _section("Robots", _robots(robots, prices)),
        _section("By power mode", _matrix("mode", by_mode(members, prices), robots)),
        _section("What could be saved, by measure", _potential(members, robots, prices)),
        _section(
            "By movement and pause", _matrix("movement", by_movement(members, prices), robots)
        ),
    ]
    title = f"{len(robots)} robots, {len(members)} recordings"
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    )
    return (
        f'<!doctype html><html lang="en"><head>{head}<title>{text(title)}</title>'
        f"<style>{asset('page.css')}</style></head><body><header><div><h1>{text(title)}</h1>"
        f'<p class="subtitle">{text(_origins(members))}; a year of each robot, one cycle after '
        "the other</p>"
        f"</div></header><main>{_problems(left_out)}{''.join(sections)}{_assumptions(prices)}</main>"
        f"<script>{asset('export.js')}\nexportButtons();</script></body></html>"
    )


def _robots(robots: Sequence[Robot], costs: Costs) -> str:
    most = max((robot.yearly for robot in robots), default=1.0) or 1.0
    rows = [
        (
            f"{text(robot.name)}<small>{text(robot.cell)}</small>",
            text(", ".join(robot.origins)),
            str(robot.recordings),
            seconds(robot.seconds),
            text(joules(robot.joules)),
            f"<b>{text(kilowatt_hours(robot.yearly))}</b>",
            text(money(costs.money(robot.yearly), costs.currency)),
            text(number(costs.co2(robot.yearly), "kg")),
            f'<i class="bar" style="width:{100.0 * robot.yearly / most:.1f}%"></i>',
        )
        for robot in robots
    ]
    whole = sum(robot.yearly for robot in robots)
    sums = (text(kilowatt_hours(whole)), text(money(costs.money(whole), costs.currency)))
    rows.append(
        (
            "<b>all</b>",
            "",
            str(sum(r.recordings for r in robots)),
            "",
            "",
            f"<b>{sums[0]}</b>",
            sums[1],
            text(number(costs.co2(whole), "kg")),
            "",
        )
    )
    heads = (
        "robot",
        "origin",
        ">recordings",
        ">cycle",
        ">energy",
        ">a year",
        ">costs",
        ">CO2",
        "share",
    )
    return table(heads, rows, "Robots")


def _matrix(what: str, found: Mapping[str, Mapping[str, float]], robots: Sequence[Robot]) -> str:
    """Rows by name, a column for each robot and one for all."""
    if not found:
        return '<p class="empty">No recording says it.</p>'
    names = list(found)
    rows = [_row(name, found[name], robots) for name in names[:_ROWS]]
    if len(names) > _ROWS:
        rest = {r.name: sum(found[name].get(r.name, 0.0) for name in names[_ROWS:]) for r in robots}
        rows.append(_row(REST, rest, robots))
    return table(
        (what, *(f">{robot.name}" for robot in robots), ">all"), rows, f"kWh a year by {what}"
    )


def _row(name: str, own: Mapping[str, float], robots: Sequence[Robot]) -> tuple[str, ...]:
    shown = name.replace("_", " ").lower() if name.isupper() else name
    cells = (text(kilowatt_hours(own[robot.name])) if robot.name in own else "" for robot in robots)
    return (text(shown), *cells, f"<b>{text(kilowatt_hours(sum(own.values())))}</b>")


def _potential(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    found = by_measure(members, costs)
    if not found:
        return '<p class="empty">No recording says it.</p>'
    rows = [
        (*_row(name, own, robots), text(money(costs.money(sum(own.values())), costs.currency)))
        for name, own in found.items()
    ]
    heads = ("measure", *(f">{robot.name}" for robot in robots), ">all", ">a year, at most")
    hint = (
        "Upper bounds, each by itself: together they count some joules twice. What a plan "
        "saves is predicted."
    )
    return f'<p class="hint">{hint}</p>{table(heads, rows, "kWh a year by measure")}'


def _section(title: str, content: str) -> str:
    return f"<section><h2>{text(title)}</h2>{content}</section>"


def _origins(members: Sequence[Member]) -> str:
    counts = {
        origin: sum(m.origin == origin for m in members)
        for origin in dict.fromkeys(m.origin for m in members)
    }
    return ", ".join(f"{count} {origin}" for origin, count in counts.items())


def _problems(left_out: Sequence[str]) -> str:
    if not left_out:
        return ""
    items = "".join(f"<li>{text(sentence)}</li>" for sentence in left_out)
    return f'<div class="problems"><b>Notes</b><ul>{items}</ul></div>'


def _assumptions(costs: Costs) -> str:
    shown = (
        f"{each.name.replace('_', ' ')} {getattr(costs, each.name)} {each.unit}".strip()
        + ("" if each.name in costs.given else " (assumed)")
        for each in SETTINGS
    )
    return f'<p class="hint">{text(", ".join(shown))}.</p>'


# A fleet as columns of numbers, for CSV, Parquet and pandas: SI units, joules of a cycle.

START = b"robot,"


def fleet_columns(members: Sequence[Member]) -> dict[str, list[TableValue]]:
    """A row for every cycle, mode, movement and measure of every recording."""
    rows: list[tuple[TableValue, ...]] = []
    for member in members:
        whose = (member.robot, member.file, member.origin)
        rows.append((*whose, "cycle", "", member.seconds, member.joules))
        for what, shares in (("mode", member.modes), ("movement", member.movements)):
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
    members: Sequence[Member], path: str | Path, roots: FileRoots = ANYWHERE
) -> Path:
    """Writes the rows as .csv or .parquet below `roots`; RecorderError for another ending."""
    return write_columns(fleet_columns(members), path, START, roots)
