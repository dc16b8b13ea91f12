"""Clearance in the view: access to stations, nearest pair of a posture, bodies in a sentence."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ir_cli.station_access import StationVisit, visits
from ir_description import Cell, PartPlaces
from ir_kernels import CollisionModel
from ir_msgs_py.options import DEFAULT_SAFETY_DISTANCE
from ir_msgs_py.report import PlannedMovement
from ir_planner.configurations import free_configurations, no_configuration
from ir_recorder.analysis.clearance import allowed_pairs, collision_model
from ir_values.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class StationAccess:
    """A station with one load: configurations that reach it, how many of them are free, and the
    best one.

    clearance [m] of q (n,) and its nearest pair (None, (): none reaches it); sentence: why none is
    free.
    """

    station: str
    load: str
    reached: int
    free: int
    clearance: float | None
    q: FloatArray | None
    pair: tuple[str, str] | tuple[()]
    sentence: str


def station_accesses(cell: Cell, first: Collection[str] = ()) -> Iterator[StationAccess]:
    """Every station as the program finds it, those of `first` before the others."""
    yield from map(_judged, sorted(visits(cell), key=lambda visit: visit.station.name not in first))


def _judged(visit: StationVisit) -> StationAccess:
    """How near a station comes to anything: in the cheapest free configuration, else in the one
    that lacks least; without any, the sentence says why.
    """
    station = visit.station
    scene = visit.scene
    threshold = scene.thresholds(DEFAULT_SAFETY_DISTANCE, station.name)
    found = free_configurations(station.pose, scene, threshold, scene.cell.machine_home)
    free = len(found.q)
    q = found.q
    sentence = ""
    if not free:
        q = scene.inverse_kinematics.solve(np.asarray(station.pose)[None]).q
        sentence = no_configuration(station.pose, scene, found, station.name).message
    access = StationAccess(
        station=station.name,
        load=scene.load_text,
        reached=0,
        free=0,
        clearance=None,
        q=None,
        pair=(),
        sentence=sentence,
    )
    if not len(q):
        return access
    access = replace(access, reached=found.reached, free=free)
    near = scene.collision.min_distance(q, threshold)
    if not len(scene.collision.pairs):
        return replace(access, q=q[0])
    k = 0 if free else int(np.argmax(near.distance - threshold[near.pair]))
    pair = scene.collision.pairs[int(near.pair[k])]
    return replace(
        access, clearance=float(near.distance[k]), q=q[k], pair=(pair.body_a, pair.body_b)
    )


@dataclass(frozen=True, eq=False)
class Nearest:
    """Two bodies, their signed distance [m] and nearest points (3,) [m] in the world."""

    names: tuple[str, str]
    distance: float
    point_a: FloatArray
    point_b: FloatArray

    @property
    def text(self) -> str:
        """In words."""
        return f"{1e3 * self.distance:.1f} mm: {self.names[0]} and {self.names[1]}"


class NearestPairs:
    """Finds the nearest pair in a cell; keeps the model of it until what is held or lies there
    changes.
    """

    def __init__(self) -> None:
        self._model: tuple[object, CollisionModel] | None = None
        self._cell: Cell | None = None

    def at(
        self,
        cell: Cell,
        q: FloatArray,
        load: str,
        places: PartPlaces,
        movement: PlannedMovement | None,
    ) -> Nearest | None:
        """At q (n,), without pairs that the movement's stations allow to touch; None: there is
        none.
        """
        model = self._of(cell, load, places)
        offset = np.zeros(len(model.pairs))
        if movement is not None and movement.trajectory is not None:
            offset[~np.isnan(allowed_pairs(cell, movement, model))] = -np.inf
        found = model.min_distance(q[None], offset)
        if not np.isfinite(found.distance[0]) or found.pair[0] < 0:
            return None
        pair = model.pairs[int(found.pair[0])]
        points = found.point_a[0], found.point_b[0]
        return Nearest((pair.body_a, pair.body_b), float(found.distance[0]), *points)

    def _of(self, cell: Cell, load: str, places: PartPlaces) -> CollisionModel:
        key = (load, places.held, tuple(sorted(places.lying.items())))
        if self._model is None or self._model[0] != key or self._cell is not cell:
            self._model = (key, collision_model(cell, load, places))
            self._cell = cell
        return self._model[1]


_PROSE = "robot's base"
"""What sentences say that is no capsule, though one is called so."""
_WORD = re.compile(r"[A-Za-z][\w.-]*")


def names_in(sentence: str, cell: Cell) -> frozenset[str]:
    """Bodies and capsules of the cell that the sentence names."""
    bodies = {body.name for machine in cell.equipment for body in machine.bodies}
    parts = {body.name for part in cell.parts for body in part.bodies}
    held = {capsule.name for part in cell.parts for capsule in part.load.capsules}
    known = bodies | parts | held | {capsule.name for capsule in cell.capsules()}
    words = _WORD.findall(sentence.replace(_PROSE, ""))
    return frozenset(known.intersection(word.rstrip(".") for word in words))
