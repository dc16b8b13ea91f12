"""How still do a program's figures hold: over payloads, over seeds, over the work that they are
given?

    python benchmarks/noise.py [--cell FILE]... [--seeds N] [--steps N] [--quick] [--json FILE]

All stations of a cell in turn and back to the posture park. Payloads: the mass of the tool of the
demonstration cell in even steps up to 195 kg, its centre where it is, its inertia in proportion, in
one cycle time; noise is the largest residual of the energy at the mains from its quadratic fit.
Seeds: spread of J with the default work. Work: J with ten times the default work, over that with
the default.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from _program_chains import CEILING
from _results import Claim, at_most, command_line, finish, line_of

from ir_description import Cell, Load, cell_to_yaml, load_cell
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner

CELLS = ("demo", "open", "table_columns", "cnc_door", "deep_box")
# kg; a mass is above 0
HEAVIEST = 195.0
LIGHTEST = 0.01
ROUNDING = 0.05  # %: within a tolerance any chain is as good as the best
LONGER = 1.1  # times the free cycle with the heaviest payload: what all of them can keep
MUCH = 80_000  # max_iterations: ten times of what goes into better movements by default


@dataclass(frozen=True)
class Row:
    """One program. asked: what was varied; value: payload [kg], seed or max_iterations; energy: at
    the mains [J]; J: of its movements; processor seconds of planning. Not found: nan.
    """

    cell: str
    asked: str
    value: float
    energy: float
    J: float
    cycle: float
    planning_s: float


def planned(cell: Cell, asked: str, value: float, options: PlanOptions, cycle: float = 0.0) -> Row:
    """The program through all stations of a cell, in a cycle time [s], 0: free."""
    planner = Planner(clock=time.monotonic)
    planner.set_cell(text=cell_to_yaml(cell))
    stops = (*(station.name for station in cell.stations), "park")
    begin = time.process_time()
    plan = planner.plan_program(
        stations=stops, cycle_time=cycle, options=options, start=np.array(cell.park)
    )
    took = time.process_time() - begin
    if not plan.status.ok:
        return Row(cell.name, asked, value, np.nan, np.nan, np.nan, took)
    reports = [movement.report for movement in plan.movements if not movement.is_pause]
    J = sum(r.energy - r.base_energy + options.time_value * r.duration for r in reports)
    return Row(cell.name, asked, value, plan.report.energy, J, plan.report.duration, took)


def over_payloads(cell: Cell, steps: int) -> list[Row]:
    """The energy of one cycle time over the mass of the tool, lightest first."""
    options = PlanOptions(objective="energy", planning_time=CEILING)
    heaviest = planned(loaded(cell, HEAVIEST), "free", HEAVIEST, PlanOptions(planning_time=CEILING))
    masses = np.linspace(LIGHTEST, HEAVIEST, steps + 1)
    cycle = LONGER * heaviest.cycle
    return [
        planned(loaded(cell, float(mass)), "payload", float(mass), options, cycle)
        for mass in masses
    ]


def loaded(cell: Cell, mass: float) -> Cell:
    """The cell with another mass [kg] at its tool; nothing attaches its parts, which hardly
    weigh.
    """
    assert cell.tool is not None
    parts = tuple(replace(part, load=_weighing(part.load, LIGHTEST)) for part in cell.parts)
    return replace(cell, tool=_weighing(cell.tool, mass), parts=parts)


def _weighing(load: Load, mass: float) -> Load:
    return replace(load, mass=mass, inertia=load.inertia * (mass / load.mass))


def noise(rows: Sequence[Row]) -> float:
    """Largest residual [%] of the energy over the value from its quadratic fit; inf where one is
    missing.
    """
    x = np.array([row.value for row in rows])
    y = np.array([row.energy for row in rows])
    if not np.isfinite(y).all():
        return float("inf")
    scaled = x / x.max()
    return float(100.0 * np.max(np.abs(np.polyval(np.polyfit(scaled, y, 2), scaled) / y - 1.0)))


def spread(rows: Sequence[Row]) -> float:
    """(max - min) / min of J [%]; inf where one is missing."""
    J = np.array([row.J for row in rows])
    return float(100.0 * (J.max() / J.min() - 1.0)) if np.isfinite(J).all() else float("inf")


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, CELLS, 10, "5 payloads, 2 seeds, 2 cells")
    parser.add_argument("--steps", type=int, default=10, help="payloads above 0 kg; default: 10")
    given = parser.parse_args()
    if given.quick:
        given.steps, given.seeds = min(given.steps, 5), min(given.seeds, 2)
        given.cell = given.cell or CELLS[3:]
    return given


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    rows = over_payloads(load_cell("demo"), given.steps)
    print(*(line_of(asdict(row)) for row in rows), sep="\n", flush=True)
    claims: list[Claim] = []
    name = (
        f"demo: residual of {len(rows)} payloads up to {HEAVIEST:.4g} kg from their quadratic fit"
    )
    claims.append(at_most(name, noise(rows), "%", 1.0))
    for name in given.cell or CELLS:
        cell = load_cell(name)
        ceiling = PlanOptions(planning_time=CEILING)
        seeds = [planned(cell, "seed", k, replace(ceiling, seed=k)) for k in range(given.seeds)]
        much = planned(cell, "max_iterations", MUCH, replace(ceiling, max_iterations=MUCH))
        print(*(line_of(asdict(row)) for row in (*seeds, much)), sep="\n", flush=True)
        more = 100.0 * (much.J / seeds[0].J - 1.0)
        claims += [
            at_most(f"{name}: spread of J over {given.seeds} seeds", spread(seeds), "%", 1.0),
            at_most(
                f"{name}: J with ten times the work above that with the default",
                more,
                "%",
                ROUNDING,
            ),
        ]
        rows += [*seeds, much]
    finish(given.json, [asdict(row) for row in rows], claims)


if __name__ == "__main__":
    main()
