"""Fleet: many robots and shifts on one page, with energy by robot, mode and movement."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from hashlib import sha256
from pathlib import Path

from ir_recorder.analysis import Analysis, analyse
from ir_recorder.analysis.production import (
    DRIVES_ONLY,
    PREDICTED,
    Amount,
    Production,
    demand_watts,
    deviation,
    driven_and_predicted,
    idle_watts,
    levers,
    mean_of,
    production_of,
    rest_measured,
    rest_saving,
    sum_of,
    without_production,
)
from ir_recorder.errors import ReadError, RecorderError
from ir_recorder.format import contents
from ir_recorder.format.contents import is_further_part
from ir_recorder.reading.reader import read_recording
from ir_recorder.report.answer import Answer
from ir_recorder.report.costs import (
    COMMON,
    DEMAND_LEAVES_OUT,
    LEFT_ALONE,
    Costs,
    Demand,
    IdleSaving,
    assumed_section,
    computed_words,
    counted_with,
    demand_note,
    demand_of,
    following_price,
    idle_money,
    idle_saving,
    idle_sentence,
    money_of_thousand,
    payback,
)
from ir_recorder.report.files import write_output
from ir_recorder.report.headline import started
from ir_recorder.report.methods import counted
from ir_recorder.report.money_text import (
    NOTHING,
    yearly_money,
    yearly_span,
)
from ir_recorder.report.number_text import (
    DASH,
    ENGLISH,
    kilograms,
    kilowatt_hours,
    modes_as_words,
    percent,
    significant,
    text,
    watts,
    yearly_kilowatt_hours,
)
from ir_recorder.report.page import PAGE_START, folded
from ir_recorder.report.paid import (
    ABOVE,
    ABOVE_LEAST,
    Before,
    Paid,
    RunNow,
    Tile,
    a_night,
    at_night,
    between_of,
    counted_at,
    reached_saving,
    row_of,
    with_span,
)
from ir_recorder.report.shell import SIMULATED, badge, shell, source_badge
from ir_recorder.report.step_table import TableValue, write_columns
from ir_recorder.report.tables import COMPACT, bar, table
from ir_recorder.report.whole_line import WholeLine, line_section, of_whole_line
from ir_values.errors import FileRefusedError, IrError
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


# What a fleet keeps of each recording: totals only, so that hundreds of them fit.

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


# Sums over the members of a fleet, in production: joules of a year by robot, mode, movement and
# measure.


@dataclass(frozen=True)
class Robot:
    """All members of one robot: recordings, mean seconds and joules of a cycle; joules of a year,
    and those that its plans save of the common program's, each with its 90 % interval; common [J]:
    of that program, None where nobody knows it. drives_only: they are those of drives and tool, and
    no part of a sum at the mains.
    """

    name: str
    cell: str
    origins: tuple[str, ...]
    recordings: int
    seconds: float
    joules: float
    yearly: Amount
    saved: Amount | None
    common: float | None
    drives_only: bool = False

    @property
    def driven(self) -> bool:
        """Whether all of its files are of runs, none of a plan that nobody drove."""
        return PREDICTED not in self.origins

    @property
    def before(self) -> float:
        """Joules of a year of the common program; of a robot whose files don't say it those of its
        files.
        """
        return self.yearly.value if self.common is None else self.common

    @property
    def now(self) -> Amount:
        """Joules of a year as it is today: as driven, and where nobody drove its plan those of the
        common program.
        """
        if self.driven or self.common is None:
            return self.yearly
        return Amount.of_value(self.common)

    @property
    def reached(self) -> Amount | None:
        """How much less than the common program was driven [J]; None where nothing was, or nobody
        knows it.
        """
        if not self.driven or self.saved is None or self.common is None:
            return None
        return reached_saving(self.saved, self.common, self.yearly.value)

    @property
    def above(self) -> float:
        """Joules of a year that were driven above the plan; 0 where no plan was driven."""
        reached = self.reached
        if reached is None or self.saved is None:
            return 0.0
        return self.saved.value - reached.value


def robots_of(members: Sequence[Member], costs: Costs) -> list[Robot]:
    """The robots, those that take most first. Several recordings of a robot (shifts) are
    averaged.
    """
    found = []
    for name in dict.fromkeys(member.robot for member in members):
        own = [member for member in members if member.robot == name]
        savings = [costs.saving_of_year(member.cycle) for member in own]
        saved = [amount for amount in savings if amount is not None]
        years = [costs.common_of_year(member.cycle) for member in own]
        common = [year for year in years if year is not None]
        found.append(
            Robot(
                name,
                ", ".join(dict.fromkeys(member.cell for member in own if member.cell)),
                tuple(dict.fromkeys(member.cycle.origin for member in own)),
                len(own),
                sum(member.cycle.seconds for member in own) / len(own),
                sum(member.cycle.energy for member in own) / len(own),
                mean_of([costs.energy_of_year(member.cycle) for member in own]),
                mean_of(saved) if saved else None,
                sum(common) / len(common) if common else None,
                any(member.cycle.drives_only for member in own),
            )
        )
    return sorted(found, key=lambda robot: -robot.now.value)


def at_mains(members: Sequence[Member]) -> list[Member]:
    """Those of robots whose energy at the mains is known."""
    apart = {member.robot for member in members if member.cycle.drives_only}
    return [member for member in members if member.robot not in apart]


def _saved_and_common(members: Sequence[Member], costs: Costs) -> tuple[Amount | None, float]:
    """Joules of a year that all plans together save, and those of the programs that they are held
    against; None where no recording says it. Several recordings of a robot are averaged.
    """
    robots = robots_of(at_mains(members), costs)
    saved = [robot.saved for robot in robots if robot.saved is not None]
    common = sum(robot.common for robot in robots if robot.common is not None)
    return (sum_of(saved) if saved else None), common


def fleet_of_line(members: Sequence[Member], costs: Costs) -> WholeLine | None:
    """What all plans together save in a year, as a share of the line and of the factory; None where
    no recording says it, or it is open whether anything is saved.
    """
    saved, common = _saved_and_common(members, costs)
    if saved is None or saved.doubt:
        return None
    return of_whole_line(saved, common, costs)


def by_mode(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year by robot and power mode."""
    return _summed(
        members,
        ((m, s.name, s.energy) for m in members for s in m.cycle.modes.values()),
        costs,
    )


