"""What a robot can do at the stations of a cell: configurations that reach them, and what
obstructs.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ir_cli.offline.output import Row
from ir_description import Cell, Station
from ir_msgs_py.arrays import FloatArray
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.program.route import Route
from ir_planner.program.steps import Scenes, placed_steps
from ir_planner.scene import PlanningScene

MARGIN = 0.02  # m, the default of a request
_SAME = 1e-6  # rad


@dataclass(frozen=True, eq=False)
class Visit:
    """A station with what is held there, where the parts lie and how the doors stand."""

    station: Station
    scene: PlanningScene

    @property
    def lying(self) -> str:
        """Which parts lie where: "gear at pallet", "" for none."""
        return ", ".join(
            f"{part.name} at {part.station}" for part in self.scene.cell.parts if part.station
        )


def visits(cell: Cell) -> Iterator[Visit]:
    """Every station as the program finds it when it arrives and when it leaves; as it is before the
    program where that does not go. Each situation once.
    """
    scenes = Scenes(cell, cell.robot.controller)
    route = Route.over(placed_steps(cell, cell.program, cell.parts_at_start()), scenes)
    found: dict[str, list[PlanningScene]] = {station.name: [] for station in cell.stations}
    for place in range(len(route)):
        if route.at(place).step.kind == "STATION":
            found[route.name(place)] += [route.arriving(place), route.leaving(place)]
    start = scenes.of(cell.parts_at_start())
    for name, situations in found.items():
        once = {id(scene): scene for scene in situations or [start]}
        yield from (Visit(cell.station(name), scene) for scene in once.values())


def reaching(visit: Visit) -> FloatArray:
    """Configurations (K, n) that reach a station, free or not, those that differ by whole turns
    once: the one nearest to machine home.
    """
    home = visit.scene.cell.machine_home
    q = visit.scene.inverse_kinematics.solve(np.asarray(visit.station.pose)[None]).q
    kept: list[FloatArray] = []
    for one in q[np.argsort(np.abs(q - home).sum(axis=1), kind="stable")]:
        if all(np.abs(np.sin(0.5 * (one - other))).max() > _SAME for other in kept):
            kept.append(one)
    return np.array(kept).reshape(-1, len(home))


def stations_of(cell: Cell) -> list[Row]:
    """One row per situation at a station: configurations that reach it, how many of them keep 20 mm
    (or what the station allows), the best clearance, and the obstructing pairs where none does.
    """
    return [_row(visit, cell) for visit in visits(cell)]


def _row(visit: Visit, cell: Cell) -> Row:
    station = visit.station
    scene = visit.scene
    threshold = scene.thresholds(MARGIN, station.name)
    found = free_configurations(station.pose, scene, threshold, cell.machine_home)
    none = (
        "" if len(found.q) else no_configuration(station.pose, scene, found, station.name).message
    )
    clearances = scene.collision.min_distance(found.q, threshold).distance if len(found.q) else ()
    return {
        "station": station.name,
        "load": scene.load_text,
        "reached": found.reached,
        "free": len(found.q),
        "clearance": float(max(clearances)) if len(found.q) else None,
        "obstacle": none,
    }
