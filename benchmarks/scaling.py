"""How do time and memory grow with bodies, stops, configurations and trajectory points?

    python benchmarks/scaling.py [--cell FILE] [--seeds N] [--axis NAME]... [--most N] [--plot FILE]
    [--quick]
                                 [--json FILE]

Every step is measured in a process of its own: processor seconds of one call, and the memory that
it takes at most. The exponent is the slope of log(time) over log(size), fitted over the upper half
of the range: 1 is linear. Bodies: the cell is filled up with boxes, each a machine with a station
and an allowed contact. Stops: tours of the cell's stations. Configurations: the same tour while A4
and A6 may turn less and less. Points: waves of all joints, which last longer the more points they
have.
"""

from __future__ import annotations

import argparse
import multiprocessing
import resource
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing.connection import Connection
from pathlib import Path

import matplotlib as mpl
import numpy as np
from _results import Claim, at_most, command_line, finish
from _scaling_cells import crowded, tour, waves, with_turns
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

from ir_description import (
    Cell,
    cell_from_yaml,
    cell_to_yaml,
    check_cell,
    load_cell,
    load_power_data,
)
from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, Planner, ProgramPlan, Reference
from ir_planner.checks import cell_shapes
from ir_planner.configurations import free_configurations
from ir_planner.program.program import plan_program
from ir_planner.program.request import ProgramRequest, nobody
from ir_planner.request import Work
from ir_planner.scene import load_text, scene_with
from ir_sim_driver.motion import ExecutionSettings, check_trajectory

# What one step costs at one size: processor seconds and memory, in a process of its own; and
# exponents.

PAGE = resource.getpagesize()
QUIET_S = 0.02  # a faster step is repeated for this long, and the least time counts
WARM_S = 3.0  # a step that took longer the first time, with cold caches, is not repeated
ALLOWED_S = 600.0  # wall time of one measurement


@dataclass(frozen=True)
class Cost:
    """Processor seconds of one call, and memory [MB] that the process needed for it at most."""

    seconds: float
    megabytes: float


@dataclass(frozen=True)
class Prepared:
    """A call to measure at one size, counted on its axis."""

    size: float
    call: Callable[[], object]


def measured(prepare: Callable[[], Prepared]) -> tuple[float, Cost] | str:
    """Size and cost of what `prepare` returns, in a child of this process; a sentence where it
    failed.
    """
    here, there = multiprocessing.Pipe(duplex=False)
    child = multiprocessing.get_context("fork").Process(target=_child, args=(there, prepare))
    child.start()
    there.close()
    try:
        found: tuple[float, Cost] | str
        found = here.recv() if here.poll(ALLOWED_S) else f"not finished after {ALLOWED_S:g} s"
    except EOFError:
        found = f"ended with exit code {child.exitcode}"
    child.kill()
    child.join()
    return found


def _child(there: Connection, prepare: Callable[[], Prepared]) -> None:
    try:
        prepared = prepare()
        before = _resident()
        spent = _timed_scaling_measure(prepared.call)
        if spent < WARM_S:  # again, now that caches are filled
            total = 0.0
            most = max(QUIET_S, 2.0 * spent)
            while total < most:
                again = _timed_scaling_measure(prepared.call)
                spent = min(spent, again)
                total += again
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        there.send((prepared.size, Cost(spent, max(peak - before, 0) / 1e6)))
    except Exception as error:  # whatever a step raises at a size is that size's result
        there.send(f"{type(error).__name__}: {error}")


def _timed_scaling_measure(call: Callable[[], object]) -> float:
    begin = time.process_time()
    call()
    return time.process_time() - begin


