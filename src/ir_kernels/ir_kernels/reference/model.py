"""The collision model in NumPy, with the methods of the compiled one (cpp/geometry.cpp): arrays
that are checked in, tuples of arrays out.
"""

import numpy as np
from numpy.typing import NDArray

from ir_kernels.geometry import FREE, Geometry
from ir_kernels.reference import certify, collision
from ir_values.arrays import BoolArray, FloatArray, IntArray

NearestPairs = tuple[FloatArray, IntArray, FloatArray, FloatArray, FloatArray]
Verdicts = tuple[NDArray[np.uint8], FloatArray, FloatArray, IntArray]


class Model:
    """Distances of one geometry. See ir_kernels.collision.CollisionModel for what the methods
    promise.
    """

    def __init__(self, geometry: Geometry) -> None:
        self.geometry = geometry

    def _segments(self, q: FloatArray) -> FloatArray:
        return collision.ends(self.geometry, collision.poses(self.geometry, q))

    def distances(self, q: FloatArray) -> FloatArray:
        """(N, Z)."""
        return collision.distances(self.geometry, self._segments(q))

    def min_distance(self, q: FloatArray, offset: FloatArray) -> NearestPairs:
        """Distance (N,), pair (N,), point a, point b, normal (N, 3) at q (N, n) with offset
        (Z,).
        """
        segments = self._segments(q)
        pair = collision.nearest(collision.distances(self.geometry, segments), offset)
        found = pair >= 0
        near = collision.witnesses(self.geometry, segments[found], pair[found])
        distance = np.full(len(q), np.inf)
        vectors = np.full((3, len(q), 3), np.nan)
        distance[found] = near.distance
        vectors[:, found] = near.on_segment, near.on_body, near.normal
        return distance, pair, vectors[0], vectors[1], vectors[2]

    def witnesses(
        self, q: FloatArray, pair: IntArray, gradient: bool
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Distance (N,), point a, point b, normal (N, 3), gradient (N, n), empty unless asked
        for.
        """
        poses = collision.poses(self.geometry, q)
        found = collision.witnesses(self.geometry, collision.ends(self.geometry, poses), pair)
        slope = (
            collision.gradient(self.geometry, poses, found, pair)
            if gradient
            else np.zeros((0, q.shape[1]))
        )
        return found.distance, found.on_segment, found.on_body, found.normal, slope

    def is_free(self, q: FloatArray, threshold: FloatArray) -> BoolArray:
        """(N,)."""
        return collision.is_free(self.distances(q), threshold)

    def certify_edges(self, q0: FloatArray, q1: FloatArray, threshold: FloatArray) -> Verdicts:
        """Verdict, t0, t1, pair (N,) of edges q0, q1 (N, n) with threshold (Z,)."""
        return certify.certify(self.geometry, certify.Edges(q0, q1), threshold)[:4]

    def certify_trajectory(
        self, coefficients: FloatArray, durations: FloatArray, threshold: FloatArray
    ) -> tuple[int, float, float, int, float]:
        """Verdict, interval from the start, pair, proven bound; coefficients (S, n, 6), durations
        (S,).
        """
        found = certify.certify(
            self.geometry, certify.Polynomials(coefficients, durations), threshold
        )
        unsafe = np.flatnonzero(found.verdict != FREE)
        if not len(unsafe):
            total = float(durations.sum())
            return FREE, total, total, -1, float(found.bound.min(initial=np.inf))
        k = int(unsafe[0])
        begin = float(durations[:k].sum())
        t0 = begin + float(found.t0[k])
        t1 = begin + float(found.t1[k])
        return int(found.verdict[k]), t0, t1, int(found.pair[k]), -np.inf
