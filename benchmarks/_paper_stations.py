"""Stations to reach and to leave: those of bundled cells, and of cells changed by seed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from _regional_tasks import scene_of_cell
from _service_stations import margin_at
from _variants import variant

from ir_description import Station, load_cell
from ir_msgs_py.arrays import FloatArray
from ir_planner.configurations import free_configurations
from ir_planner.scene import PlanningScene

CELLS = ("cnc_door", "deep_box", "demo", "table_columns", "open")


@dataclass(frozen=True, eq=False)
class Place:
    """A station with its scene, S_m [m], and all free configurations q (K, n) there, K >= 1."""

    scene: PlanningScene
    station: Station
    margin: float
    q: FloatArray

    @property
    def label(self) -> str:
        """Cell and station."""
        return f"{self.scene.cell.name} {self.station.name}"

    @property
    def threshold(self) -> FloatArray:
        """Distance (Z,) m that each pair must exceed."""
        return self.scene.thresholds(self.margin, self.station.name)


def places(cells: tuple[str, ...], seed: int, variants: int) -> Iterator[Place]:
    """Stations that have a free configuration, of so many variants of each cell; with seed 0 the first of
    them is the cell as it is.
    """
    for name in cells:
        cell = load_cell(name)
        for k in range(variants):
            one = cell if seed == 0 and k == 0 else variant(cell, 100 + seed, k)
            scene = scene_of_cell(one)
            for station in one.stations:
                margin = margin_at(scene, station)
                kept = scene.thresholds(margin, station.name)
                q = free_configurations(station.pose, scene, kept, np.array(one.park)).q
                if len(q):
                    yield Place(scene, station, margin, q)
