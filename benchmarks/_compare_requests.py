"""The fixed list of requests whose answers two checkouts are compared by: calls of the core,
without ROS.
"""

from __future__ import annotations

import importlib
import inspect
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.arrays import FloatArray

# The few names of the planner that a comparison needs, wherever a checkout keeps them.
#
# The public face of `ir_planner` first, then the modules of the layout without one.

_MODULES = {
    "Planner": ("ir_planner", "ir_planner.planner"),
    "Goal": ("ir_planner", "ir_planner.goals"),
    "parse_goal": ("ir_planner", "ir_planner.goals"),
    "Reference": ("ir_planner", "ir_planner.following"),
    "RequestError": ("ir_planner", "ir_planner.errors"),
}


def name_of(name: str) -> Any:
    """The class or function `name` of this checkout's planner. Raises ImportError listing where it
    is not.
    """
    for module in _MODULES[name]:
        try:
            found = getattr(importlib.import_module(module), name, None)
        except ModuleNotFoundError as error:
            if error.name is None or not module.startswith(error.name):
                raise
            continue
        if found is not None:
            return found
    raise ImportError(f"no {name} in {', '.join(_MODULES[name])}")


_POSITIONS: dict[str, dict[str, Any]] = {
    "check_state": {"safety_distance": 0.02, "max_pairs": 5, "load": "", "station": ""},
    "compute_ik": {"method": "analytic", "safety_distance": 0.02, "near": None, "load": ""},
    "evaluate": {"safety_distance": 0.02, "load": "", "station": ""},
    "standby": {"q": None, "load": ""},
    "plan_regional": {"start": None, "goal": None, "options": PlanOptions()},
    "plan_service": {
        "direction": "exit",
        "configuration": None,
        "near": None,
        "max_candidates": 3,
        "options": PlanOptions(),
    },
    "plan_trajectory": {"options": PlanOptions()},
    "plan_cartesian": {"options": PlanOptions()},
    "optimize_trajectory": {"options": PlanOptions()},
    "plan_program": {"stations": (), "cycle_time": 0.0, "options": PlanOptions(), "start": None},
}


class _PositionalPlanner:
    """A planner of a checkout before the keywords, called by keywords."""

    def __init__(self, planner: Any) -> None:
        self._planner = planner

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._planner, name)
        order = _POSITIONS.get(name)
        if order is None:
            return method

        def called(*first: Any, **named: Any) -> Any:
            arguments = [named.pop(key, default) for key, default in order.items()]
            return method(*first, *arguments, **named)

        return called


def planner_of(cell: str) -> Any:
    """A planner with a bundled cell or the cell of a file."""
    make = name_of("Planner")
    if "cell" in inspect.signature(make).parameters:
        return make(cell)
    planner = make(time.monotonic)
    planner.set_cell("", cell)
    return _PositionalPlanner(planner)


def checkout() -> Path:
    """Root of the checkout whose planner is imported."""
    return Path(str(importlib.import_module("ir_planner").__file__)).resolve().parents[3]


# The planner's calls that a comparison makes, each answered as a flat mapping: name -> number or
# text.
#
# An answer holds statuses, ids and every figure of the reports. Texts of statuses, times of stages
# and other wall-clock figures are no part of it.

Answer = dict[str, Any]
S_M = 0.02  # m
SHARE_OF_ENDS = 0.8  # of the clearance at start and goal, where that is smaller
CEILING = 120.0  # s: work ends a request, never the clock
planner = cache(planner_of)


def options(**changed: Any) -> PlanOptions:
    """Default options under a ceiling that is never reached."""
    return PlanOptions(**{"planning_time": CEILING, **changed})


def numbers_of(report: TrajectoryReport, prefix: str = "") -> Answer:
    """Every figure of a report."""
    found: Answer = {}
    for field in fields(report):
        value = getattr(report, field.name)
        if isinstance(value, (bool, int, float)):
            found[prefix + field.name] = value
        elif isinstance(value, np.ndarray):
            found[prefix + field.name] = value.tolist()
    if report.closest is not None:
        pair = report.closest
        found[prefix + "closest"] = f"{pair.kind} {pair.body_a} {pair.body_b}"
        found[prefix + "closest_distance"] = pair.distance
    return found


def identity(trajectory: JointTrajectory | None) -> str:
    return trajectory.trajectory_id if trajectory is not None else ""


def info_of(info: Any) -> Answer:
    """Work and seed; the rejected candidates by count alone, because their reasons are texts."""
    return {
        "planner_id": info.planner_id,
        "seed": info.seed,
        "work": info.iterations,
        "truncated": info.truncated,
        "rejected": sorted(one.count for one in info.rejected),
    }


def movement_of(plan: Any) -> Answer:
    return {
        "status": int(plan.status.code),
        "id": identity(plan.trajectory),
        **info_of(plan.info),
        **numbers_of(plan.report),
    }


