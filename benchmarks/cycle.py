"""What does a program cost over its cycle time, and what does it save against the common program?

    python benchmarks/cycle.py [--cell FILE]... [--variants N] [--points N] [--rivals N] [--seeds N]
    [--quick]
                               [--json FILE]

The stations of a cell in turn and back to the posture park, without pauses. Cycle times from the
shortest to twice the free one; E is the mains energy over the whole cycle, the wait to its end
included. The law: a cycle that is d longer costs at most d of standing on motors more, and the
drive energy of the movements alone never rises while the wait at the end stays in its mode. Then
the planner has the time of the common program: synchronous S-curves at full speed through the same
stations, each in the configuration nearest to the last one. Variants are mirrored, turned and
jittered cells, by seed; those with a station that can't be reached any more are named and left out.
"""

from __future__ import annotations

import argparse
import itertools
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from _common_program import common_program
from _program_chains import CEILING, Chains
from _results import Claim, at_least, at_most, command_line, finish, line_of
from _variants import variant_files

from ir_msgs_py.options import PlanOptions
from ir_planner import Planner, RequestError
from ir_planner.settings import PlannerSettings

CELL = "demo"
VARIANTS = Path("out/variants")
MUCH = 10  # times the default work
SAME = 1e-2  # s: what a cycle may end before its time
TOLERANCE = 1e-3  # of E: what two plans may differ by although the law holds


@dataclass(frozen=True)
class Row:
    """One program: cycle time [s], mains energy over the cycle [J], drive energy of its movements
    [J], mode of the wait at its end ("": on motors, or none), stated gap [%], processor seconds of
    planning.
    """

    cell: str
    seed: int
    what: str
    cycle: float
    energy: float
    drive_energy: float
    certified: bool
    wait: str
    gap: float
    planning_s: float


class Programs:
    """Programs of one cell through all of its stations."""

    def __init__(self, cell: str, seed: int, work: int = 1) -> None:
        self.cell = cell
        self.seed = seed
        default = PlannerSettings()
        most = work * default.max_iterations
        improvement = work * default.improvement_iterations
        settings = replace(default, max_iterations=most, improvement_iterations=improvement)
        self.planner = Planner(cell, clock=time.monotonic, settings=settings)
        self.stops = (*(station.name for station in self.planner.cell.stations), "park")
        self.start = np.array(self.planner.cell.park)

    def options(self, objective: str = "energy") -> PlanOptions:
        """A request under a ceiling that work never reaches."""
        return PlanOptions(objective=objective, seed=self.seed, planning_time=CEILING)

    def planned(self, what: str, cycle: float, objective: str = "energy") -> Row:
        """The program in a cycle time [s], 0: free. A refused one costs nan."""
        begin = time.process_time()
        try:
            plan = self.planner.plan_program(
                stations=self.stops,
                cycle_time=cycle,
                options=self.options(objective),
                start=self.start,
            )
        except RequestError:
            plan = None
        if plan is None or not plan.status.ok:
            return Row(
                self.cell, self.seed, what, cycle, float("nan"), float("nan"), False, "", 0.0, 0.0
            )
        took = time.process_time() - begin
        reports = [movement.report for movement in plan.movements if not movement.is_pause]
        drives = sum(report.energy - report.base_energy for report in reports)
        certified = bool(reports) and all(report.certified for report in reports)
        lasting = sum(movement.duration for movement in plan.movements)
        wait = plan.movements[-1].power_mode.replace("STAND_ON_MOTORS", "")
        return Row(
            self.cell,
            self.seed,
            what,
            lasting,
            plan.report.energy,
            drives,
            certified,
            wait,
            plan.gap,
            took,
        )

    def over_cycle_times(self, points: int) -> list[Row]:
        """From the shortest cycle to twice the free one."""
        shortest = self.planned("shortest", 0.0, "time")
        free = self.planned("free", 0.0, "time_and_energy")
        cycles = np.linspace(1.01 * shortest.cycle, 2.0 * free.cycle, points)
        return [self.planned("cycle", float(cycle)) for cycle in cycles]

    def against_common(self) -> tuple[list[Row], float]:
        """The common program and the planner's in the same time, and the share of segments not
        free.
        """
        chains = Chains.of(self.planner, self.stops, self.start, self.options(), {})
        common = common_program(chains, self.planner, self.options())
        base = self.planner.scene().base_watts * common.duration
        E = common.drive_energy
        plain = Row(
            self.cell, self.seed, "common", common.duration, E + base, E, True, "", 0.0, 0.0
        )
        return [plain, self.planned("at the common time", common.duration)], common.not_free

    @property
    def waiting(self) -> float:
        """Mains power [W] of standing on motors at the end."""
        return self.planner.standby(60.0, q=self.start).alternatives[0].power


