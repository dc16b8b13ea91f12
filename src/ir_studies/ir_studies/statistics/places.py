"""Random pairs of places of a cell: where regional movements begin and end. These are the ends of
the withdrawals from its stations, the ends of its tasks, and home.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ir_description import cell_hash, load_cell
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner
from ir_sim_driver.plant import plant_hash, plant_named
from ir_studies.errors import StudyError
from ir_studies.statistics.settings import StatisticsSettings
from ir_studies.work.read_files import PLANT, digest_of_tasks

NEAREST = 0.002  # m that a place keeps
CANDIDATES = 8  # withdrawals of a station, in different configurations
LONGEST = 600.0  # s: work ends a request, not the clock
SHARE_OF_ENDS = (
    0.8  # of the clearance at the ends of a movement, where that is less than the safety distance
)


@dataclass(frozen=True, eq=False)
class Place:
    """A named place, its configurations (K, n) and what each keeps (K,) [m] to the nearest body."""

    name: str
    q: FloatArray
    clearance: FloatArray


@dataclass(frozen=True, eq=False)
class Pair:
    """From start to goal (n,), with their names; margin [m]: the safety distance that both ends
    allow.
    """

    names: tuple[str, str]
    start: FloatArray
    goal: FloatArray
    margin: float


def places_of(planner: Planner, load: str) -> tuple[Place, ...]:
    """All places that keep NEAREST. StudyError where there are fewer than two."""
    cell = planner.cell
    named = {"home": np.array(cell.machine_home)[None]}
    for task in cell.tasks:
        first, _, last = task.name.partition("->")
        named |= {
            first: np.array(task.start)[None],
            last or f"{first} goal": np.array(task.goal)[None],
        }
    options = PlanOptions(load=load, planning_time=LONGEST)
    for station in cell.stations:
        found = planner.plan_service(
            station.name, "exit", None, cell.machine_home, CANDIDATES, options
        )
        outside = [candidate.outside for candidate in found.candidates]
        named[station.name] = np.array(outside).reshape(-1, cell.robot.n)
    places = [_free(planner, name, q, load) for name, q in named.items()]
    kept = tuple(place for place in places if len(place.q))
    if len(kept) < 2:
        raise StudyError(f"the cell {cell.name} has no two places that keep {NEAREST * 1e3:g} mm")
    return kept


def read_by(settings: StatisticsSettings) -> dict[str, str]:
    """Digests of the cell, its tasks and the plant."""
    cell = load_cell(settings.cell)
    plant = plant_named(settings.plant_of(0), cell.robot, cell.robot.controller)
    tasks = digest_of_tasks(settings.cell, cell)
    return {settings.cell: cell_hash(cell), f"{PLANT}{settings.plant}": plant_hash(plant), **tasks}


def _free(planner: Planner, name: str, q: FloatArray, load: str) -> Place:
    scene = planner.scene(load)
    clearance = scene.collision.min_distance(q).distance if len(q) else np.zeros(0)
    kept = clearance >= NEAREST
    return Place(name, q[kept], clearance[kept])


def pair_of(places: tuple[Place, ...], seed: int, number: int, safety_distance: float) -> Pair:
    """Pair `number` of a seed: two different places, each in a configuration drawn for it."""
    rng = np.random.default_rng([seed, number])
    first, last = (places[k] for k in rng.choice(len(places), 2, replace=False))
    i = int(rng.integers(len(first.q)))
    j = int(rng.integers(len(last.q)))
    least = float(min(first.clearance[i], last.clearance[j]))
    margin = min(safety_distance, SHARE_OF_ENDS * least)
    return Pair((first.name, last.name), first.q[i], last.q[j], margin)
