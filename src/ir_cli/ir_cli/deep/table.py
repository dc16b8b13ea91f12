"""Every station with all its configurations: what each meets there and on the line out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ir_cli.offline.output import Columns, Row, number, text
from ir_description import Cell

from .lines import Line, lines_of
from .stations import Visit, visits

CONFIGURATIONS: Columns = {
    "station": ("station", text),
    "held": ("held", text),
    "lying": ("lying", text),
    "joints_deg": ("configuration deg", text),
    "clearance": ("clearance mm", number(1, 1e3)),
    "at_station": ("at the station", text),
    "line_out": ("line in and out", text),
}


def configurations_of(cell: Cell) -> list[Row]:
    """One row for each configuration in each situation; one that says so where none reaches the
    station.
    """
    return [row for visit in visits(cell) for row in _rows(visit)]


def _rows(visit: Visit) -> Iterator[Row]:
    distance = visit.station.approach_distance
    there = lines_of(visit, 0.0)
    out = lines_of(visit, distance)
    situation = {"station": visit.station.name, "held": visit.scene.load_text, "lying": visit.lying}
    if not there:
        yield situation | {
            "joints_deg": "",
            "clearance": None,
            "at_station": "not reached",
            "line_out": "",
        }
    for here, line in zip(there, out, strict=True):
        nearest = visit.scene.collision.min_distance(here.q[None]).distance[0]
        yield situation | {
            "joints_deg": " ".join(f"{round(angle):d}" for angle in np.degrees(here.q)),
            "clearance": float(nearest),
            "at_station": here.sentence or "free",
            "line_out": _said(line) if distance > 0.0 else "no approach_distance",
        }


def _said(line: Line) -> str:
    return line.sentence or f"free, {1e3 * line.reach:.0f} mm"
