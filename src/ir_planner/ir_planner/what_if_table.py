"""Costs of a program if something were different: values in, a table out.

    table = what_if("demo", {"mass gear": [10, 20, 40], "cycle_time": [0, 120]}, workers=2)

One row for each combination of values, in order; pandas.DataFrame(table) takes it as it is. What
can be changed: `cycle_time` [s], `time_value` [W], `safety_distance` [m], `mass NAME` [kg] of the
tool or a part, `x NAME`, `y NAME`, `z NAME` [m], how far a machine or a station is moved in the
world.
"""

import itertools
import pickle
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np

from ir_description import Cell, InvalidValueError, Load, cell_from_yaml, cell_to_yaml, load_cell
from ir_kernels import portable
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError, unfit, unknown_name
from ir_planner.planner import Planner
from ir_values.argument_types import typed
from ir_values.arrays import FloatArray

ROWS_MAX = 10_000
J_PER_KWH = 3.6e6
OPTIONS = ("time_value", "safety_distance")
CYCLE_TIME = "cycle_time"
AXES = ("x", "y", "z")

Row = dict[str, float | bool | str]
Change = Mapping[str, float]


@typed(unfit)
def what_if(
    cell: str | Path | Cell,
    values: Mapping[str, Sequence[float]],
    options: PlanOptions | None = None,
    *,
    stations: tuple[str, ...] = (),
    workers: int = 1,
) -> list[Row]:
    """One row for each combination of `values`: these, then seconds, joules with their 90 %
    interval, kWh, clearance [m], certified, and the sentence where no program is found (its figures
    are nan).

    cell: a value, a file or a bundled name. stations: visit these; (): the cell's program. The same
    rows with any number of `workers`, processes of their own. Raises RequestError for what nobody
    can change, DescriptionError for a cell that can't be read.
    """
    base = cell if isinstance(cell, Cell) else load_cell(cell)
    every = itertools.product(*values.values())
    changes = [dict(zip(values, map(float, each), strict=True)) for each in every]
    if not 1 <= len(changes) <= ROWS_MAX or workers < 1:
        sentence = (
            f"{len(changes)} rows with {workers} workers: 1 to {ROWS_MAX} rows, at least 1 worker"
        )
        raise RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, sentence)
    for name in values:
        _changed(base, name, 0.0, look=True)
    job = cell_to_yaml(base), options or PlanOptions(), stations
    if workers == 1:
        return [_planned_row(base, change, *job[1:]) for change in changes]
    shares = [changes[k::workers] for k in range(min(workers, len(changes)))]
    with ThreadPoolExecutor(len(shares)) as pool:  # each waits for a process
        found = list(pool.map(lambda share: _rows_by_process(job, share), shares))
    rows = itertools.chain.from_iterable(itertools.zip_longest(*found))
    return [row for row in rows if row is not None]


def _planned_row(
    base: Cell, change: Change, options: PlanOptions, stations: tuple[str, ...]
) -> Row:
    """Plan with the values of one row."""
    # work is counted: the same rows on any machine
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    nothing = dict.fromkeys(
        ("seconds", "joules", "joules_low", "joules_high", "kwh", "clearance"), np.nan
    )
    row: Row = {**change, **nothing, "certified": False, "sentence": ""}
    value, margin = (change.get(name, getattr(options, name)) for name in OPTIONS)
    chosen = replace(options, time_value=value, safety_distance=margin)
    try:
        cell = base
        for name, value in change.items():
            cell = _changed(cell, name, value)
        planner.set_cell(text=cell_to_yaml(cell))
        plan = planner.plan_program(
            stations=stations, cycle_time=change.get(CYCLE_TIME, 0.0), options=chosen
        )
    except (InvalidValueError, RequestError) as error:  # one that no robot carries, or can't be met
        return row | {"sentence": str(error)}
    if not plan.status.ok:
        return row | {"sentence": plan.status.message}
    report = plan.report
    return row | {
        "seconds": report.duration,
        "joules": report.energy,
        "joules_low": report.energy_low,
        "joules_high": report.energy_high,
        "kwh": report.energy / J_PER_KWH,
        "clearance": report.min_clearance,
        "certified": bool(report.certified),
    }


def _changed(cell: Cell, name: str, value: float, *, look: bool = False) -> Cell:
    """The cell with one value changed; options change nothing of it. look: only whether there is
    such a thing.
    """
    what, _, thing = name.partition(" ")
    if name in (CYCLE_TIME, *OPTIONS):
        return cell
    if what == "mass":
        return _with_mass(cell, thing, value, look)
    if what not in AXES:
        known = (CYCLE_TIME, *OPTIONS, "mass NAME", *(f"{axis} NAME" for axis in AXES))
        raise unknown_name("value", name, known)
    return _cell_with_moved(cell, thing, value * np.eye(3)[AXES.index(what)])


def _with_mass(cell: Cell, name: str, mass: float, look: bool) -> Cell:
    """The cell with another mass [kg] of tool or part; its inertia in proportion."""
    loads = [part.name for part in cell.parts] + ([cell.tool.name] if cell.tool else [])
    if name not in loads:
        raise unknown_name("tool or part", name, loads)
    if look:
        return cell

    def heavier(load: Load) -> Load:
        return replace(load, mass=mass, inertia=load.inertia * (mass / load.mass))

    if cell.tool is not None and cell.tool.name == name:
        return replace(cell, tool=heavier(cell.tool))
    parts = tuple(replace(p, load=heavier(p.load)) if p.name == name else p for p in cell.parts)
    return replace(cell, parts=parts)


def _cell_with_moved(cell: Cell, name: str, by: FloatArray) -> Cell:
    """The cell with a machine or a station moved by (3,) m in the world."""
    shift = np.eye(4)
    shift[:3, 3] = by
    for machine in cell.equipment:
        if machine.name == name:
            return cell.with_equipment(name, pose=portable.matmul(shift, machine.pose))
    for station in cell.stations:
        if station.name == name:
            own = cell.machine(station.equipment).pose
            return cell.with_station(name, portable.matmul(portable.inv(own), shift, station.pose))
    known = [
        *(machine.name for machine in cell.equipment),
        *(station.name for station in cell.stations),
    ]
    raise unknown_name("machine or station", name, known)


def _rows_by_process(
    job: tuple[str, PlanOptions, tuple[str, ...]], share: Sequence[Change]
) -> list[Row]:
    """Rows of a share of the changes, planned in a process of its own."""
    process = subprocess.run(
        [sys.executable, "-c", f"from {__name__} import main; main()"],
        input=pickle.dumps((job, share)),
        stdout=subprocess.PIPE,
        check=True,
    )
    rows: list[Row] = pickle.loads(process.stdout)  # written by this module's main
    return rows


def main() -> None:
    """Plan the rows that standard input asks for, and write them to standard output."""
    (text, options, stations), share = pickle.load(sys.stdin.buffer)
    base = cell_from_yaml(text)
    rows = [_planned_row(base, change, options, stations) for change in share]
    sys.stdout.buffer.write(pickle.dumps(rows))
