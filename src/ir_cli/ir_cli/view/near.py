"""The nearest pair of a posture, as the live view of a running cell finds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ir_description import Cell, PartPlaces
from ir_kernels import CollisionModel
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import PlannedMovement
from ir_recorder.analysis.clearance import allowed_pairs, collision_model


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
