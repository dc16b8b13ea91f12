"""Does a program go through the best configurations, and how far is it from the best where it does
not?

    python benchmarks/program.py [--cell FILE]... [--instances N] [--seeds N] [--quick] [--json
    FILE]

Small programs are drawn by seed: 3 to 6 stops of a cell, with its tool and without. Each is planned
for J (drive energy + 500 W x T) and for W of eq. (9). Beside it stand all chains of the same
configurations, every edge at the cost that the planner finds for it (edges that cannot belong to a
cheaper chain by an exact lower bound are left out). "answer": cost of the movements of the answer
over the best chain's; "chain": cost of its configurations with the same edges, over the best's.

Then the demonstration's own program is driven by the simulated robot on the nominal plant, without
real time: every movement and pause, and the whole, against what was planned.
"""

from __future__ import annotations

import argparse
import itertools
import time
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

import numpy as np
from _program_chains import CEILING, Chains, EdgeCosts, cost_of
from _regional_tasks import SHARE_OF_ENDS, scene_of
from _results import Claim, at_least, at_most, command_line, finish, line_of
from _service_stations import margin_at

from ir_description import Cell, cell_to_yaml, load_cell
from ir_msgs_py.announcements import Event
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_planner import Planner, ProgramPlan
from ir_planner.program.request import StageError
from ir_program_runner import Program, ProgramSettings
from ir_program_runner import requests as ask
from ir_sim_driver import TrajectoryGoal, make_simulation
from ir_sim_driver.plant import carried
from ir_values.arrays import FloatArray

# A planned program on the simulated robot, as the program runner drives it, without real time:
# what every step takes beside what was planned.

PLANT = "nominal"  # every term that the planner's model lacks is zero
# of a step, whichever is larger
SHARE = 0.03
JOULES = 20.0
TOTAL = 1.0  # % of the program


@dataclass(frozen=True)
class Step:
    """A step of the program [s], its energy as planned and as the plant took it [J]."""

    cell: str
    number: int
    kind: str
    to: str
    mode: str
    duration: float
    planned: float
    simulated: float

    @property
    def share_of_bound(self) -> float:
        """How far the step is off, of what is allowed."""
        return abs(self.simulated - self.planned) / max(JOULES, SHARE * self.planned)


class Robot:
    """A stepped robot that fulfils a program's requests. took: joules of each step by its
    number.
    """

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self.plant = make_simulation(cell, plant=PLANT)
        self.plant.backend.reset(np.array(cell.park))
        self.plant.executor.hold(np.array(cell.park))
        self.begun: dict[int, float] = {}
        self.took: dict[int, float] = {}

    def run(self, movements: tuple[PlannedMovement, ...]) -> Status:
        """Drive them all; how that ended."""
        steps = Program(movements, ProgramSettings()).run()
        answer: tuple[Status, tuple[Any, ...]] | None = None
        while True:
            try:
                request = next(steps) if answer is None else steps.send(self._outcome(*answer))
            except StopIteration as ended:
                status: Status = ended.value.status
                return status
            answer = self._fulfilled(request)

    def _outcome(self, status: Status, modes: tuple[Any, ...]) -> ask.RequestOutcome:
        plant = self.plant
        return ask.RequestOutcome(plant.time, plant.modes.mode, status, modes, plant.mains.energy())

    def _fulfilled(self, request: ask.Request) -> tuple[Status, tuple[Any, ...]]:  # noqa: C901
        plant = self.plant
        match request:
            case ask.Announce(index, event, _):
                energy = plant.mains.energy()
                if event is Event.STARTED:
                    self.begun[index] = energy
                else:
                    self.took[index] = energy - self.begun[index]
            case ask.SetPlcInput(name, value):
                plant.plc.set_bit(name, value)
            case ask.AskModes():
                return Status.success(), plant.pauses.query_modes()
            case ask.SendWakePacket():
                plant.wake()
            case ask.SetLoad(load):
                plant.set_load(carried(self.cell, load))
            case ask.WaitUntil(moment):
                plant.run(max(moment - plant.time, 0.0))
            case ask.WaitForMode(modes, timeout):
                return self._waited(modes, plant.time + timeout), ()
            case ask.Drive(trajectory, cell_hash, load):
                plant.execute(
                    plant.vet(TrajectoryGoal(trajectory, cell_hash=cell_hash, load=load), 0), 0
                )
                while not plant.take_outcomes():
                    plant.step()
        return Status.success(), ()

    def _waited(self, modes: Any, until: float) -> Status:
        while self.plant.modes.mode not in modes:
            if self.plant.time >= until:
                return Status(StatusCode.TIMED_OUT, "not in time")
            self.plant.step()
        return Status.success()