def program(cell: str, stations: tuple[str, ...], cycle_time: float, **changed: Any) -> Answer:
    asked = planner(cell)
    home = np.array(asked.cell.machine_home)
    plan = asked.plan_program(
        stations=stations, cycle_time=cycle_time, options=options(**changed), start=home
    )
    found = {"status": int(plan.status.code), "id": plan.program_id, **info_of(plan.info)}
    for k, movement in enumerate(plan.movements):
        found[f"{k} id"] = movement.trajectory_id
        found[f"{k} duration"] = movement.duration
        found |= numbers_of(movement.report, f"{k} ")
    return found | numbers_of(plan.report)


@cache
def tasks_of(cell: str) -> list[tuple[str, Any, Any, float]]:
    """Name, start (n,), goal (n,) and margin [m] of every task, there and back."""
    asked = planner(cell)
    found = []
    for task in asked.cell.tasks:
        start, goal = (np.array(q, dtype=np.float64) for q in (task.start, task.goal))
        ends = min(
            asked.check_state(q, safety_distance=0.0, max_pairs=1).min_distance
            for q in (start, goal)
        )
        margin = min(S_M, SHARE_OF_ENDS * ends)
        found += [(task.name, start, goal, margin), (f"{task.name} back", goal, start, margin)]
    return found


def moved(cell: str, start: Any, goal: Any, margin: float, **changed: Any) -> Answer:
    asked = options(safety_distance=margin, **changed)
    return movement_of(
        planner(cell).plan_regional(
            start=start, goal=name_of("Goal")(configuration=goal), options=asked
        )
    )


def to_station(cell: str) -> Answer:
    asked = planner(cell)
    goal = name_of("parse_goal")(asked.cell.stations[-1].name, asked.cell)
    return movement_of(
        asked.plan_regional(start=np.array(asked.cell.machine_home), goal=goal, options=options())
    )


def service(cell: str, station: str, direction: str) -> Answer:
    asked = planner(cell)
    home = np.array(asked.cell.machine_home)
    plan = asked.plan_service(
        station, direction=direction, near=home, max_candidates=3, options=options()
    )
    found = {"status": int(plan.status.code), **info_of(plan.info)}
    for k, candidate in enumerate(plan.candidates):
        found[f"{k} id"] = identity(candidate.trajectory)
        found |= numbers_of(candidate.report, f"{k} ")
    return found


def thinned(planned: Any, count: int) -> JointTrajectory:
    """Every N-th point of a planned trajectory with its times, and straight lines between."""
    last = len(planned.times_ns) - 1
    kept = np.unique(np.linspace(0, last, count).astype(int))
    return JointTrajectory.from_seconds(
        planned.joint_names, planned.times[kept] * 3.0, planned.positions[kept]
    )


@cache
def planned(cell: str, k: int) -> JointTrajectory:
    _, start, goal, margin = tasks_of(cell)[k]
    asked = options(safety_distance=margin)
    found = (
        planner(cell)
        .plan_regional(start=start, goal=name_of("Goal")(configuration=goal), options=asked)
        .trajectory
    )
    assert isinstance(found, JointTrajectory)
    return found


def optimized(cell: str, k: int, points: int, **changed: Any) -> Answer:
    asked = options(safety_distance=tasks_of(cell)[k][3], **changed)
    plan = planner(cell).optimize_trajectory(thinned(planned(cell, k), points), options=asked)
    found = {"status": int(plan.status.code), "id": identity(plan.trajectory), **info_of(plan.info)}
    found["front"] = [point.trajectory.trajectory_id for point in plan.front]
    return found | numbers_of(plan.before, "before ") | numbers_of(plan.after, "after ")


def through(cell: str, k: int, points: int, timed: bool, **changed: Any) -> Answer:
    given = thinned(planned(cell, k), points)
    reference = name_of("Reference")(given.positions, given.times if timed else None)
    asked = options(safety_distance=tasks_of(cell)[k][3], **changed)
    return movement_of(planner(cell).plan_trajectory(reference, options=asked))


def pose(x: float, y: float, z: float, tilt: float = 0.0) -> FloatArray:
    """The tool's axis downwards, tilted by an angle whose sine and cosine are exact fractions."""
    turned = np.array([[-tilt, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, -tilt]])
    T = np.eye(4)
    T[:3, :3] = turned / np.array([[np.sqrt(1.0 + tilt**2)], [1.0], [np.sqrt(1.0 + tilt**2)]])
    T[:3, 3] = (x, y, z)
    return T


def _segments(kind: str, *poses: FloatArray) -> tuple[CartesianSegment, ...]:
    if kind == "line":
        return tuple(CartesianSegment(kind, (one,)) for one in poses)
    return (CartesianSegment(kind, poses),)


