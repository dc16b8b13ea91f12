"""Is the cheapest cycle of a robotic cell found and proved, and how soon?

    python benchmarks/cells.py [--only drawn|large|files|steady|flexible|driven|robots]
                               [--file FILE.xml]... [--energies TABLE.md] [--published S]
                               [--seeds N] [--seconds S] [--part K/N] [--quick] [--json FILE]

drawn: cells drawn at random that have a schedule by construction. files: instances of the public
benchmark that --file names. Each is solved by the project's model and by the published one, in the
same solver and invocation, each with as many seconds of processor time (--published: other seconds
for the published one, 0 leaves it out); a judge that knows only the file checks every schedule and
its energy. The laws: every schedule is valid, costs what it says, and is proved; the published
model, with its ten segments per curve, never proves a bound above it. --energies: a table in
Markdown with columns "instance" and "least energy J", above which no schedule may be.

large: drawn cells of 5, 8 and 12 robots by the project's model alone, 5 robots for two minutes,
more for ten: seconds to the first schedule, and the gap at the end.

steady: drawn cells of one robot that tends up to six machines, cycles of one and of two parts, a
minute of processor time for each; up to four machines beside brute force over all orders and modes.

flexible: the bundled cell of that name at 30 parts an hour, with what is saved against the common
cycle of the same order, which moves at 100 % and leaves waits to the controller's own timers.

robots: drawn cells of two robots, each joint cycle driven with drawn delays of every step, and the
bundled cell. A judge that knows the programs with their signals alone measures with Coal, at every
0.5 ms where the robots are near; a planted collision, the same without signals, is found. --part
2/5: the second fifth of the drawn cells and of the schedules that are asked for.

driven: that cycle from an empty line on, on the simulated robot (nominal plant) with simulated
machines by the program runner's own steps: every part needs what was planned within 1 % or 10 J.
"""

from __future__ import annotations

import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from _cells_drawn import drawn
from _cells_judge import energy, faults
from _cells_published import PublishedModel
from _results import Claim, at_least, at_most, command_line, finish, line_of
from _robots_judge import Judge, drawn_cell, driven
from _steady_judge import drawn as drawn_machines
from _steady_judge import least_by_orders

from ir_description import RobotCells, load_robot_cells
from ir_planner import Planner, ProgramPlan, RequestError
from ir_planner.cycle import SteadyProblem, cheapest_cycle, fastest_cycle
from ir_planner.robots import RobotsPlan, plan_robots
from ir_recorder.analysis.tending import tending_of
from ir_studies.cells import CellAnswer, read_instances, solve_cell, written
from ir_studies.stepped_run import driven_program

PARTS = ("drawn", "large", "files", "steady", "flexible", "driven", "robots")
SIZES = ((2, 6), (3, 6), (3, 9))  # robots and stops of each
LARGE = ((5, 14, 120.0, 1.0), (8, 14, 600.0, 5.0), (12, 14, 600.0, 5.0))
"""Robots, stops of each, seconds of processor time, and the gap [%] within them."""
DENSE = 3  # hand-overs between neighbours in large cells
FIRST_SECONDS = 60.0  # of processor time, to a first schedule of a large cell
ENERGY = 1e-5  # relative: what a schedule may be above a listed energy
PARTS_PER_HOUR = 30.0
CYCLES = 4
MACHINES = 6
STEADY_SECONDS = 60.0  # of processor time for a cycle
PERIODS = (1.02, 1.3)  # times the shortest
BRUTE = 4  # machines of which all orders are tried


@dataclass(frozen=True)
class Row:
    """An instance: energy [J], gap [%], faults by the judge, processor seconds and those to the
    first schedule, the published model's.
    """

    name: str
    robots: int
    energy: float
    gap: float
    faults: int
    seconds: float
    first_seconds: float
    published: float
    published_seconds: float


@dataclass(frozen=True)
class SteadyRow:
    """A drawn cell of one robot: most seconds a part, joules of the cycle, gap [%], those of brute
    force (nan: too many orders), processor seconds of the cheapest cycle.
    """

    machines: int
    units: int
    seed: int
    period: float
    joules: float
    gap: float
    brute: float
    seconds: float


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


MARGIN = 0.02  # m that robots keep
SCHEDULES = 5  # of each drawn cell


@dataclass(frozen=True)
class RobotsRow:
    """Joint cycles: zones; period [s]; joules, and those at full speed on motors; gap [%]; the
    least distance [m] over all driven schedules, and without signals the first one that is too
    small; processor seconds of planning, and of driving and judging. refused: why there is none.
    """

    name: str
    schedules: int = 0
    zones: int = 0
    period: float = np.nan
    joules: float = np.nan
    full_speed: float = np.nan
    gap: float = np.nan
    nearest: float = np.inf
    without_signals: float = np.inf
    seconds: float = np.nan
    judging_seconds: float = np.nan
    refused: str = ""


