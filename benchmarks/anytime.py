"""How soon is a program there, cut, and stopped?

    python benchmarks/anytime.py [--cell FILE]... [--seeds N] [--quick] [--json FILE]

The demonstration with what it saves, as a user gets it; and 20 stops in a cell whose joints A4 and
A6 turn so far that they have 8 configurations each or more. Then requests of three stops with
savings, with a front and
within a cycle time: what is spent beyond a planning_time of a third of what they take, and how long
the planner goes on at most after it was asked to stop. Processor seconds; "elapsed" is the clock's,
on all cores.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np
from _program_chains import CEILING
from _results import Claim, at_least, at_most, command_line, finish, line_of
from _scaling_cells import tour, with_turns

from ir_description import load_cell
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner, ProgramPlan, RequestError

CELLS = ("demo", "open")
LONG = 20  # stops
CONFIGURATIONS = 8  # per stop, at least, on average
FAR = np.radians(540.0)  # of A4 and A6, there and back
STOPS = 3
SHARE = 1.0 / 3.0  # of a request's own time, after which it is cut


@dataclass(frozen=True)
class Row:
    """One request: processor seconds, seconds elapsed, of that after planning_time, longest time
    between two looks at whether to stop (both processor seconds), mean configurations per stop.
    """

    cell: str
    asked: str
    processor_s: float
    elapsed_s: float
    beyond_s: float = 0.0
    unstoppable_s: float = 0.0
    configurations: float = 0.0


@dataclass(frozen=True)
class Request:
    """A program of a cell and what is asked of it."""

    asked: str
    stops: tuple[str, ...]
    cycle: float = 0.0
    savings: bool = False
    front_points: int = 0
    turns: bool = False


class Watch:
    """Asked whether to stop: never; remembers the longest time between two such questions."""

    def __init__(self) -> None:
        self.last = time.process_time()
        self.longest = 0.0

    def __call__(self) -> bool:
        """Go on."""
        now = time.process_time()
        self.longest = max(self.longest, now - self.last)
        self.last = now
        return False


def planner_of(name: str, clock: Callable[[], float], turns: bool = False) -> Planner:
    """A planner with a cell, its scene built. turns: A4 and A6 turn farther."""
    cell = with_turns(load_cell(name), FAR) if turns else load_cell(name)
    planner = Planner(
        clock=clock, read_cell=lambda *_: cell
    )  # the text of a cell doesn't say how far its robot turns
    planner.set_cell(name)
    planner.check_state(planner.cell.machine_home, safety_distance=0.0, max_pairs=1)
    return planner


def planned(
    planner: Planner, request: Request, seconds: float, seed: int, watch: Watch
) -> ProgramPlan | None:
    """The program under a ceiling [s] for all of its steps; None: refused."""
    stops = len(request.stops or planner.cell.program)
    options = PlanOptions(seed=seed, planning_time=seconds / stops)
    start = np.array(planner.cell.park)
    try:
        return planner.plan_program(
            stations=request.stops,
            cycle_time=request.cycle,
            options=options,
            start=start,
            cancelled=watch,
            front_points=request.front_points,
            savings=request.savings,
        )
    except RequestError:
        return None


def measured(cell: str, request: Request, seed: int) -> Row:
    """A request in full."""
    planner = planner_of(cell, time.monotonic, request.turns)
    begin = time.process_time()
    elapsed = time.monotonic()
    watch = Watch()
    plan = planned(planner, request, CEILING * LONG, seed, watch)
    took = time.process_time() - begin
    elapsed = time.monotonic() - elapsed
    assert plan is not None
    assert plan.status.ok, plan.status.message
    found = next(stage for stage in plan.info.stages if stage.name == "configurations")
    layers = found.note.split(" x ")[1:]
    return Row(
        cell,
        request.asked,
        took,
        elapsed,
        0.0,
        watch.longest,
        float(np.mean([int(n) for n in layers])),
    )


def cut(cell: str, request: Request, seed: int) -> Row:
    """A request on one core: how long it is not stopped, and what it takes beyond a share of its
    time.
    """
    cores = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(cores)})
    try:
        whole = measured(cell, request, seed)
        planner = planner_of(cell, time.process_time)
        seconds = SHARE * whole.processor_s
        begin = time.process_time()
        elapsed = time.monotonic()
        planned(planner, request, seconds, seed, Watch())
        took = time.process_time() - begin
        elapsed = time.monotonic() - elapsed
    finally:
        os.sched_setaffinity(0, cores)
    beyond = max(took - seconds, 0.0)
    return Row(cell, f"{request.asked}, cut", took, elapsed, beyond, whole.unstoppable_s)


def requests_of(cell: str, seed: int) -> list[Request]:
    """Requests that are cut: savings, a front, a cycle time of three stops."""
    stops = (*tour(planner_of(cell, time.monotonic).cell, STOPS - 1, seed), "park")
    free = planned(
        planner_of(cell, time.monotonic), Request("free", stops), CEILING * STOPS, seed, Watch()
    )
    assert free is not None
    return [
        Request("savings", stops, savings=True),
        Request("front", stops, front_points=8),
        Request("cycle time", stops, cycle=0.9 * free.report.duration),
    ]


def claims_of(whole: list[Row], tours: list[Row], cuts: list[Row]) -> list[Claim]:
    """What all of them are held to."""
    claims = [
        at_most(
            "demonstration with savings: processor time",
            max(r.processor_s for r in whole),
            "s",
            3.0,
        ),
        at_most("demonstration with savings: elapsed", max(r.elapsed_s for r in whole), "s", 3.0),
    ]
    for row in tours:
        name = f"{row.cell}: {LONG} stops"
        claims += [
            at_most(f"{name}: processor time", row.processor_s, "s", 20.0),
            at_most(f"{name}: elapsed", row.elapsed_s, "s", 20.0),
            at_least(f"{name}: configurations per stop", row.configurations, "", CONFIGURATIONS),
        ]
    longest = max(row.unstoppable_s for row in (*whole, *tours, *cuts))
    beyond = max(row.beyond_s for row in cuts)
    return [
        *claims,
        at_most("longest time until a request to stop is heard", longest, "s", 0.2),
        at_most("time spent beyond planning_time", beyond, "s", 0.5),
    ]


def arguments() -> argparse.Namespace:
    """The command line."""
    return command_line(__doc__, CELLS, 2, "1 seed").parse_args()


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    whole = list[Row]()
    tours = list[Row]()
    cuts = list[Row]()
    cells = given.cell or CELLS
    for seed in range(1 if given.quick else given.seeds):
        whole.append(
            measured("demo", Request("demonstration with savings", (), savings=True), seed)
        )
        print(line_of(asdict(whole[-1])), flush=True)
        for cell in cells:
            stops = tour(planner_of(cell, time.monotonic).cell, LONG, seed)
            tours.append(measured(cell, Request(f"{LONG} stops", stops, turns=True), seed))
            print(line_of(asdict(tours[-1])), flush=True)
            for request in requests_of(cell, seed):
                cuts.append(cut(cell, request, seed))
                print(line_of(asdict(cuts[-1])), flush=True)
    rows = [asdict(row) for row in (*whole, *tours, *cuts)]
    finish(given.json, rows, claims_of(whole, tours, cuts))


if __name__ == "__main__":
    main()