BEGIN = pose(1.8, -0.3, 1.2)
END = pose(1.8, 0.3, 1.2)
MIDDLE = pose(1.7, 0.0, 1.3)
PATHS = {
    "line": CartesianPath(BEGIN, _segments("line", END), tool_speed=0.25),
    "free angle": CartesianPath(BEGIN, _segments("line", END), tool_speed=0.25, free_angle=1.0),
    "turning": CartesianPath(BEGIN, _segments("line", pose(1.9, 0.3, 1.4, 0.2)), tool_speed=0.4),
    "circle": CartesianPath(BEGIN, _segments("circle", pose(1.6, 0.0, 1.2), END), tool_speed=0.2),
    "spline": CartesianPath(
        BEGIN,
        _segments("spline", MIDDLE, pose(1.8, 0.2, 1.2, 0.1), pose(1.9, 0.4, 1.2)),
        tool_speed=0.2,
    ),
    "corner": CartesianPath(
        pose(1.7, -0.2, 1.2),
        _segments("line", pose(1.7, 0.2, 1.2), pose(1.9, 0.2, 1.2)),
        0.15,
        blending_radius=0.08,
    ),
}


def along_path(cell: str, name: str) -> Answer:
    plan = planner(cell).plan_cartesian(PATHS[name], options=options())
    return {
        "status": int(plan.status.code),
        "id": identity(plan.trajectory),
        "tool_error": plan.tool_error,
        **numbers_of(plan.report),
    }


def evaluated(cell: str, k: int) -> Answer:
    found = planner(cell).evaluate(planned(cell, k), safety_distance=tasks_of(cell)[k][3])
    return {
        "status": int(found.verification.status.code),
        **numbers_of(found.report),
        "distances": float(np.sum(found.clearance.distances)),
    }


def ik(cell: str, station: str, method: str) -> Answer:
    asked = planner(cell)
    goal = name_of("parse_goal")(station, asked.cell)
    near = np.array(asked.cell.machine_home)
    plan = asked.compute_ik(goal, method=method, safety_distance=S_M, near=near, starts=32, seed=3)
    found = {
        "status": int(plan.status.code),
        "rejected": sorted(one.count for one in plan.info.rejected),
    }
    found["branches"] = [solution.branch for solution in plan.solutions]
    found["q"] = [np.asarray(solution.q).tolist() for solution in plan.solutions]
    found["clearances"] = [solution.clearance for solution in plan.solutions]
    return found


def standby(cell: str, pause: float) -> Answer:
    found = planner(cell).standby(pause)
    return {
        "mode": found.chosen.name,
        "wake_at": found.wake_at,
        "energy": found.energy,
        "saving": found.saving,
        "energies": [float(energy) for energy in found.energies],
        "break_even": [float(mode.break_even) for mode in found.alternatives],
    }


def state(cell: str, k: int) -> Answer:
    found = planner(cell).check_state(tasks_of(cell)[k][1], safety_distance=S_M, max_pairs=20)
    return {
        "valid": found.valid,
        "min_distance": found.min_distance,
        "pairs": [f"{pair.body_a} {pair.body_b}" for pair in found.pairs],
        "distances": [pair.distance for pair in found.pairs],
    }


Ask = Callable[[], Answer]
CELLS = ("open", "table_columns", "cnc_door", "deep_box")
DEMO = "demo"
POINTS = 12  # that a trajectory is planned through
CYCLE = 130.0  # s for the demonstration
PAUSES = (0.5, 3.0, 20.0, 60.0, 600.0, 7200.0)  # s
SLOW = {"duration": 6.0}


@dataclass(frozen=True, eq=False)
class Request:
    """`ask` answers; `group` is what its time is counted under."""

    group: str
    name: str
    ask: Ask


def requests() -> Iterator[Request]:
    """All of them, always in the same order."""
    yield from _programs()
    yield from _regional()
    yield from _variants()
    yield from _services()
    yield from _trajectories()
    yield from _paths()
    yield from _questions()
    yield from _refused()


def _programs() -> Iterator[Request]:
    for name, cycle, changed in (
        ("default", 0.0, {}),
        ("seed 1", 0.0, {"seed": 1}),
        ("energy", 0.0, {"objective": "energy"}),
        ("time", 0.0, {"objective": "time"}),
        ("cycle time", CYCLE, {}),
    ):
        yield Request("program", f"demo {name}", partial(program, DEMO, (), cycle, **changed))
    for cell, stations in (
        ("cnc_door", ("home", "pal", "press", "home")),
        ("open", ("home", "p1", "p2")),
    ):
        yield Request("program", f"{cell} stations", partial(program, cell, stations, 0.0))


