"""What a robot can do at the stations of a cell: configurations that reach them, and what obstructs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ir_description import Cell, PartPlaces, Station
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.program.steps import Scenes
from ir_planner.scene import PlanningScene

from .output import Row

MARGIN = 0.02  # m, the default of a request


@dataclass(frozen=True, eq=False)
class Visit:
    """A station with what is held there and where the parts lie."""

    station: Station
    scene: PlanningScene


def visits(cell: Cell) -> Iterator[Visit]:
    """Every station as the program finds it when it arrives and as it leaves it; as it is before the program
    where that does not go. Each situation once.
    """
    scenes = Scenes(cell, cell.robot.controller)
    start = cell.parts_at_start()
    found: dict[str, list[PartPlaces]] = {station.name: [] for station in cell.stations}
    places = start
    for step in cell.program:
        after = places.after(step)
        if step.kind == "STATION":
            found[step.target] += [places, after]
        places = after
    for name, situations in found.items():
        scenes_there = {id(scene): scene for scene in map(scenes.of, situations or [start])}
        yield from (Visit(cell.station(name), scene) for scene in scenes_there.values())


def stations_of(cell: Cell) -> list[Row]:
    """One row per situation at a station: configurations that reach it, how many of them keep 20 mm (or what
    the station allows), the best clearance, and the obstructing pairs where none does.
    """
    return [_row(visit, cell) for visit in visits(cell)]


def _row(visit: Visit, cell: Cell) -> Row:
    station, scene = visit.station, visit.scene
    threshold = scene.thresholds(MARGIN, station.name)
    found = free_configurations(station.pose, scene, threshold, cell.machine_home)
    none = "" if len(found.q) else no_configuration(station.pose, scene, found, station.name).message
    clearances = scene.collision.min_distance(found.q, threshold).distance if len(found.q) else ()
    return {
        "station": station.name,
        "load": scene.load_text,
        "reached": found.reached,
        "free": len(found.q),
        "clearance": float(max(clearances)) if len(found.q) else None,
        "obstacle": none,
    }
