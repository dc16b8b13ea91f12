"""What a robot can do at the stations of a cell: configurations that reach them, and what obstructs."""

from __future__ import annotations

import time

from ir_description import Cell, cell_to_yaml
from ir_planner import Planner, parse_goal

from .output import Row

MARGIN = 0.02  # m, the default of a request


def stations_of(cell: Cell) -> list[Row]:
    """One row per station and load: configurations that reach it, how many of them keep 20 mm (or what the
    station allows), the best clearance, and the obstructing pairs where none does.
    """
    planner = Planner(time.monotonic)
    planner.set_cell(cell_to_yaml(cell), "")
    return [_row(planner, station, load) for station, load in _visits(cell)]


def _row(planner: Planner, station: str, load: str) -> Row:
    cell = planner.cell
    answer = planner.compute_ik(parse_goal(station, cell), "analytic", MARGIN, cell.machine_home, load)
    dropped = sum(rejection.count for rejection in answer.info.rejected)
    clearances = [solution.clearance for solution in answer.solutions]
    return {
        "station": station,
        "load": load,
        "reached": dropped + len(clearances),
        "free": len(clearances),
        "clearance": max(clearances, default=None),
        "obstacle": "" if clearances else answer.status.message,
    }


def _visits(cell: Cell) -> list[tuple[str, str]]:
    """Every station with what the program holds there when it arrives and when it leaves; the tool where the
    program does not go.
    """
    places = cell.parts_at_start()
    held: dict[str, dict[str, None]] = {station.name: {} for station in cell.stations}
    for step in cell.program:
        after = places.after(step)
        if step.kind == "STATION":
            for each in (places, after):
                held[step.target][_load_text(cell, each.held)] = None
        places = after
    return [(name, load) for name, loads in held.items() for load in (loads or [_load_text(cell, "")])]


def _load_text(cell: Cell, held: str) -> str:
    names = [cell.tool.name] if cell.tool is not None else []
    return "+".join([*names, held] if held else names) or "none"
