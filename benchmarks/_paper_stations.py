"""Stations to reach and to leave: those of bundled cells, and of cells changed by seed."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from _paper_result import Row
from _regional_tasks import scene_of_cell
from _service_stations import S_M, SHARE_OF_BEST, margin_at
from _variants import variant

from ir_description import Station, load_cell
from ir_planner.configurations import free_configurations
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

Key = tuple[int, str, str, int]  # seed, cell, station, draw
CELLS = ("cnc_door", "deep_box", "demo", "table_columns", "open")
MARGIN = (
    f"S_m is {1e3 * S_M:g} mm, or {100 * SHARE_OF_BEST:g} % of the best clearance at the station "
    "where that is less."
)


@dataclass(frozen=True, eq=False)
class Place:
    """A station with its scene, S_m [m], and all free configurations q (K, n) there, K >= 1."""

    scene: PlanningScene
    station: Station
    margin: float
    q: FloatArray

    @property
    def words(self) -> Row:
        """What rows say of it."""
        return {
            "cell": self.scene.cell.name,
            "station": self.station.name,
            "zone": self.station.zone,
        }

    @property
    def threshold(self) -> FloatArray:
        """Distance (Z,) m that each pair must exceed."""
        return self.scene.thresholds(self.margin, self.station.name)


def places(cells: tuple[str, ...], seed: int, variants: int) -> Iterator[Place]:
    """Stations that have a free configuration, of so many variants of each cell; with an even seed
    the first of them is the cell as it is.
    """
    for name in cells:
        cell = load_cell(name)
        for k in range(variants):
            one = cell if seed % 2 == k == 0 else variant(cell, 100 + seed, k)
            scene = scene_of_cell(one)
            for station in one.stations:
                margin = margin_at(scene, station)
                kept = scene.thresholds(margin, station.name)
                q = free_configurations(station.pose, scene, kept, np.array(one.park)).q
                if len(q):
                    yield Place(scene, station, margin, q)


def of_reading(rows: Sequence[Row], reading: str) -> dict[Key, Row]:
    """Rows of one reading of an equation by seed, cell, station and draw."""
    return {
        (row["seed"], row["cell"], row["station"], row.get("draw", 0)): row
        for row in rows
        if row["reading"] == reading
    }


def difference(
    rows: Sequence[Row], one: str, other: str, success: Callable[[Row], float]
) -> tuple[list[float], list[Key]]:
    """Success of one reading less the other's [percentage points] where both were tried, and of
    what each is.
    """
    a = of_reading(rows, one)
    b = of_reading(rows, other)
    both = [key for key in a if key in b]
    return [100.0 * (success(a[key]) - success(b[key])) for key in both], both


def cells_of(keys: Iterable[Key]) -> list[tuple[int, str]]:
    """Seed and cell of each: stations of one cell stand among the same machines, cells are drawn
    apart.
    """
    return [key[:2] for key in keys]
