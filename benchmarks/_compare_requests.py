"""The fixed list of requests whose answers two checkouts are compared by: calls of the core,
without ROS.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from _compare_calls import (
    PATHS,
    Answer,
    along_path,
    evaluated,
    ik,
    moved,
    optimized,
    options,
    planner,
    program,
    service,
    standby,
    state,
    tasks_of,
    through,
    to_station,
)
from _compare_face import name_of

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
