"""What a trajectory must keep clear of, and where along it the contacts of its station are allowed.

An allowed contact belongs to a station: it counts where the tcp is surely in the zone of the
station's machine or within a margin of it, as for who watches the robot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_sim_driver.controller.contact_scene import ContactScene

_FINEST = 2e-3  # m of movement of the tcp in which entering the zone is found
_ORDERS = np.arange(6)
_SHIFT = np.array([[math.comb(k, j) for k in range(6)] for j in range(6)], dtype=float)  # Taylor's


class Piece(NamedTuple):
    """A part of a path with coefficients (S, n, 6) and durations (S,) [s] along which the distances
    (Z,) [m] must be kept.
    """

    coefficients: FloatArray
    durations: FloatArray
    thresholds: FloatArray


@dataclass(frozen=True, eq=False)
class Keep:
    """Distances (Z,) [m] that the pairs of a scene must keep outside the zone of a station, and
    inside; ""
    and None: there is no such station.
    """

    scene: ContactScene
    outside: FloatArray
    station: str = ""
    inside: FloatArray | None = None

    def at(self, q: FloatArray) -> FloatArray:
        """What counts at q (n,)."""
        if self.inside is None or not self.scene.inside(q, self.station):
            return self.outside
        return self.inside

    def pieces(self, coefficients: FloatArray, durations: FloatArray) -> Iterator[Piece]:
        """The path of segments (S, n, 6) with durations (S,) [s], one piece after the other."""
        if self.inside is None:
            yield Piece(coefficients, durations, self.outside)
            return
        parts, spans, inside = self._divided(coefficients, durations)
        bounds = [0, *(np.flatnonzero(np.diff(inside)) + 1).tolist(), len(spans)]
        for a, b in pairwise(bounds):
            yield Piece(parts[a:b], spans[a:b], self.inside if inside[a] else self.outside)

    def _divided(
        self, coefficients: FloatArray, durations: FloatArray
    ) -> tuple[FloatArray, FloatArray, BoolArray]:
        """The same path in halves of its segments until each is inside or not: whether it is,
        (S,).
        """
        parts = coefficients
        spans = durations
        order: FloatArray = np.arange(len(spans), dtype=float)  # places along the path
        width = np.ones(len(spans))
        done: list[tuple[FloatArray, FloatArray, FloatArray, BoolArray]] = []
        while len(spans):
            depth = self.scene.depth(np.ascontiguousarray(parts[:, :, 0]), self.station)
            travel = self._travel(parts, spans)
            known = (np.abs(depth) > travel) | (travel < _FINEST)
            done.append((order[known], parts[known], spans[known], depth[known] > travel[known]))
            first = parts[~known]
            half = 0.5 * spans[~known]
            there = order[~known]
            wide = 0.5 * width[~known]
            parts = np.concatenate((first, _later(first, half)))
            spans = np.concatenate((half, half))
            width = np.concatenate((wide, wide))
            order = np.concatenate((there, there + wide))
        columns = [np.concatenate(column) for column in zip(*done, strict=True)]
        along = np.argsort(columns[0])
        return columns[1][along], columns[2][along], columns[3][along]

    def _travel(self, parts: FloatArray, spans: FloatArray) -> FloatArray:
        """Bound (S,) [m] of how far the tcp gets from the start of each segment."""
        far = np.abs(parts) * spans[:, None, None] ** _ORDERS
        travel: FloatArray = far[:, :, 1:].sum(axis=2) @ self.scene.tcp_reach
        return travel


def _later(parts: FloatArray, by: FloatArray) -> FloatArray:
    """The polynomials (S, n, 6) from `by` (S,) [s] on."""
    lag = by[:, None, None] ** np.maximum(_ORDERS - _ORDERS[:, None], 0) * _SHIFT
    later: FloatArray = np.einsum("sjk,snk->snj", lag, parts)
    return later
