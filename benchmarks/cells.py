"""Is the cheapest cycle of a robotic cell found and proved, and how soon?

    python benchmarks/cells.py [--only drawn|flexible] [--file FILE.xml]... [--seeds N]
                               [--seconds S] [--quick] [--json FILE]

Cells drawn at random that have a schedule by construction, and instances of the public benchmark
where --file names them. Each is solved by the project's model and by the published one, in the same
solver and invocation, each with as many seconds of processor time; a judge that knows only the file
checks every schedule and its energy. The laws: every schedule is valid, costs what it says, and is
proved; the published model, with its ten segments per curve, never proves a bound above it.

flexible: the bundled cell of that name at 30 parts an hour, with what is saved against the common
cycle of the same order, which moves at 100 % and leaves waits to the controller's own timers.
"""

from __future__ import annotations

import argparse
import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from _cells_drawn import drawn
from _cells_judge import energy, faults
from _cells_published import PublishedModel
from _results import Claim, at_least, at_most, command_line, finish, line_of

from ir_planner import Planner
from ir_studies.cells import CellAnswer, read_instances, solve_cell, written

SIZES = ((2, 6), (3, 6), (3, 9))  # robots and stops of each
LARGE = ((5, 10), (8, 10))
PARTS_PER_HOUR = 30.0


@dataclass(frozen=True)
class Row:
    """An instance: energy [J], gap [%], faults by the judge, processor seconds, the published
    model's.
    """

    name: str
    robots: int
    energy: float
    gap: float
    faults: int
    seconds: float
    published: float
    published_seconds: float


@dataclass(frozen=True)
class FlexibleRow:
    """Our own cell: period [s], joules a part, gap [%]; the common cycle's period and joules, those
    on motors all the time, and the interval [J] of what is saved; processor seconds of planning.
    """

    name: str
    period: float
    joules: float
    gap: float
    common_period: float
    common: float
    on_motors: float
    low: float
    high: float
    certified: bool
    seconds: float


def main() -> None:
    """Solve, judge, compare."""
    parser = command_line(__doc__, ["drawn"], 5, "two seeds, no large cells")
    parser.add_argument("--only", choices=("drawn", "flexible"), help="one part of it")
    parser.add_argument("--file", action="append", default=[], help="instances of the benchmark")
    parser.add_argument("--seconds", type=float, default=120.0, help="of processor time")
    arguments = parser.parse_args()
    seeds = 2 if arguments.quick else arguments.seeds
    seconds = min(arguments.seconds, 20.0) if arguments.quick else arguments.seconds
    rows: list[Row | FlexibleRow] = []
    claims: list[Claim] = []
    if arguments.only != "drawn":
        flexible = flexible_row()
        print(line_of(asdict(flexible)), flush=True)
        claims += flexible_claims(flexible)
        rows.append(flexible)
    if arguments.only != "flexible":
        solved = drawn_rows(arguments, seeds, seconds)
        claims += drawn_claims(solved)
        rows += solved
    finish(arguments.json, [asdict(row) for row in rows], claims)


def flexible_row() -> FlexibleRow:
    """The bundled cell, planned and held against the common cycle."""
    planner = Planner("flexible")
    begin = time.process_time()
    plan = planner.plan_steady_cycle(parts_per_hour=PARTS_PER_HOUR)
    seconds = time.process_time() - begin
    saving = planner.plan_steady_cycle(parts_per_hour=PARTS_PER_HOUR, saving=True).saving
    return FlexibleRow(
        "flexible",
        plan.cycle.period,
        saving.joules,
        plan.gap,
        saving.common_period,
        saving.common,
        saving.on_motors,
        saving.low,
        saving.high,
        plan.program.report.certified,
        seconds,
    )


def flexible_claims(row: FlexibleRow) -> list[Claim]:
    """At the throughput, certified, soon, and what is saved is sure."""
    saved = 100.0 * (row.common - row.joules) / row.common
    return [
        at_most("flexible: period", row.period, "s", 3600.0 / PARTS_PER_HOUR),
        at_most("flexible: movements that aren't certified", not row.certified, "", 0),
        at_most("flexible: gap", row.gap, "%", 1.0),
        at_least("flexible: saved against the common cycle", saved, "%", 0.0),
        at_least("flexible: low end of what is saved", row.low, "J", 0.0),
        at_most("flexible: processor time", row.seconds, "s", 30.0),
    ]


def drawn_rows(arguments: argparse.Namespace, seeds: int, seconds: float) -> list[Row]:
    """Drawn cells and files."""
    rows = []
    for text, peer in texts(seeds, arguments.file, large=not arguments.quick):
        for element, instance in zip(ET.fromstring(text), instances(text), strict=True):
            rows.append(row_of(element, solve_cell(instance, seconds), seconds, peer=peer))
            print(line_of(asdict(rows[-1])), flush=True)
    return rows


def drawn_claims(rows: list[Row]) -> list[Claim]:
    """Valid, proved, and sooner than the published model."""
    small = [row for row in rows if np.isfinite(row.published_seconds)]
    large = [row for row in rows if not np.isfinite(row.published_seconds)]
    ratio = np.median([r.seconds for r in small]) / np.median([r.published_seconds for r in small])
    claims = [
        at_most("schedules with a fault", sum(row.faults > 0 for row in rows), "", 0),
        at_least("proved, small cells", 100.0 * np.mean([r.gap == 0.0 for r in small]), "%", 100.0),
        at_most("median processor time over the published model's", ratio, "", 0.2),
    ]
    if large:
        claims.append(at_most("largest gap, large cells", max(r.gap for r in large), "%", 5.0))
    return claims


def texts(seeds: int, files: list[str], *, large: bool) -> Iterator[tuple[str, bool]]:
    """Datasets as text, and whether the published model is asked too."""
    for robots, stops in SIZES:
        yield written([drawn(robots, stops, seed) for seed in range(seeds)]), True
    for file in files:
        yield Path(file).read_text(encoding="utf-8"), True
    for robots, stops in LARGE if large else ():
        yield written([drawn(robots, stops, seed, conflicts=40) for seed in range(2)]), False


def instances(text: str) -> list:
    path = Path("out/cells.xml")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return read_instances(path)


def row_of(element: ET.Element, answer: CellAnswer, seconds: float, *, peer: bool) -> Row:
    schedule = [
        (d.activity, d.choice, d.mode, d.start, d.duration)
        for robot in (answer.schedule.robots if answer.schedule else ())
        for d in robot
    ]
    found = faults(element, schedule)
    if schedule and abs(energy(element, schedule) - answer.energy) > 1e-6 * answer.energy:
        found.append("its energy is another")
    published = published_seconds = np.nan
    if peer:
        begin = time.process_time()
        published = PublishedModel(answer.instance).solve(seconds).cost
        published_seconds = time.process_time() - begin
    return Row(
        element.findtext("name") or answer.instance.name,
        len(answer.instance.robots),
        answer.energy,
        100.0 * answer.gap,
        len(found),
        answer.seconds,
        published,
        published_seconds,
    )


if __name__ == "__main__":
    main()
