"""Is the cheapest cycle of a robotic cell found and proved, and how soon?

    python benchmarks/cells.py [--file FILE.xml]... [--seeds N] [--seconds S] [--quick]
                               [--json FILE]

Cells drawn at random that have a schedule by construction, and instances of the public benchmark
where --file names them. Each is solved by the project's model and by the published one, in the same
solver and invocation, each with as many seconds of processor time; a judge that knows only the file
checks every schedule and its energy. The laws: every schedule is valid, costs what it says, and is
proved; the published model, with its ten segments per curve, never proves a bound above it.
"""

from __future__ import annotations

import time
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from _cells_drawn import drawn
from _cells_judge import energy, faults
from _cells_published import PublishedModel
from _results import at_least, at_most, command_line, finish, line_of

from ir_studies.cells import CellAnswer, read_instances, solve_cell, written

SIZES = ((2, 6), (3, 6), (3, 9))  # robots and stops of each
LARGE = ((5, 10), (8, 10))


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


def main() -> None:
    """Solve, judge, compare."""
    parser = command_line(__doc__, ["drawn"], 5, "two seeds, no large cells")
    parser.add_argument("--file", action="append", default=[], help="instances of the benchmark")
    parser.add_argument("--seconds", type=float, default=120.0, help="of processor time")
    arguments = parser.parse_args()
    seeds = 2 if arguments.quick else arguments.seeds
    seconds = min(arguments.seconds, 20.0) if arguments.quick else arguments.seconds
    rows = []
    for text, peer in texts(seeds, arguments.file, large=not arguments.quick):
        for element, instance in zip(ET.fromstring(text), instances(text), strict=True):
            rows.append(row_of(element, solve_cell(instance, seconds), seconds, peer=peer))
            print(line_of(asdict(rows[-1])), flush=True)
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
    finish(arguments.json, [asdict(row) for row in rows], claims)


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