def by_movement(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year by robot and movement or pause."""
    return _summed(
        members, ((m, s.name, s.energy) for m in members for s in m.cycle.steps.values()), costs
    )


def by_measure(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year that each measure could save at most, by robot."""
    return _summed(
        members, ((m, name, joules) for m in members for name, joules in m.measures.items()), costs
    )


def _summed(
    members: Sequence[Member], rows: Iterator[tuple[Member, str, float]], costs: Costs
) -> dict[str, dict[str, float]]:
    """Joules of a year by name, then by robot; largest names first."""
    count = {m.robot: sum(other.robot == m.robot for other in members) for m in members}
    found: dict[str, dict[str, float]] = {}
    for member, name, energy in rows:
        cycles = costs.cycles_per_year(member.cycle.pace) / count[member.robot]
        own = found.setdefault(name, {})
        own[member.robot] = own.get(member.robot, 0.0) + energy * cycles
    return dict(sorted(found.items(), key=lambda item: -sum(item[1].values())))


# The page of a fleet: a year of all robots and what to do about it, then each robot with what to
# change first, then sums.

_MOST_ROBOTS = 8  # of the first table, those that cost most: the rest is one row there
_ROWS = 40  # of movements: the rest is one row
_COLUMNS = 5  # of robots, those that take most: the rest is one column; the table has them all
REST = "all others"
# bars as wide as their section, and none on a telephone, where robots stand column below column
_STYLE = """
@media screen and (min-width: 701px) {
  section#first table.compact { max-width: none; } #first td:has(> .bar) { width: 45%; }
}
@media (max-width: 700px) {
  #first tr > :nth-child(3) { display: none; }
  #robots table.cards td.no:not(:last-child) { display: block; }
  #robots table.cards tr:has(> td.n) { grid-template-columns: repeat(3, minmax(0, 1fr)); }
}
"""


def write_fleet(
    members: Sequence[Member],
    path: str | Path,
    left_out: Sequence[str] = (),
    costs: Costs | None = None,
    roots: FileRoots = ANYWHERE,
) -> Path:
    """Writes the page below `roots`; its absolute path. RecorderError when it can't be written."""
    return write_output(path, fleet_html(members, left_out, costs).encode(), PAGE_START, roots)


def fleet_html(
    members: Sequence[Member], left_out: Sequence[str] = (), costs: Costs | None = None
) -> str:
    """The page as text; left_out: a sentence for each file that could not be used."""
    prices = following_price(costs or Costs())
    robots = robots_of(members, prices)
    known = at_mains(members)
    summed = [robot for robot in robots if not robot.drives_only]
    paid = _paid(known, prices)
    basis = _basis(known, summed)
    sections = [
        _section("Robots, those that cost most first", _robots(members, robots, prices), "robots"),
        _section(
            "What could still be saved, each by itself", _potential(known, summed, prices), "first"
        ),
        _section("Month by month: driven and predicted", _months(members), "months"),
        _problems([each for each in left_out if DRIVES_ONLY not in each]),  # the table says it
        _all_robots(members, robots, prices),
        folded(
            _section("Peak, and when nobody works", _around_the_clock(members, robots, prices)),
            paper=True,
        ),
        folded(line_section(fleet_of_line(members, prices), prices)),
        folded(
            _section("By power mode", _matrix("mode", by_mode(known, prices), summed, basis)),
            paper=True,
        ),
        folded(
            _section(
                "By movement and pause",
                _matrix("movement", by_movement(known, prices), summed, basis),
            ),
        ),
        assumed_section(prices),
    ]
    first = _answer(paid, robots, prices).html()
    year = paid.picture(prices)
    shown = [tile for tile in _tiles(paid, known, robots, prices) if tile is not None]
    return shell(
        f"{_title(robots)}: {_origins(members)}",
        "a year of each robot, one cycle after the other",
        f"{first}{year}{row_of(shown) if shown else ''}{''.join(sections)}",
        badges=[*_simulated(members), _badge(paid, prices)],
        style=_STYLE,
    )


def _title(robots: Sequence[Robot]) -> str:
    """How many robots, and how many of them are in the sums."""
    summed = sum(not robot.drives_only for robot in robots)
    of = f", {summed} in the sums" if summed < len(robots) else ""
    return f"{counted(len(robots), 'robot')}{of}"


def _answer(paid: Paid, robots: Sequence[Robot], costs: Costs) -> Answer:
    """What all robots together save in a year, how sure that is, and in which order."""
    summed = [robot for robot in robots if not robot.drives_only]
    if not summed:
        return Answer("The costs of a year are not known", _apart(robots))
    yearly = sum_of([robot.now for robot in summed])
    price = yearly.of(costs.money)
    taken = f"{kilowatt_hours(yearly.value)}, {kilograms(costs.co2(yearly.value))} of CO2"
    if paid.saved is None and paid.idle is None:
        return Answer(
            f"{yearly_money(price.value, costs.currency)} a year",
            f"for the energy of {counted(len(summed), 'robot')} in shifts: {taken}.",
            between=between_of(price, costs),
            do="Plan their programs (ir plan CELL --saving -o plan.mcap) and name these files as "
            "well: no recording says what a plan saves.",
            counted=counted_at(costs),
        )
    year = paid.year(costs)
    less = "less" if year.money.gain()[0] == "saved" else "more"
    than = paid.before if paid.saved is not None else "closed brakes at night"
    result = f"{paid.gain_words(costs)} a year {less} than {than}"
    if paid.saved is not None and paid.saved.doubt:
        result = f"Open whether anything is saved: {result}"
    reached = paid.has_reached
    if reached is not None:
        result = paid.reached_words(costs)
    saved = year.with_energy(costs)
    parts = [
        f"{counted(len(summed), 'robot')}{' together' if len(summed) > 1 else ''}",
        paid.share_words(costs) if paid.saved is not None and paid.common > 0.0 else "",
        f"{saved} {less}" if saved else "",
        payback(year.money, costs),
    ]
    words = "; ".join(part for part in parts if part)
    todo, done = _steps(paid, robots, costs)
    return Answer(
        result,
        f"{words}.",
        paid.sure(costs, _above(robots, costs)),
        todo or ["Keep the programs as they are."],
        a_night(paid.idle, costs),
        paid.between_words(costs),
        done,
        counted_at(costs),
        paid.bills(costs),
    )


def _steps(paid: Paid, robots: Sequence[Robot], costs: Costs) -> tuple[list[str], list[str]]:
    """What is to do, what saves most first; and what was done already."""
    found: list[tuple[float, str]] = []
    if paid.idle is not None:
        price = with_span(paid.idle.money, costs)
        resting = at_night(paid.idle)
        several = sum(not robot.drives_only for robot in robots) > 1
        words = f"All together in {resting}" if several else f"{resting[0].upper()}{resting[1:]}"
        words = f"{words}: {price} a year."
        found.append((paid.idle.saved, words))
    done = []
    for driven in (True, False):
        own = [robot for robot in robots if robot.driven == driven and not robot.drives_only]
        savings = [robot.reached if driven else robot.saved for robot in own]
        gains = [saved for saved in savings if saved is not None]
        if not gains or paid.saved is None or paid.saved.doubt:
            continue
        saved = sum_of(gains).of(costs.money)
        if saved.value <= 0.0:
            continue
        words = f"{_plans(own)}: {with_span(saved, costs)} a year."
        if driven:
            done.append(words)
        else:
            found.append((saved.value, words))
    above = _above(robots, costs)
    if done and above >= ABOVE_LEAST * costs.money(paid.common):
        words = f"{ABOVE[0].upper()}{ABOVE[1:]}: {yearly_money(above, costs.currency)} a year."
        found.append((above, words))
    return [words for _, words in sorted(found, reverse=True)], done


def _above(robots: Sequence[Robot], costs: Costs) -> float:
    """Money of a year that runs took more than their plans."""
    return costs.money(sum(robot.above for robot in robots if not robot.drives_only))


def _plans(robots: Sequence[Robot]) -> str:
    """Whose plans to drive: those of robots that save, the one that saves most first; whose were
    driven, where all were.
    """
    known = [robot for robot in robots if not robot.drives_only]
    savings = {robot: robot.reached if robot.driven else robot.saved for robot in known}
    gains = {robot: saved.value for robot, saved in savings.items() if saved is not None}
    saving = sorted((robot for robot in gains if gains[robot] > 0.0), key=lambda r: -gains[r])
    if len(saving) == 1:
        of = f'the plan of "{saving[0].name}" instead of its common program'
    else:
        of = f'the plans, that of "{saving[0].name}" first, instead of common programs'
    driven = all(robot.driven for robot in saving)
    return f"{of[0].upper()}{of[1:]}" if driven else f"Drive {of}"


def _simulated(members: Sequence[Member]) -> list[str]:
    """That nothing was measured, where all that was driven was simulated."""
    origins = {member.cycle.origin for member in members} - {PREDICTED}
    if origins != {"simulated"}:
        return []
    return [source_badge(SIMULATED, "simulated")]


def _badge(paid: Paid, costs: Costs) -> str:
    if paid.saved is None:
        return badge("No plan's saving known", "open")
    if paid.saved.doubt:
        return badge("Open whether plans save", "open")
    if paid.saved.value < 0.0:
        return badge("The plans take more", "bad")
    if paid.idle is not None and not paid.idle.measured:
        nights = paid.idle.saved / (paid.idle.saved + costs.money(paid.saved.value))
        if nights > _MUCH:
            return badge(
                f"{100.0 * nights:.0f} % of the saving is at night, from the data sheet", "open"
            )
    return badge("The plans save", "good")


_MUCH = 0.5  # of what is saved: what isn't measured then is said beside the title


def _tiles(
    paid: Paid, members: Sequence[Member], robots: Sequence[Robot], costs: Costs
) -> list[Tile | None]:
    """A year of the fleet in shifts as it is today, and its largest quarter of an hour."""
    summed = [robot for robot in robots if not robot.drives_only]
    if not summed:
        return []
    yearly = sum_of([robot.now for robot in summed])
    price = yearly.of(costs.money)
    of = f"{counted(len(summed), 'robot')}, {_as_now(summed)}"
    energy = f"{kilowatt_hours(yearly.value)}, {kilograms(costs.co2(yearly.value))} of CO2"
    costs_tile = Tile(
        "costs in shifts a year",
        yearly_money(price.value, costs.currency),
        (between_of(price, costs), energy, of),
    )
    of_all = _sum_of_demands([_demand(members, robot, costs) for robot in summed])
    demand = Tile(
        "largest quarter of an hour",
        watts(of_all.watts),
        (
            f"{of}: {of_all.words}",
            "as if all robots' largest came at once" if len(summed) > 1 else "",
            _unsaid(members, summed),
            _outside(paid.idle),
            demand_note(of_all.watts, costs),
        ),
    )
    return [costs_tile, demand]


UNDRIVEN = "plans that nobody drove: as planned"
"""Of figures that have no common program's beside them."""


def _outside(idle: IdleSaving | None) -> str:
    """What rest would take outside of the shifts."""
    if idle is None:
        return ""
    return f"at night and at weekends {watts(idle.watts_deepest)} in {idle.mode}"


def _as_now(robots: Sequence[Robot]) -> str:
    """What the energies of today are of: of runs that were driven, of common programs, of plans
    that nobody holds against one, or of several of these.
    """
    kinds = (
        ("as driven", any(robot.driven for robot in robots)),
        ("as planned", any(not r.driven and r.common is None for r in robots)),
        (f"{COMMON} where no plan was driven", any(_stands(robot) for robot in robots)),
    )
    return ", ".join(name for name, some in kinds if some)


def _stands(robot: Robot) -> bool:
    """Whether the common program stands for what a robot takes today."""
    return not robot.driven and robot.common is not None


def _demand(members: Sequence[Member], robot: Robot, costs: Costs) -> Demand:
    """The largest quarter of an hour as the robot is today, on the basis of its bill."""
    own = _own(members, robot)
    stands = _stands(robot)
    shifts = max((stands and member.common_demand) or member.demand for member in own)
    rests: dict[str, float] = {}
    for member in own:
        rests |= {mode: max(power, rests.get(mode, 0.0)) for mode, power in member.idle.items()}
    return demand_of(shifts, rests, costs, planned=not robot.driven and not stands)


def _sum_of_demands(demands: Sequence[Demand]) -> Demand:
    total = demands[0]
    for each in demands[1:]:
        total = total.plus(each)
    return total


def _unsaid(members: Sequence[Member], robots: Sequence[Robot]) -> str:
    """Whose largest quarter is that of the plan, as its file is of an earlier version."""
    without = [
        robot
        for robot in robots
        if _stands(robot) and not all(each.common_demand for each in _own(members, robot))
    ]
    return f"{UNSAID}: {_names(without)}" if without else ""


UNSAID = "as planned, as no file says the common program's"
"""Of the largest quarter of an hour of plans that an earlier version wrote."""


def _paid(members: Sequence[Member], costs: Costs) -> Paid:
    """What those who pay ask first, of all robots together."""
    saved, _ = _saved_and_common(members, costs)
    idle = _idle_saving(members, costs)
    robots = robots_of(members, costs)
    if saved is None:
        return Paid(None, 0.0, idle)
    without = [robot for robot in robots if robot.saved is None]
    of = f", {counted(len(robots), 'robot')}"
    if without:
        of += f", {_names(without)} alike in all: no file says what its plan saves"
    common = sum(robot.before for robot in robots)
    driven = [robot.reached for robot in robots if robot.reached is not None]
    of += f"; today: {_as_now(robots)}" if driven else ""
    now = RunNow("today", sum_of([robot.now for robot in robots]).value)
    return Paid(
        saved,
        common,
        idle,
        of,
        Before.COMMONS,
        now if driven else None,
        run=_computed(members),
        reached=sum_of(driven) if driven else None,
    )


def _computed(members: Sequence[Member]) -> str:
    """What nobody drove of the cycles that count as driven, in a sentence; "" where all was."""
    bases = dict.fromkeys(m.cycle.basis for m in members if m.cycle.computed is not None)
    if not bases:
        return ""
    return f"Pauses that runs shortened count at full length: computed, {' and '.join(bases)}."


_ROBOT_HEADS = (
    "robot", ">costs in shifts a year", ">reached a year", ">still to save a year",
    "change first",
)  # fmt: skip


def _robots(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    """Those that cost most, each with what to change first; the others in one row."""
    rest = robots[_MOST_ROBOTS:]
    others = [robot for robot in rest if not robot.drives_only]
    rows = [_robot_row(robot, members, costs) for robot in robots[:_MOST_ROBOTS]]
    if others:
        without = len(rest) - len(others)
        name = counted(len(rest), "other robot")
        name += f"<small>{without} of them in no sum</small>" if without else ""
        rows.append((name, *_sums(others, members, costs), DASH))
    summed = [robot for robot in robots if not robot.drives_only]
    if len(summed) > 1:
        recordings = counted(sum(robot.recordings for robot in summed), "file")
        name = f"<b>all</b><small>{recordings}</small>"
        rows.append((name, *_sums(summed, members, costs), DASH))
    hint = (
        "Reached: the common program (the same stations by PTP at full speed with the controller's "
        "own timers, predicted), less what was driven. Where nobody drove a plan the common "
        "program stands for today. Still to save: what nobody did yet. "
        "Small: 90 % intervals, which add up as if all were wrong alike."
    )
    if any(robot.saved is not None and robot.saved.doubt for robot in robots):
        hint += " Open: zero lies in the interval."
    hint = f"{text(hint)} {counted_with(costs)} {_apart(robots)}"
    return f'{table(_ROBOT_HEADS, rows, "Robots")}<p class="hint">{hint}</p>'


def _all_robots(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    """Every robot, folded; "" where the first table has them."""
    if len(robots) <= _MOST_ROBOTS:
        return ""
    rows = [_robot_row(robot, members, costs) for robot in robots[_MOST_ROBOTS:]]
    name = f"The other {counted(len(rows), 'robot')}"
    return folded(_section(name, table(_ROBOT_HEADS, rows, name)))


def _robot_row(robot: Robot, members: Sequence[Member], costs: Costs) -> tuple[str, ...]:
    own = _own(members, robot)
    idle = None if robot.drives_only else _idle_saving(own, costs)
    part = robot.joules / costs.parts_per_cycle
    made = ", ".join((robot.cell, _origins(own), *([DRIVES_ONLY] if robot.drives_only else ())))
    how = "" if robot.driven else " as planned"
    each = f"a part{how} {kilowatt_hours(part)}, {money_of_thousand(part, costs)}"
    computed = computed_words(*(member.cycle for member in own))
    each += f"; {computed}" if computed else ""
    today = f"<small>{COMMON}, predicted</small>" if _stands(robot) else ""
    return (
        f"{text(robot.name)}<small>{text(made)}</small><small>{text(each)}</small>",
        f"{_yearly(robot.now, costs)}{today}",
        _saved(robot.reached, costs),
        _left([robot], idle, costs),
        text(_first_lever(robot, own, idle, costs)),
    )


def _first_lever(robot: Robot, own: Sequence[Member], idle: IdleSaving | None, costs: Costs) -> str:
    """What saves most: rest outside of the shifts, its plan, or, without a plan, a measure."""
    found: list[tuple[float, str]] = []
    if idle is not None:
        found.append((idle.saved, f"{idle.mode} at night"))
    saves = robot.saved is not None and robot.saved.value > 0.0 and not robot.saved.doubt
    if robot.saved is not None and saves and not robot.driven:
        found.append((costs.money(robot.saved.value), "drive its plan"))
    if robot.saved is None:
        found += [
            (costs.money(sum(each.values())), f"{name} (at most)")
            for name, each in by_measure(own, costs).items()
        ]
    return max(found)[1] if found else DASH


def _sums(robots: Sequence[Robot], members: Sequence[Member], costs: Costs) -> tuple[str, ...]:
    """Costs, energy and savings of several robots."""
    reached = [robot.reached for robot in robots if robot.reached is not None]
    known = [member for robot in robots for member in _own(members, robot)]
    return (
        _yearly(sum_of([robot.now for robot in robots]), costs),
        _saved(sum_of(reached) if reached else None, costs),
        _left(robots, _idle_saving(known, costs), costs),
    )


def _parts_left(
    robots: Sequence[Robot], idle: IdleSaving | None, costs: Costs
) -> list[tuple[Amount, str]]:
    """What rest outside of the shifts, plans that nobody drove and runs at their plan's energy
    would save, each with its words.
    """
    plans = [r.saved for r in robots if not r.driven and r.saved is not None]
    open_plans = sum_of(plans).of(costs.money) if plans else None
    parts = []
    if idle is not None:
        parts.append((idle.money, "at night"))
    if open_plans is not None and open_plans.value > 0.0 and not open_plans.doubt:
        parts.append((open_plans, "by its plan" if len(robots) == 1 else "by plans"))
    above = costs.money(sum(robot.above for robot in robots))
    if abs(above) >= NOTHING:
        parts.append(
            (Amount.of_value(above), "above its plan" if len(robots) == 1 else "above plans")
        )
    return parts


def _left(robots: Sequence[Robot], idle: IdleSaving | None, costs: Costs) -> str:
    """The same together, and each."""
    parts = _parts_left(robots, idle, costs)
    if not parts:
        return DASH
    whole = sum_of([money for money, _ in parts])
    named = [f"{yearly_money(money.value, costs.currency)} {words}" for money, words in parts]
    return f"{_money(whole, costs)}<small>{text(', '.join(named))}</small>"


_NAMED = 5  # robots in a sentence


def _apart(robots: Sequence[Robot]) -> str:
    """Which robots are in no sum, and why; "" where all are."""
    apart = [robot for robot in robots if robot.drives_only]
    if not apart:
        return ""
    return text(
        f"In no sum, as their energy at the mains isn't known ({DRIVES_ONLY}), nor what they take "
        f"at rest: {_names(apart)}."
    )


def _names(robots: Sequence[Robot]) -> str:
    names = ", ".join(robot.name for robot in robots[:_NAMED])
    return f"{names} and {len(robots) - _NAMED} more" if len(robots) > _NAMED else names


def _around_the_clock(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    """The largest quarter of an hour, and what rest outside of the shifts takes, by robot."""
    modes = list(dict.fromkeys(mode for member in members for mode in member.idle))
    rows = []
    demands: list[Demand] = []
    idle: dict[str, list[float]] = {mode: [] for mode in modes}
    for robot in robots:
        own = [member for member in members if member.robot == robot.name]
        demand = _demand(members, robot, costs)
        if not robot.drives_only:
            demands.append(demand)
        energies = []
        for mode in modes:
            known = [member.idle[mode] for member in own if mode in member.idle]
            energy = max(known) * costs.idle_hours * 3600.0 if known else float("nan")
            energies.append(energy)
            if not robot.drives_only:
                idle[mode].append(energy)
        rows.append(_clock_row(_named(robot), demand, energies, costs))
    sums = [sum(idle[mode]) for mode in modes]
    if demands:
        rows.append(_clock_row("<b>all</b>", _sum_of_demands(demands), sums, costs))
    heads = ("robot", ">largest quarter of an hour", *(f">{_rest_head(mode)}" for mode in modes))
    saves = _idle_saving(members, costs)
    hint = (
        f"{significant(costs.idle_hours, 6)} hours a year lie outside of the shifts; the columns "
        "of modes say what rest takes in them, by the data. The peak of all robots is the sum of "
        f"theirs: as if all came at once; it is on the basis of the bill ({_as_now(robots)}). "
        f"{DEMAND_LEAVES_OUT} {idle_sentence(saves, costs)}"
    )
    return f'<p class="hint">{text(hint)}</p>{table(heads, rows, "Peak and rest")}'


def _idle_saving(members: Sequence[Member], costs: Costs) -> IdleSaving | None:
    """What hibernation saves outside of the shifts, of all robots whose rest is known."""
    rests: dict[str, dict[str, float]] = {}
    for member in members:
        own = rests.setdefault(member.robot, {}) if member.idle else {}
        own.update({mode: max(power, own.get(mode, 0.0)) for mode, power in member.idle.items()})
    modes = set.intersection(*(set(rest) for rest in rests.values())) if rests else set()
    watts_of_all = {mode: sum(rest[mode] for rest in rests.values()) for mode in modes}
    measured = all(member.rest_measured for member in members if member.idle)
    saves = {member.robot: member.rest_saves for member in members}
    known = [saved for saved in saves.values() if saved is not None]
    return idle_saving(watts_of_all, sum_of(known), costs, measured=measured)


def _rest_head(mode: str) -> str:
    return f"{_shown(mode)} (today, if left alone)" if mode == LEFT_ALONE else _shown(mode)


def _named(robot: Robot) -> str:
    limit = f"<small>{DRIVES_ONLY}</small>" if robot.drives_only else ""
    return f"{text(robot.name)}{limit}"


def _months(members: Sequence[Member]) -> str:
    """What was driven in each month, beside what was predicted of it."""
    known = [member for member in members if math.isfinite(member.driven - member.predicted)]
    if not known:
        return '<p class="empty">No recording holds a program that was driven and its plan.</p>'
    kinds = dict.fromkeys((m.month, m.cycle.origin) for m in sorted(known, key=lambda m: m.month))
    rows = []
    for month, origin in kinds:
        own = [m for m in known if (m.month, m.cycle.origin) == (month, origin)]
        driven, predicted = (sum(getattr(m, name) for m in own) for name in ("driven", "predicted"))
        shares = [deviation(m.driven, m.predicted) for m in own]
        made = f"{origin}, {counted(len({m.robot for m in own}), 'robot')}"
        if len(own) > 1:
            made += f", {counted(len(own), 'recording')}"
        least = percent(min(shares)).removesuffix(" %")
        ends = f"<small>{least} to {percent(max(shares))}</small>"
        rows.append(
            (
                f"{text(month)}<small>{text(made)}</small>",
                f"<b>{kilowatt_hours(driven)}</b>",
                kilowatt_hours(predicted),
                f"<b>{percent(deviation(driven, predicted))}</b>{ends if len(own) > 1 else ''}",
            )
        )
    heads = ("month", ">driven", ">predicted", ">difference")
    shortened = any(_shortened(member) for member in known)
    pauses = "pauses shortened, " if shortened else ""
    single = "; small: of single recordings" if len(known) > len(kinds) else ""
    hint = (
        f"Runs as they were driven: {pauses}waiting between steps included, which no plan contains"
        f"{single}. A difference that grows is a robot, a tool or a program that has changed."
    )
    return f'{table(heads, rows, "Month by month", COMPACT)}<p class="hint">{hint}</p>'


def _shortened(member: Member) -> bool:
    """Whether a cycle counts more than what was driven: pauses at full length."""
    return member.cycle.energy * member.cycle.cycles > 1.001 * member.driven


def _clock_row(
    name: str, demand: Demand, energies: Sequence[float], costs: Costs
) -> tuple[str, ...]:
    lines = (demand.words, demand_note(demand.watts, costs))
    small = "".join(f"<small>{text(line)}</small>" for line in lines if line)
    cells = (
        f"{text(idle_money(energy, costs))}<small>{text(kilowatt_hours(energy))}</small>"
        for energy in energies
    )
    return (name, f"<b>{watts(demand.watts)}</b>{small}", *cells)


def _shown(name: str) -> str:
    """A mode as people read it; names of movements as they are."""
    return name.replace("_", " ").lower() if name.isupper() else modes_as_words(name)


def _yearly(amount: Amount, costs: Costs) -> str:
    """Price of a year with its interval, and its energy."""
    energy = f"<small>{text(kilowatt_hours(amount.value))}</small>"
    return f"{_money(amount.of(costs.money), costs)}{energy}"


def _money(price: Amount, costs: Costs) -> str:
    value = yearly_money(price.value, costs.currency)
    return f"<b>{text(value)}</b>{_small_ends(price, costs)}"


def _small_ends(price: Amount, costs: Costs) -> str:
    if price.low >= price.high:
        return ""
    ends = yearly_span(price.low, price.high, costs.currency)
    return f"<small>{text(ends)} {text(costs.currency)}</small>"


def _saved(amount: Amount | None, costs: Costs) -> str:
    """What is saved, with its interval; where zero lies in it, that it is open."""
    if amount is None:
        return DASH
    word, amount = amount.gain()
    between = _small_ends(amount.of(costs.money), costs)
    if amount.doubt:
        return f'<span title="{text(amount.doubt)}">open</span>{between}'
    price = yearly_money(costs.money(amount.value), costs.currency)
    energy = f"{kilowatt_hours(amount.value)}{' more' if word == 'more' else ''}"
    return f"<b>{text(price)}</b><small>{text(energy)}</small>{between}"


def _basis(members: Sequence[Member], robots: Sequence[Robot]) -> str:
    """What energies by mode and by movement are of, in sentences; "" where all was driven."""
    computed = _computed(members)
    if not any(_stands(robot) for robot in robots):
        return computed
    planned = f"{UNDRIVEN[0].upper()}{UNDRIVEN[1:]}, not the {COMMON}."
    return f"{computed} {planned}".strip()


def _matrix(
    what: str,
    found: Mapping[str, Mapping[str, float]],
    robots: Sequence[Robot],
    basis: str,
) -> str:
    """Rows by name, a column for each of the first robots, one for the others and one for all;
    basis: a sentence that limits them.
    """
    if not found:
        return '<p class="empty">No recording says it.</p>'
    names = list(found)
    rows = [_row(name, found[name], robots) for name in names[:_ROWS]]
    if len(names) > _ROWS:
        rest = {r.name: sum(found[name].get(r.name, 0.0) for name in names[_ROWS:]) for r in robots}
        rows.append(_row(REST, rest, robots))
    hint = f'<p class="hint">{text(basis)}</p>' if basis else ""
    return table((what, *_robot_heads(robots), ">all"), rows, f"kWh a year by {what}") + hint


def _robot_heads(robots: Sequence[Robot]) -> list[str]:
    heads = [f">{robot.name}" for robot in robots[:_COLUMNS]]
    return [*heads, ">other robots"] if len(robots) > _COLUMNS else heads


def _row(name: str, own: Mapping[str, float], robots: Sequence[Robot]) -> tuple[str, ...]:
    shown = [own.get(robot.name) for robot in robots[:_COLUMNS]]
    if len(robots) > _COLUMNS:
        shown.append(sum(own.get(robot.name, 0.0) for robot in robots[_COLUMNS:]))
    cells = (DASH if value is None else text(yearly_kilowatt_hours(value)) for value in shown)
    return (text(_shown(name)), *cells, f"<b>{text(yearly_kilowatt_hours(sum(own.values())))}</b>")


_LITTLE = 0.01  # of the largest measure: less is only named


def _potential(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    """Measures by what they save at most, and the robot at which each saves most."""
    found: list[tuple[float, str, Mapping[str, float]]] = [
        (costs.money(sum(own.values())), text(_shown(name)), own)
        for name, own in by_measure(members, costs).items()
    ]
    found += [*_night(members, robots, costs), *_of_plans(robots, costs)]
    if not found:
        return '<p class="empty">No recording says it.</p>'
    found.sort(key=lambda measure: -measure[0])
    most = max(found[0][0], 1e-9)
    rows = [
        (
            f"{name}{_most_at(own)}",
            f"<b>{text(yearly_money(price, costs.currency))}</b>"
            f"<small>{text(yearly_kilowatt_hours(sum(own.values())))}</small>",
            bar(price, most, "planned"),
        )
        for price, name, own in found
        if price >= _LITTLE * most
    ]
    heads = ("what", ">a year", "")
    hint = "Upper bounds, each by itself: together they count some joules twice."
    undriven = [robot for robot in robots if not robot.driven]
    if undriven:
        hint += f" Of plans that nobody drove no movement is counted: {text(_names(undriven))}."
    little = [name for price, name, _ in found if price < _LITTLE * most]
    if little:
        hint += f" Less than {100.0 * _LITTLE:g} % of the largest: {', '.join(little)}."
    return f'{table(heads, rows, "What could still be saved", COMPACT)}<p class="hint">{hint}</p>'


_MORE = 1.05  # times what the next one saves: else none saves most


def _most_at(own: Mapping[str, float]) -> str:
    """The robot at which a measure saves most, in small letters; "" where none stands out."""
    first, *others = sorted(own.items(), key=lambda each: -each[1])
    if not others or first[1] < _MORE * others[0][1]:
        return ""
    return f"<small>most at {text(first[0])}</small>"


def _night(
    members: Sequence[Member], robots: Sequence[Robot], costs: Costs
) -> list[tuple[float, str, Mapping[str, float]]]:
    """Rest outside of the shifts as a measure; none where it saves nothing."""
    nights = _idle_saving(members, costs)
    if nights is None:
        return []
    own = {robot.name: _idle_saving(_own(members, robot), costs) for robot in robots}
    energies = {name: idle.energy.value for name, idle in own.items() if idle is not None}
    ends = f"{yearly_span(nights.money.low, nights.money.high, costs.currency)} {costs.currency}"
    basis = f"{nights.mode} instead of closed brakes, {nights.basis}, 90 % interval {ends}"
    name = f"at night and at weekends<small>{text(basis)}</small>"
    return [(nights.saved, name, energies)]


def _of_plans(
    robots: Sequence[Robot], costs: Costs
) -> list[tuple[float, str, Mapping[str, float]]]:
    """Plans that nobody drove, and what runs took above theirs, as measures; none that saves
    nothing.
    """
    undriven = {r.name: r.saved for r in robots if not r.driven and r.saved is not None}
    found: list[tuple[float, str, Mapping[str, float]]] = []
    if undriven:
        plans = sum_of(list(undriven.values()))
        words = "driven instead of the common programs, predicted"
        words += f", {between_of(plans.of(costs.money), costs)}" if plans.low < plans.high else ""
        if plans.value > 0.0 and not plans.doubt:
            energies = {name: saved.value for name, saved in undriven.items()}
            name = f"plans that nobody drove<small>{text(words)}</small>"
            found.append((costs.money(plans.value), name, energies))
    above = {robot.name: robot.above for robot in robots if robot.reached is not None}
    total = costs.money(sum(above.values()))
    if total >= NOTHING:
        found.append((total, "what runs took above their plans", above))
    return found


def _own(members: Sequence[Member], robot: Robot) -> list[Member]:
    return [member for member in members if member.robot == robot.name]


def _section(title: str, content: str, name: str = "") -> str:
    called = f' id="{name}"' if name else ""
    return f"<section{called}><h2>{text(title)}</h2>{content}</section>"


def _origins(members: Sequence[Member]) -> str:
    """How many runs of which origin, and how many plans."""
    counts = Counter(member.cycle.origin for member in members)
    return ", ".join(
        counted(count, "plan" if origin == PREDICTED else f"{origin} run")
        for origin, count in counts.items()
    )


def _problems(left_out: Sequence[str]) -> str:
    if not left_out:
        return ""
    items = "".join(f"<li>{text(sentence)}</li>" for sentence in left_out)
    return f'<div class="problems calm"><b>Notes</b><ul>{items}</ul></div>'


# A fleet as columns of numbers, for CSV, Parquet and pandas: SI units, joules of a cycle.

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
