"""What the robot can do at each station, with the configuration that does it best and its nearest
pair.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass

import numpy as np

from ir_description import Cell
from ir_msgs_py.arrays import FloatArray
from ir_planner.configurations import free_configurations, no_configuration

from ..deep.stations import MARGIN, Visit, visits


@dataclass(frozen=True, eq=False)
class Judged:
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


def judged(cell: Cell, first: Collection[str] = ()) -> Iterator[Judged]:
    """Every station as the program finds it, those of `first` before the others."""
    yield from map(_judged, sorted(visits(cell), key=lambda visit: visit.station.name not in first))


def _judged(visit: Visit) -> Judged:
    station = visit.station
    scene = visit.scene
    threshold = scene.thresholds(MARGIN, station.name)
    found = free_configurations(station.pose, scene, threshold, scene.cell.machine_home)
    free = len(found.q)
    q = found.q
    if not free:
        q = scene.inverse_kinematics.solve(np.asarray(station.pose)[None]).q
    sentence = "" if free else no_configuration(station.pose, scene, found, station.name).message
    if not len(q):
        return Judged(station.name, scene.load_text, 0, 0, None, None, (), sentence)
    near = scene.collision.min_distance(q, threshold)
    if not len(scene.collision.pairs):
        return Judged(station.name, scene.load_text, found.reached, free, None, q[0], (), sentence)
    k = 0 if free else int(np.argmax(near.distance - threshold[near.pair]))
    pair = scene.collision.pairs[int(near.pair[k])]
    names = (pair.body_a, pair.body_b)
    clearance = float(near.distance[k])
    return Judged(
        station.name, scene.load_text, found.reached, free, clearance, q[k], names, sentence
    )