def rivals_of(rows: list[Row], count: int) -> list[Row]:
    """The programs of the same cycle times with other seeds and ten times the work."""
    found = []
    for k in range(1, count + 1):
        programs = Programs(rows[0].cell, rows[0].seed + k, MUCH)
        found += [programs.planned("rival", row.cycle) for row in rows if np.isfinite(row.cycle)]
    return found


def above_best(rows: list[Row], rivals: list[Row]) -> float:
    """By how much [%] the dearest row lies above the best known program of its cycle time."""
    worst = 0.0
    for row in rows:
        same = [
            r.energy
            for r in (row, *rivals)
            if abs(r.cycle - row.cycle) < SAME and np.isfinite(r.energy)
        ]
        worst = max(worst, 100.0 * (row.energy / min(same) - 1.0)) if same else worst
    return worst


def excess(rows: list[Row], waiting: float) -> tuple[float, float]:
    """By how much [%] the law and the fall of the drive energy (in one mode of waiting) are missed
    at worst, from point to point.
    """
    law = [-100.0]
    rise = [-100.0]
    for before, after in itertools.pairwise([row for row in rows if np.isfinite(row.energy)]):
        allowed = before.energy + waiting * (after.cycle - before.cycle)
        law.append(100.0 * (after.energy / allowed - 1.0))
        if before.wait == after.wait:
            rise.append(100.0 * (after.drive_energy / before.drive_energy - 1.0))
    return max(law), max(rise)


def claims_of(
    cell: str, rows: list[Row], pair: list[Row], waiting: float, not_free: float
) -> list[Claim]:
    """What one cell is held to."""
    law, rise = excess(rows, waiting)
    refused = sum(not np.isfinite(row.energy) for row in rows)
    uncertified = sum(not row.certified for row in rows if np.isfinite(row.energy))
    drives = 100.0 * (1.0 - pair[1].drive_energy / pair[0].drive_energy)
    mains = 100.0 * (1.0 - pair[1].energy / pair[0].energy)
    bound = 100.0 * TOLERANCE
    seconds = float(np.median([row.planning_s for row in rows]))
    return [
        at_most(f"{cell}: cycle times that are refused, of {len(rows)}", refused, "", 0),
        at_most(f"{cell}: programs with a movement that is not certified", uncertified, "", 0),
        at_most(f"{cell}: E(T + d) above E(T) + P_wait d, worst", law, "%", bound),
        at_most(
            f"{cell}: rise of the movements' drive energy while the wait keeps its mode",
            rise,
            "%",
            0.5,
        ),
        at_most(
            f"{cell}: processor seconds of a request with a cycle time, median", seconds, "s", 6.0
        ),
        at_least(f"{cell}: drive energy saved against the common program", drives, "%", 20.0),
        at_least(f"{cell}: mains energy saved against the common program", mains, "%", 0.0),
        at_most(
            f"{cell}: segments of the common program that are not free", 100 * not_free, "%", 100.0
        ),
    ]


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, (CELL,), 1, "3 cycle times, 1 rival")
    parser.add_argument(
        "--rivals", type=int, default=20, help="seeds with ten times the work; default: 20"
    )
    parser.add_argument("--points", type=int, default=12, help="cycle times; default: 12")
    parser.add_argument("--variants", type=int, default=0, help="of each cell besides; default: 0")
    given = parser.parse_args()
    if given.quick:
        given.points, given.rivals = min(given.points, 3), min(given.rivals, 1)
    return given


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    rows: list[Row] = []
    claims: list[Claim] = []
    cells = given.cell or [CELL]
    for cell in [*cells, *variant_files(cells, given.variants, 0, VARIANTS)]:
        for seed in range(given.seeds):
            programs = Programs(cell, seed)
            if cell not in cells and not programs.planned("free", 0.0).certified:
                print(f"{cell}: no program visits all stations: left out", flush=True)
                continue
            points = programs.over_cycle_times(given.points)
            pair, not_free = programs.against_common()
            rivals = rivals_of(points, given.rivals)
            for row in (*points, *rivals, *pair):
                print(line_of(asdict(row)), flush=True)
            rows += [*points, *rivals, *pair]
            claims += claims_of(cell, points, pair, programs.waiting, not_free)
            name = (
                f"{cell}: energy above the best of {given.rivals} seeds with ten times the "
                "work, worst"
            )
            claims.append(at_most(name, above_best(points, rivals), "%", 2.0))
    finish(given.json, [asdict(row) for row in rows], claims)


if __name__ == "__main__":
    main()