def _regional() -> Iterator[Request]:
    for cell in CELLS:
        for name, start, goal, margin in tasks_of(cell):
            for seed in (0, 1):
                yield Request(
                    f"regional {cell}",
                    f"{cell} {name} seed {seed}",
                    partial(moved, cell, start, goal, margin, seed=seed),
                )


VARIANTS: dict[str, dict[str, Any]] = {
    "direct": {"planner_id": "direct"},
    "genetic": {"planner_id": "genetic"},
    "energy": {"objective": "energy"},
    "time": {"objective": "time"},
    "movement_cost": {"objective": "movement_cost"},
    "duration 4 s": {"duration": 4.0},
    "duration 4 s energy": {"duration": 4.0, "objective": "energy"},
    "asynchronous": {"timing": "asynchronous"},
    "asynchronous time": {"timing": "asynchronous", "objective": "time"},
    "half speed": {"velocity_scaling": 0.5, "acceleration_scaling": 0.5},
    "more work": {"max_iterations": 20_000},
}


def _variants() -> Iterator[Request]:
    for variant, changed in VARIANTS.items():
        for cell in CELLS:
            for name, start, goal, margin in tasks_of(cell)[::4]:
                yield Request(
                    f"regional {variant}",
                    f"{cell} {name} {variant}",
                    partial(moved, cell, start, goal, margin, **changed),
                )
    for cell in (*CELLS, DEMO):
        yield Request(
            "regional to a station", f"{cell} home to a station", partial(to_station, cell)
        )


def _services() -> Iterator[Request]:
    for cell in (*CELLS, DEMO):
        for station in planner(cell).cell.stations:
            for direction in ("exit", "entry"):
                yield Request(
                    f"service {cell}",
                    f"{cell} {station.name} {direction}",
                    partial(service, cell, station.name, direction),
                )


def _trajectories() -> Iterator[Request]:
    for cell in CELLS:
        for k in (0, 4, 9):
            name = f"{cell} {tasks_of(cell)[k][0]}"
            for what, changed in (
                ("", {}),
                (" energy", {"objective": "energy"}),
                (" 6 s", SLOW),
            ):
                yield Request(
                    "optimize_trajectory",
                    f"{name} optimised{what}",
                    partial(optimized, cell, k, 12, **changed),
                )
            for timed in (False, True):
                yield Request(
                    "plan_trajectory",
                    f"{name} through {POINTS} points{' with times' if timed else ''}",
                    partial(through, cell, k, POINTS, timed),
                )
            yield Request("evaluate", f"{name} evaluated", partial(evaluated, cell, k))


def _paths() -> Iterator[Request]:
    for name in PATHS:
        yield Request("plan_cartesian", f"open path {name}", partial(along_path, "open", name))


def _questions() -> Iterator[Request]:
    for cell in (*CELLS, DEMO):
        for station in planner(cell).cell.stations:
            for method in ("analytic", "ccd"):
                yield Request(
                    f"compute_ik {method}",
                    f"{cell} {station.name} {method}",
                    partial(ik, cell, station.name, method),
                )
    for pause in PAUSES:
        yield Request("standby", f"standby {pause:g} s", partial(standby, DEMO, pause))
    for cell in CELLS:
        for k in range(0, len(tasks_of(cell)), 2):
            name = f"{cell} start of {tasks_of(cell)[k][0]}"
            yield Request("check_state", name, partial(state, cell, k))


def _status(ask: Callable[[], Any]) -> Answer:
    """The status code of an answer; refusals are caught where all requests are asked."""
    return {"status": int(ask().status.code)}


def _refused() -> Iterator[Request]:
    demo = planner(DEMO)
    home = np.array(demo.cell.machine_home)
    goal = name_of("Goal")(configuration=np.array(demo.cell.posture("park")))
    far = name_of("parse_goal")("X 9 Y 0 Z 1 A 0 B 90 C 0", demo.cell)
    cases: dict[str, Callable[[], Any]] = {
        "unknown planner": lambda: demo.plan_regional(
            start=home, goal=goal, options=options(planner_id="no_such")
        ),
        "duration too short": lambda: demo.plan_regional(
            start=home, goal=goal, options=options(duration=0.05)
        ),
        "out of reach": lambda: demo.plan_regional(start=home, goal=far, options=options()),
        "outside the limits": lambda: demo.plan_regional(
            start=home + 9.0, goal=goal, options=options()
        ),
        "unknown station": lambda: demo.plan_program(
            stations=("no_such",), options=options(), start=home
        ),
        "cycle time too short": lambda: demo.plan_program(
            cycle_time=1.0, options=options(), start=home
        ),
        "budget of one": lambda: demo.plan_regional(
            start=home, goal=goal, options=replace(options(), max_iterations=1)
        ),
    }
    for name, ask in cases.items():
        yield Request("refusals", name, partial(_status, ask))