def driven(name: str, longest: float) -> tuple[list[Step], list[Claim]]:
    """The program of a cell, planned with the defaults and driven; its pauses are cut to `longest`
    s.
    """
    cell = load_cell(name)
    short = tuple(
        step if step.dwell <= longest else replace(step, dwell=longest, power_mode="AUTO")
        for step in cell.program
    )
    # no ceiling
    cell = replace(cell, program=short)
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    planner.set_cell(text=cell_to_yaml(cell))
    plan = planner.plan_program(start=np.array(cell.park))
    robot = Robot(cell)
    begun = robot.plant.mains.energy()
    ended = robot.run(plan.movements)
    total = robot.plant.mains.energy() - begun
    steps = [
        Step(
            name,
            k,
            str(m.kind),
            m.to_station,
            m.power_mode,
            m.duration,
            m.report.energy,
            robot.took[k],
        )
        for k, m in enumerate(plan.movements)
        if k in robot.took
    ]
    off = 100.0 * abs(total / plan.report.energy - 1.0)
    moves = [step.share_of_bound for step in steps if step.kind != MovementKind.PAUSE]
    pauses = [step.share_of_bound for step in steps if step.kind == MovementKind.PAUSE]
    what = f"{name} driven, {PLANT} plant"
    count = len(plan.movements)
    seconds = sum(step.duration for step in steps if step.kind == MovementKind.PAUSE)
    rests = f"{len(pauses)} pauses of {seconds:.0f} s in all"
    return steps, [
        at_most(
            f"{what}: steps that did not end, of {count}",
            count - len(steps) + (not ended.ok),
            "",
            0,
        ),
        at_most(f"{what}: {len(moves)} movements, worst of 3 % or 20 J", max(moves), "", 1.0),
        at_most(f"{what}: {rests}, worst of 3 % or 20 J", max(pauses, default=0.0), "", 1.0),
        at_most(f"{what}: energy of the program off the planned one", off, "%", TOTAL),
    ]


CELLS = ("demo", "open", "table_columns", "cnc_door", "deep_box")
OBJECTIVES = {"J": "time_and_energy", "W": "movement_cost"}
BOUND = 1.01  # of the best chain
ROUNDING = 1e-6  # %
STOPS = (3, 6)
# the cell whose program is driven; s: what --quick cuts its pauses to
DRIVEN = "demo"
QUICK_PAUSE = 30.0
CHAINS_S = 300.0  # ceiling of the search through all chains of one instance


@dataclass(frozen=True)
class Instance:
    """Stops in a cell, from the posture park; load: "" the tool, or none; margin: S_m [m]."""

    cell: str
    stops: tuple[str, ...]
    load: str
    margin: float


@dataclass(frozen=True)
class Row:
    """One program and objective; costs J or W, ratios to the best chain (inf: nothing found), the
    answer's own gap [%], seconds.
    """

    cell: str
    stops: str
    load: str
    objective: str
    chains: float
    edges: int
    proved: bool
    best: float
    answer: float
    chain: float
    gap: float
    planning_s: float
    chains_s: float

    @property
    def possible(self) -> bool:
        """Whether there is a chain, or the planner says that there is."""
        return bool(np.isfinite(self.best)) or not np.isfinite(self.chain)

    @property
    def gap_is_true(self) -> bool:
        """Whether the answer is no further above the best chain than it says."""
        return 100.0 * (1.0 - 1.0 / self.answer) <= self.gap + ROUNDING

    @property
    def near(self) -> bool:
        """Whether the configurations are those of the best chain, or as good."""
        return self.chain <= BOUND


@cache
def planner_of(cell: str) -> Planner:
    """A planner with the cell."""
    return Planner(cell)


def instances(cell: str, count: int, seed: int) -> list[Instance]:
    """Programs of a cell drawn by seed; the stops of a cell repeat with both loads."""
    scene = scene_of(cell)
    rng = np.random.default_rng([seed, *scene.cell.name.encode()])
    names = [station.name for station in scene.cell.stations]
    park = np.array(scene.cell.posture("park"))[None]
    margin = SHARE_OF_ENDS * float(scene.collision.min_distance(park).distance[0])
    margin = min(margin, *(margin_at(scene, station) for station in scene.cell.stations))
    found: list[Instance] = []
    while len(found) < count:
        stops: list[str] = []
        length = int(rng.integers(STOPS[0], STOPS[1] + 1))
        while len(stops) < length:
            name = str(rng.choice([*names, "park"]))
            if name != (stops[-1] if stops else "park"):
                stops.append(name)
        found += [Instance(cell, tuple(stops), load, margin) for load in ("", NO_LOAD)]
    return found[:count]