@dataclass(frozen=True)
class DrivenRow:
    """A part of the driven cycle: seconds and joules, planned beside driven; late [s]: waits for
    signals that no plan contains.
    """

    part: int
    filling: bool
    seconds: float
    planned_seconds: float
    joules: float
    planned: float
    late: float


def main() -> None:
    """Solve, judge, compare."""
    parser = command_line(__doc__, ["drawn"], 5, "two seeds, no large cells")
    parser.add_argument("--only", choices=PARTS, help="one part of it")
    parser.add_argument("--file", action="append", default=[], help="instances of the benchmark")
    parser.add_argument("--energies", type=Path, help="table of the least energies of instances")
    parser.add_argument("--seconds", type=float, default=120.0, help="of processor time")
    parser.add_argument(
        "--published", type=float, help="seconds of the published model, default: --seconds"
    )
    parser.add_argument("--part", default="1/1", metavar="K/N", help="of the cells of robots")
    arguments = parser.parse_args()
    seeds = 2 if arguments.quick else arguments.seeds
    seconds = min(arguments.seconds, 20.0) if arguments.quick else arguments.seconds
    rows: list[Row | SteadyRow | FlexibleRow | DrivenRow | RobotsRow] = []
    claims: list[Claim] = []
    if arguments.only in (None, "robots"):
        part, parts = map(int, arguments.part.split("/"))
        robots = list(robots_rows(range(-1, 4 if arguments.quick else 30)[part - 1 :: parts]))
        claims += robots_claims(robots, (6 if arguments.quick else 100) // parts)
        rows += robots
    if arguments.only in (None, "steady"):
        steady = list(steady_rows(1 if arguments.quick else 3))
        claims += steady_claims(steady)
        rows += steady
    if arguments.only in (None, "flexible"):
        flexible = flexible_row()
        print(line_of(asdict(flexible)), flush=True)
        claims += flexible_claims(flexible)
        rows.append(flexible)
    if arguments.only in (None, "driven"):
        parts = driven_rows()
        claims += driven_claims(parts)
        rows += parts
    asked = seconds if arguments.published is None else arguments.published
    if arguments.only in (None, "drawn"):
        solved = list(instance_rows(drawn_files(seeds), seconds, asked))
        claims += small_claims("drawn", solved)
        rows += solved
    if arguments.only in (None, "files") and arguments.file:
        solved = list(instance_rows(map(Path, arguments.file), seconds, asked))
        listed = energies(arguments.energies) if arguments.energies else {}
        claims += [*small_claims("files", solved), *energy_claims(solved, listed)]
        rows += solved
    if arguments.only == "large" or (arguments.only is None and not arguments.quick):
        for count, stops, most, gap in LARGE:
            path = drawn_file(count, stops, 2, conflicts=8 * count, handovers=DENSE)
            solved = list(instance_rows([path], most, 0.0))
            claims += large_claims(count, solved, gap)
            rows += solved
    finish(arguments.json, [asdict(row) for row in rows], claims)


def robots_rows(seeds: Iterable[int]) -> Iterator[RobotsRow]:
    """Drawn cells, and the bundled one for -1."""
    for seed in seeds:
        name = "two_robots" if seed < 0 else f"drawn {seed}"
        row = robots_row(name, robot_cells(seed))
        print(line_of(asdict(row)), flush=True)
        yield row


def robot_cells(seed: int) -> RobotCells:
    """The bundled cell, or the one drawn from a seed of 0 or more."""
    if seed < 0:
        cells = load_robot_cells("two_robots")
    else:
        path = Path("out/robots.yaml")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(drawn_cell(seed), encoding="utf-8")
        cells = load_robot_cells(path)
    assert cells is not None
    return cells


def robots_row(name: str, cells: RobotCells) -> RobotsRow:
    """Plan, and drive with delays."""
    begin = time.process_time()
    try:
        plan = plan_robots(cells)
    except RequestError as error:
        return RobotsRow(name, refused=str(error))
    seconds = time.process_time() - begin
    if not plan.programs:
        return RobotsRow(name, refused=plan.status.message)
    planted = replace(plan, programs=tuple(map(unsignalled, plan.programs)))
    near = nearest(plan, cells, 0.4)
    without_signals = nearest(planted, cells, 1.5, first=True) if plan.zones else np.inf
    return RobotsRow(
        name,
        SCHEDULES,
        len(plan.zones),
        plan.period,
        plan.joules,
        plan.full_speed,
        plan.gap,
        near,
        without_signals,
        seconds,
        time.process_time() - begin - seconds,
    )


def unsignalled(program: ProgramPlan) -> ProgramPlan:
    """The program whose steps wait for nobody."""
    steps = (replace(step, wait_for=(), set_signals=()) for step in program.movements)
    return replace(program, movements=tuple(steps))


def nearest(plan: RobotsPlan, cells: RobotCells, delay: float, *, first: bool = False) -> float:
    """The least distance [m] over schedules with drawn delays, in each up to `delay` s longer;
    first: the first one below the margin is enough.
    """
    judge = Judge((cells.cells[0], cells.cells[1]))
    best = np.inf
    for seed in range(SCHEDULES):
        pieces = driven(plan, np.random.default_rng(seed), 2, delay=delay * seed)
        best = min(best, judge.least(pieces, MARGIN, first=first)[0])
        if first and best < MARGIN:
            break
    return best


def robots_claims(rows: list[RobotsRow], schedules: int) -> list[Claim]:
    """None comes too near, and where signals are taken away some do."""
    planned = [row for row in rows if not row.refused]
    zoned = [row for row in planned if row.zones]
    near = sum(row.nearest < MARGIN - 1e-5 for row in planned)
    planted = sum(row.without_signals < MARGIN for row in zoned)
    return [
        at_least("robots: schedules driven", sum(row.schedules for row in planned), "", schedules),
        at_most("robots: cells with a pair nearer than S_m", near, "", 0),
        at_least("robots: cells in which planted collisions are found", planted, "", 1),
        at_most("robots: largest gap", max(row.gap for row in planned), "%", 5.0),
    ]


def steady_rows(seeds: int) -> Iterator[SteadyRow]:
    """Drawn machines, 2 and 30 % above the period of the shortest cycle."""
    for machines in range(2, MACHINES + 1):
        for seed in range(seeds):
            problem = drawn_machines(seed, machines, 3)
            fastest = fastest_cycle(problem)
            assert fastest is not None
            for over in PERIODS:
                yield from steady_pair(problem, machines, seed, over * fastest.period)


def steady_pair(
    problem: SteadyProblem, machines: int, seed: int, period: float
) -> Iterator[SteadyRow]:
    """The cheapest cycles of one and of two parts within a period a part [s]."""
    brute = least_by_orders(problem, period) if machines <= BRUTE else np.nan
    for units in (1, 2):
        begin = time.process_time()
        cycle = cheapest_cycle(problem, period=period, units=units, stopped=_late(begin))
        seconds = time.process_time() - begin
        joules = np.nan if cycle is None else cycle.joules
        gap = 100.0 if cycle is None else 100.0 * (joules - cycle.bound) / joules
        known = brute if units == 1 else np.nan
        row = SteadyRow(machines, units, seed, period, joules, gap, known, seconds)
        print(line_of(asdict(row)), flush=True)
        yield row


def _late(begin: float) -> Callable[[], bool]:
    """Whether the processor time of a cycle is over."""
    return lambda: time.process_time() - begin > STEADY_SECONDS


def steady_claims(rows: list[SteadyRow]) -> list[Claim]:
    """Exact within the time of each, and what brute force finds."""
    off = [abs(row.joules - row.brute) / row.brute for row in rows if np.isfinite(row.brute)]
    return [
        at_least("steady: machines of the largest cell", max(r.machines for r in rows), "", 6),
        *(
            at_most(
                f"steady: largest gap of cycles of {units}",
                max(row.gap for row in rows if row.units == units),
                "%",
                1e-3,
            )
            for units in (1, 2)
        ),
        at_most("steady: joules off brute force", 100.0 * max(off), "%", 0.5),
        at_most(
            "steady: processor time of a cycle", max(r.seconds for r in rows), "s", STEADY_SECONDS
        ),
    ]


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


def driven_rows() -> list[DrivenRow]:
    """The bundled cell from an empty line on, driven by the nominal plant."""
    plan = Planner("flexible").plan_steady_cycle(parts_per_hour=PARTS_PER_HOUR, cycles=CYCLES)
    run = driven_program(plan.run_cell, plan.run.movements)
    run.close()
    tending = tending_of(plan.run_cell, run.steps, run.signals)
    rows = []
    for part in tending.parts:
        row = DrivenRow(
            part.number,
            part.number <= tending.filling,
            part.span.seconds,
            part.planned_seconds,
            part.joules,
            part.planned_joules,
            sum(part.late.values()),
        )
        print(line_of(asdict(row)), flush=True)
        rows.append(row)
    return rows


def driven_claims(rows: list[DrivenRow]) -> list[Claim]:
    """Every part as planned, and nobody late."""
    off = [abs(row.joules - row.planned) / max(10.0, 0.01 * row.planned) for row in rows]
    slow = max(row.seconds - row.planned_seconds for row in rows)
    return [
        at_least("driven: parts", len(rows), "", CYCLES),
        at_most("driven: joules of a part off the plan, of 1 % or 10 J", max(off), "", 1.0),
        at_most("driven: a part later than planned", slow, "s", 0.5),
    ]


def instance_rows(paths: Iterable[Path], seconds: float, published: float) -> Iterator[Row]:
    """Every instance of some files, each with so many seconds of processor time."""
    for path in paths:
        elements = ET.parse(path).getroot().findall("instance")  # a data set may have a name, too
        for element, instance in zip(elements, read_instances(path), strict=True):
            row = row_of(element, solve_cell(instance, seconds), published)
            print(line_of(asdict(row)), flush=True)
            yield row


def small_claims(name: str, rows: list[Row]) -> list[Claim]:
    """Valid, proved, and sooner than the published model."""
    proved = 100.0 * np.mean([row.gap == 0.0 for row in rows])
    claims = [
        at_most(f"{name}: schedules with a fault", sum(row.faults > 0 for row in rows), "", 0),
        at_least(f"{name}: proved", proved, "%", 100.0),
    ]
    peers = [row for row in rows if np.isfinite(row.published_seconds)]
    if peers:
        seconds = np.median([row.seconds for row in peers])
        ratio = seconds / np.median([row.published_seconds for row in peers])
        claims.append(
            at_most(f"{name}: median processor time over the published model's", ratio, "", 0.2)
        )
    return claims


def energy_claims(rows: list[Row], listed: dict[str, float]) -> list[Claim]:
    """None above what is listed."""
    over = [row.energy / listed[row.name] - 1.0 for row in rows if row.name in listed]
    if not over:
        return []
    return [
        at_least("files: energies listed", len(over), "", 1),
        at_most("files: energy above the listed one, relative", max(over), "", ENERGY),
    ]


def energies(path: Path) -> dict[str, float]:
    """Least energies [J] by instance, of a table in Markdown."""
    rows = [
        [cell.strip() for cell in line.strip().strip("|").split("|")]
        for line in path.read_text(encoding="utf-8").splitlines()
        if line.lstrip().startswith("|")
    ]
    name = rows[0].index("instance")
    joules = rows[0].index("least energy J")
    return {row[name]: float(row[joules]) for row in rows[2:]}


def large_claims(robots: int, rows: list[Row], gap: float) -> list[Claim]:
    """Valid, a schedule soon, and near the least energy."""
    name = f"{robots} robots"
    faults = sum(row.faults > 0 for row in rows)
    first = max(row.first_seconds for row in rows)
    return [
        at_most(f"{name}: schedules with a fault", faults, "", 0),
        at_most(f"{name}: processor time to a schedule", first, "s", FIRST_SECONDS),
        at_most(f"{name}: largest gap", max(row.gap for row in rows), "%", gap),
    ]


def drawn_files(seeds: int) -> Iterator[Path]:
    """Small data sets."""
    for robots, stops in SIZES:
        yield drawn_file(robots, stops, seeds, conflicts=12, handovers=1)


def drawn_file(robots: int, stops: int, seeds: int, *, conflicts: int, handovers: int) -> Path:
    """Drawn cells, in a file."""
    path = Path(f"out/drawn_{robots}_{stops}.xml")
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn_cells = [drawn(robots, stops, seed, conflicts, handovers) for seed in range(seeds)]
    path.write_text(written(drawn_cells), encoding="utf-8")
    return path


def row_of(element: ET.Element, answer: CellAnswer, seconds: float) -> Row:
    """Judged; seconds: of the published model, 0: it isn't asked."""
    schedule = [
        (d.activity, d.choice, d.mode, d.start, d.duration)
        for robot in (answer.schedule.robots if answer.schedule else ())
        for d in robot
    ]
    found = faults(element, schedule) if schedule else []
    if schedule and abs(energy(element, schedule) - answer.energy) > 1e-6 * answer.energy:
        found.append("its energy is another")
    published = np.nan
    published_seconds = np.nan
    if seconds > 0.0:
        begin = time.process_time()
        published = PublishedModel(answer.instance).solve(seconds).cost
        published_seconds = time.process_time() - begin
    return Row(
        answer.instance.name,
        len(answer.instance.robots),
        answer.energy,
        100.0 * answer.gap,
        len(found),
        answer.seconds,
        answer.first_seconds,
        published,
        published_seconds,
    )


if __name__ == "__main__":
    main()
