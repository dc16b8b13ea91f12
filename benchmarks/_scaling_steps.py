"""The steps of benchmarks/scaling.py: what is prepared at a size, what is called, how it may
grow.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from _scaling_cells import crowded, tour, waves, with_turns
from _scaling_measure import Prepared

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