def compared(instance: Instance, objective: str, seed: int, known: EdgeCosts) -> Row:
    """The program as it is planned, beside all chains."""
    planner = planner_of(instance.cell)
    wanted = OBJECTIVES[objective]
    options = PlanOptions(
        seed=seed,
        planning_time=CEILING,
        safety_distance=instance.margin,
        objective=wanted,
        load=instance.load,
    )
    start = np.array(planner.cell.posture("park"))
    begin = time.perf_counter()
    plan = planner.plan_program(stations=instance.stops, options=options, start=start)
    planned = time.perf_counter()
    count = 0.0
    edges = 0
    proved = True
    best = float("inf")
    ratios = (1.0, 1.0)
    try:
        chains = Chains.of(planner, instance.stops, start, options, known)
        _, best, proved = chains.cheapest(lambda: time.perf_counter() > planned + CHAINS_S)
        count = chains.count
        edges = chains.edges
        ratios = _ratios(plan, chains, best, options)
    except StageError:
        ratios = (float("inf"), float("inf")) if plan.status.ok else ratios
    took = time.perf_counter() - planned
    stops = " ".join(instance.stops)
    load = instance.load or "tool"
    return Row(
        instance.cell,
        stops,
        load,
        objective,
        count,
        edges,
        proved,
        best,
        *ratios,
        plan.gap,
        planned - begin,
        took,
    )


def _ratios(
    plan: ProgramPlan, chains: Chains, best: float, options: PlanOptions
) -> tuple[float, float]:
    """Cost of the answer, and of its configurations, over the best chain's; 1 where neither found
    any.
    """
    if not plan.status.ok:
        return (float("inf"),) * 2 if np.isfinite(best) else (1.0, 1.0)
    answer = sum(cost_of(movement.report, options) for movement in plan.movements)
    along = chains.cost_along(chains.nearest(_stops(plan)))
    return answer / best, along / best


def _stops(plan: ProgramPlan) -> list[tuple[FloatArray, FloatArray]]:
    """Configuration (n,) at each stop, and where its line in begins: of an entry; or of a regional
    movement that no entry follows, which ends at both.
    """
    kinds = [str(movement.kind) for movement in plan.movements]
    ends = []
    for movement, following in zip(plan.movements, [*kinds[1:], ""], strict=True):
        entry = movement.kind == MovementKind.SERVICE_ENTRY
        last = movement.kind == MovementKind.REGIONAL and following != MovementKind.SERVICE_ENTRY
        if movement.trajectory is not None and (last or entry):
            q = movement.trajectory.positions
            ends.append((q[-1], q[0] if entry else q[-1]))
    return ends


def claims_of(rows: list[Row]) -> list[Claim]:
    """What the programs are held to, per objective."""
    claims = []
    for objective in OBJECTIVES:
        mine = [row for row in rows if row.objective == objective and row.possible]
        if not mine:
            continue
        near = 100.0 * sum(row.near for row in mine) / len(mine)
        name = f"{objective}: programs at most 1 % above the best chain, of {len(mine)}"
        worst = 100.0 * (max(row.chain for row in mine) - 1.0)
        answers = 100.0 * (max(row.answer for row in mine) - 1.0)
        untrue = sum(not row.gap_is_true for row in mine)
        claims += [
            at_least(name, near, "%", 100.0),
            at_most(f"{objective}: chosen chain above the best, worst", worst, "%", 1.0),
            at_most(f"{objective}: answer above the best chain, worst", answers, "%", 1.0),
            at_most(f"{objective}: stated gaps that are too small", untrue, "", 0),
        ]
    possible = sum(row.possible for row in rows) / len(OBJECTIVES)
    claims.append(at_least("instances that have a chain", possible, "", 30))
    unproved = sum(not row.proved for row in rows)
    claims.append(at_most("searches through all chains that were cut", unproved, "", 0))
    return claims


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, CELLS, 1, "2 programs of each cell, short pauses")
    parser.add_argument(
        "--instances", type=int, default=8, help="programs of each cell; default: 8"
    )
    given = parser.parse_args()
    if given.quick:
        given.instances = min(given.instances, 2)
    return given


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    rows: list[Row] = []
    for cell in given.cell or CELLS:
        for seed in range(given.seeds):
            known: EdgeCosts = {}
            for instance in instances(cell, given.instances, seed):
                for objective in OBJECTIVES:
                    rows.append(compared(instance, objective, seed, known))
                    print(line_of(asdict(rows[-1])), flush=True)
    steps, agreement = driven(DRIVEN, QUICK_PAUSE if given.quick else np.inf)
    for step in steps:
        print(line_of(asdict(step)), flush=True)
    written = [*(asdict(row) for row in rows), *(asdict(step) for step in steps)]
    finish(given.json, written, [*claims_of(rows), *agreement])


if __name__ == "__main__":
    main()