def _resident() -> int:
    """Bytes that this process holds now."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float:
    """Slope of log(value) over log(size), fitted over the upper half of the range; nan: too few
    sizes.
    """
    x = np.log(np.asarray(sizes))
    y = np.log(np.maximum(values, 1e-9))
    upper = x >= 0.5 * (x.min() + x.max()) - 1e-9 if len(x) else np.zeros(0, bool)
    if upper.sum() < 2:
        upper = np.argsort(np.argsort(x)) >= len(x) - 2
    if upper.sum() < 2 or np.ptp(x[upper]) == 0.0:
        return float("nan")
    return float(np.polyfit(x[upper], y[upper], 1)[0])


# Rows of benchmarks/scaling.py, and the exponents that follow from them.


@dataclass(frozen=True)
class Row:
    """One step at one size of its axis: median over the seeds."""

    axis: str
    step: str
    size: float
    seconds: float
    megabytes: float


def row_of(axis: str, step: str, found: Sequence[tuple[float, Cost]]) -> Row:
    """The row of one step from its measurements at one size."""
    size, seconds, megabytes = (
        float(np.median(values))
        for values in (
            [size for size, _ in found],
            [cost.seconds for _, cost in found],
            [cost.megabytes for _, cost in found],
        )
    )
    return Row(axis, step, size, seconds, megabytes)


def exponents(rows: Iterable[Row]) -> dict[tuple[str, str], float]:
    """Exponent of the time of each step."""
    by_step: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        by_step.setdefault((row.axis, row.step), []).append(row)
    return {
        key: exponent([row.size for row in mine], [row.seconds for row in mine])
        for key, mine in by_step.items()
    }


# One picture of how cost grows: time and memory over each axis, with the exponent of each step.

mpl.use("Agg")


AXES = {
    "bodies": "bodies in the cell",
    "stops": "stops of the program",
    "configurations": "free configurations per stop",
    "points": "points of the trajectory",
}


TICKS = (1, 2, 5, 10, 20, 50, 100, 1000, 10_000)


def _decades(panel: Axes) -> None:
    """At least two decades, so that noise stays small."""
    low, high = np.log10(panel.get_ylim())
    more = max(2.0 - (high - low), 0.0) / 2.0
    panel.set_ylim(10.0 ** (low - more), 10.0 ** (high + more))
    panel.yaxis.set_minor_formatter(NullFormatter())


def plot(rows: Sequence[Row], file: Path) -> None:
    """Times above, memory below, one column per axis."""
    axes_with_rows = [axis for axis in AXES if any(row.axis == axis for row in rows)]
    figure, panels = plt.subplots(
        2,
        len(axes_with_rows),
        figsize=(4.6 * len(axes_with_rows), 8.4),
        squeeze=False,
        sharex="col",
    )
    slopes = exponents(rows)
    sizes = {axis: [row.size for row in rows if row.axis == axis] for axis in axes_with_rows}
    for column, axis in enumerate(axes_with_rows):
        time, memory = panels[:, column]
        for name in dict.fromkeys(row.step for row in rows if row.axis == axis):
            mine = [row for row in rows if (row.axis, row.step) == (axis, name)]
            size = [row.size for row in mine]
            label = f"{name}: {slopes[axis, name]:.2f}"
            time.loglog(size, [row.seconds for row in mine], "o-", ms=3, lw=1.2, label=label)
            memory.loglog(size, [max(row.megabytes, 0.1) for row in mine], "o-", ms=3, lw=1.2)
        memory.set_xlabel(AXES[axis])
        handles, labels = time.get_legend_handles_labels()
        title = "step: exponent of its time"
        place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2)}
        memory.legend(handles, labels, fontsize=8, title=title, title_fontsize=8, **place)
        ticks = [k for k in TICKS if min(sizes[axis]) <= k <= max(sizes[axis])]
        memory.set_xticks(ticks, [str(k) for k in ticks])
        memory.xaxis.set_minor_formatter(NullFormatter())
        for panel in (time, memory):
            panel.grid(which="both", alpha=0.25)
            _decades(panel)
    panels[0, 0].set_ylabel("processor time of one call [s]")
    panels[1, 0].set_ylabel("memory of one call [MB]")
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=100)
    plt.close(figure)


# The steps of benchmarks/scaling.py: what is prepared at a size, what is called, how it may
# grow.

# exponents, with what caches of the processor and noise add
LINEAR = 1.25
SQUARE = 2.25
TURNING_STOPS = 4
CEILING = 600.0  # s of planning
MARGIN = 0.02  # m
STATES = 1000


@dataclass(frozen=True)
class Step:
    """A step on an axis. prepare: (cell, size, seed) to a call; bound: of the exponent of its
    time.
    """

    axis: str
    name: str
    prepare: Callable[[str, int, int], Prepared]
    bound: float = LINEAR


def planner_with(cell: Cell) -> Planner:
    """A planner with a cell, its scene built."""
    planner = Planner(clock=time.monotonic)
    planner.set_cell(text=cell_to_yaml(cell))
    planner.check_state(planner.cell.machine_home, safety_distance=0.0, max_pairs=1)
    return planner


def options(seed: int, **more: object) -> PlanOptions:
    """Options that only work ends."""
    return PlanOptions(seed=seed, planning_time=CEILING, safety_distance=MARGIN, **more)  # type: ignore[arg-type]


def _of_cell(call: Callable[[Cell], object]) -> Callable[[str, int, int], Prepared]:
    def prepare(name: str, size: int, seed: int) -> Prepared:
        cell = crowded(name, size, seed)
        return Prepared(len(cell.bodies()), lambda: call(cell))

    return prepare


def _of_planner(
    call: Callable[[Planner], Callable[[], object]],
) -> Callable[[str, int, int], Prepared]:
    def prepare(name: str, size: int, seed: int) -> Prepared:
        planner = planner_with(crowded(name, size, seed))
        return Prepared(len(planner.cell.bodies()), call(planner))

    return prepare


def _reading(name: str, size: int, seed: int) -> Prepared:
    cell = crowded(name, size, seed)
    text = cell_to_yaml(cell)
    return Prepared(len(cell.bodies()), lambda: cell_from_yaml(text))


def _scene(planner: Planner) -> Callable[[], object]:
    """A machine changes and a scene is built, with the thresholds of a station."""
    cell = planner.cell
    station = cell.stations[-1].name
    machine = cell.machine(cell.stations[-1].equipment)

    def call() -> object:
        planner.set_equipment(machine.name, pose=machine.pose, enabled=True)
        return planner.check_state(
            cell.machine_home, safety_distance=MARGIN, max_pairs=5, station=station
        )

    return call


def _states(planner: Planner) -> Callable[[], object]:
    robot = planner.cell.robot
    model = planner.scene().collision
    q = np.random.default_rng(0).uniform(robot.position_min, robot.position_max, (STATES, robot.n))
    return lambda: model.min_distance(q)


def _movement(planner: Planner) -> Callable[[], object]:
    cell = planner.cell
    start = cell.machine_home
    goal = Goal(configuration=cell.park)

    def call() -> object:
        plan = planner.plan_regional(start=start, goal=goal, options=options(0))
        if not plan.status.ok:
            raise RuntimeError(plan.status.message)
        return plan

    return call


def _evaluation(planner: Planner) -> Callable[[], object]:
    trajectory = waves(planner.cell, 10)
    return lambda: planner.evaluate(trajectory, safety_distance=MARGIN)


def _program(planner: Planner) -> Callable[[], object]:
    return lambda: _planned(planner, (), 0)


def _planned(planner: Planner, stations: tuple[str, ...], seed: int) -> ProgramPlan:
    return _found(
        planner.plan_program(
            stations=stations, options=options(seed), start=planner.cell.posture("park")
        )
    )


def _found(plan: ProgramPlan) -> ProgramPlan:
    """The plan; a failed one is no measurement."""
    if not plan.status.ok:
        raise RuntimeError(plan.status.message)
    return plan


def _tour(name: str, size: int, seed: int) -> Prepared:
    planner = planner_with(load_cell(name))
    stations = tour(planner.cell, size, seed)
    return Prepared(size, lambda: _planned(planner, stations, seed))


def _turns(name: str, size: int, seed: int) -> Prepared:
    """`size` is the range of A4 and A6 in degrees; what counts is how many configurations it
    leaves.
    """
    cell = with_turns(load_cell(name), np.radians(float(size)))
    stations = tour(cell, TURNING_STOPS, seed)
    power = load_power_data()
    request = ProgramRequest(cell, power, stations, cell.posture("park"), options(seed))
    scene = scene_with(cell, load_text(cell), power)
    home = cell.machine_home
    found = [
        len(
            free_configurations(
                scene.station(name).pose, scene, scene.thresholds(MARGIN, name), home
            ).q
        )
        for name in stations
    ]

    def call() -> object:
        work = Work(20_000 * TURNING_STOPS, time.monotonic() + CEILING, time.monotonic)
        return _found(plan_program(request, work, nobody))

    return Prepared(float(np.mean(found)), call)


def _of_points(
    call: Callable[[Planner, int], Callable[[], object]],
) -> Callable[[str, int, int], Prepared]:
    def prepare(name: str, size: int, seed: int) -> Prepared:
        return Prepared(size, call(planner_with(load_cell(name)), size))

    return prepare


def _timed(planner: Planner, points: int) -> Callable[[], object]:
    given = waves(planner.cell, points)
    return lambda: planner.plan_trajectory(
        Reference(given.positions, given.times), options=options(0)
    )


def _free(planner: Planner, points: int) -> Callable[[], object]:
    given = waves(planner.cell, points)
    return lambda: planner.plan_trajectory(Reference(given.positions), options=options(0))


def _evaluated(planner: Planner, points: int) -> Callable[[], object]:
    given = waves(planner.cell, points)
    return lambda: planner.evaluate(given, safety_distance=MARGIN)


def _optimised(planner: Planner, points: int) -> Callable[[], object]:
    given = waves(planner.cell, points)
    return lambda: planner.optimize_trajectory(given, options=options(0))


def _vetted(planner: Planner, points: int) -> Callable[[], object]:
    given = waves(planner.cell, points)
    robot = planner.cell.robot
    dynamics = planner.scene().dynamics
    return lambda: check_trajectory(given, robot, dynamics, ExecutionSettings())


STEPS = (
    Step("bodies", "read a cell", _reading),
    Step("bodies", "write a cell", _of_cell(cell_to_yaml)),
    Step("bodies", "review a cell", _of_cell(check_cell)),
    Step("bodies", "markers", _of_cell(cell_shapes)),
    Step("bodies", "move a machine, check a state", _of_planner(_scene)),
    Step("bodies", f"{STATES} distances", _of_planner(_states)),
    Step("bodies", "plan a movement", _of_planner(_movement)),
    Step("bodies", "evaluate", _of_planner(_evaluation)),
    Step("bodies", "plan the program", _of_planner(_program)),
    Step("stops", "plan a program", _tour),
    Step("configurations", f"plan a program of {TURNING_STOPS} stops", _turns, SQUARE),  # edges
    Step("points", "plan_trajectory, timed", _of_points(_timed)),
    Step("points", "plan_trajectory", _of_points(_free)),
    Step("points", "evaluate_trajectory", _of_points(_evaluated)),
    Step("points", "optimize_trajectory", _of_points(_optimised)),
    Step("points", "vet in the driver", _of_points(_vetted)),
)

SIZES: Mapping[str, tuple[int, ...]] = {
    "bodies": (10, 30, 100, 300, 1000, 3000, 10_000),
    "stops": (2, 5, 10, 20, 35, 50),
    "configurations": (150, 185, 360, 540, 720),
    "points": (10, 30, 100, 300, 1000, 3000, 10_000),
}
QUICK: Mapping[str, tuple[int, ...]] = {
    "bodies": (30, 100, 300, 1000),
    "stops": (2, 4, 8),
    "configurations": (185, 360),
    "points": (10, 100, 1000),
}

CELL = "demo"
LARGEST_S = 60.0  # the largest sizes that requests may have are answered within this


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, [CELL], 1, "smaller sizes")
    parser.add_argument("--axis", action="append", choices=list(SIZES), help="default: all")
    parser.add_argument("--most", type=float, default=np.inf, help="largest size")
    parser.add_argument("--plot", type=Path, help="write the picture here")
    return parser.parse_args()


def rows_of(step: Step, sizes: tuple[int, ...], cell: str, seeds: int) -> list[Row]:
    """One row per size; the first size that is refused or fails ends the step, with its
    sentence.
    """
    rows: list[Row] = []
    for size in sizes:
        found = [measured(partial(step.prepare, cell, size, seed)) for seed in range(seeds)]
        refused = [one for one in found if isinstance(one, str)]
        if refused:
            print(f"{step.axis:15s}{step.name:32s}{size:>8d}  {refused[0]}", flush=True)
            break
        row = row_of(step.axis, step.name, [one for one in found if not isinstance(one, str)])
        figures = f"{row.size:8.0f}{row.seconds:12.4f}{row.megabytes:10.1f}"
        print(f"{row.axis:15s}{row.step:32s}{figures}", flush=True)
        rows.append(row)
    return rows


def claims_of(rows: list[Row]) -> list[Claim]:
    """An exponent for every step, and the time at its largest size."""
    found = exponents(rows)
    claims = []
    for step in STEPS:
        mine = [row for row in rows if (row.axis, row.step) == (step.axis, step.name)]
        if len(mine) > 1:
            slope = found[step.axis, step.name]
            claims.append(at_most(f"{step.axis}: {step.name}", slope, "exponent", step.bound))
            top = f"{step.axis}: {step.name}, {mine[-1].size:.0f}"
            claims.append(at_most(top, mine[-1].seconds, "s", LARGEST_S))
    return claims


def main() -> None:
    """Measure, print, draw, write."""
    given = arguments()
    sizes = QUICK if given.quick else SIZES
    rows: list[Row] = []
    print(f"{'axis':15s}{'step':32s}{'size':>8s}{'seconds':>12s}{'MB':>10s}")
    for cell in given.cell or [CELL]:
        for step in STEPS:
            if step.axis in (given.axis or SIZES):
                chosen = tuple(size for size in sizes[step.axis] if size <= given.most)
                rows += rows_of(step, chosen, cell, given.seeds)
    if given.plot:
        plot(rows, given.plot)
    finish(given.json, [asdict(row) for row in rows], claims_of(rows))


if __name__ == "__main__":
    main()
