"""Exact signed distances, collision checks and proofs of motion for a robot among bodies.

A distance is that of two surfaces: positive apart, zero in touch, and where they overlap minus the
depth of penetration, which is the shortest translation that parts them (for one capsule and one
body).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ir_kernels import compiled, data
from ir_kernels.chain import Chain
from ir_kernels.data import BodyLike, CapsuleLike
from ir_kernels.errors import KernelError
from ir_kernels.geometry import COLLIDES, FREE, UNDECIDED, Geometry, Pair, geometry
from ir_values.arrays import BoolArray, FloatArray, IntArray

__all__ = [
    "COLLIDES",
    "FREE",
    "UNDECIDED",
    "Certificate",
    "Certificates",
    "CollisionModel",
    "MinDistance",
    "Witnesses",
]


@dataclass(frozen=True, eq=False)
class Witnesses:
    """One pair per row: distance (N,) [m], points on the surfaces of body_a and body_b (N, 3), and
    the unit normal (N, 3) from b to a: point_a - point_b = distance * normal, also in penetration.
    All in the world.
    """

    distance: FloatArray
    pair: IntArray
    point_a: FloatArray
    point_b: FloatArray
    normal: FloatArray


@dataclass(frozen=True, eq=False)
class MinDistance(Witnesses):
    """The nearest pair of each configuration; distance +inf and pair -1 where there is no pair."""


class Certificates(NamedTuple):
    """Verdicts (N,) FREE, COLLIDES or UNDECIDED; interval [t0, t1] (N,) of the first violation, and
    its pair (N,).

    Everything before t0 is proved. COLLIDES: at t1 the pair's distance isn't above its threshold.
    UNDECIDED: neither could be shown in [t0, t1]; count it as unsafe. FREE: t0 = t1 = 1 and pair
    -1.
    """

    verdict: NDArray[np.uint8]
    t0: FloatArray
    t1: FloatArray
    pair: IntArray


class Certificate(NamedTuple):
    """The same for one trajectory: interval in s from its start, FREE: both at its end.

    lower_bound [m]: for FREE a proven lower bound of distance - threshold over all pairs and times,
    else
    -inf.
    """

    verdict: int
    interval: tuple[float, float]
    pair: int
    lower_bound: float


class CollisionModel:
    """Capsules on the links of a chain, bodies of the scene, and the Z pairs whose distances count.

    Pairs: every capsule with every body (capsule by capsule), but those of link 0 (nothing of them
    moves) and those in `ignored_pairs`; then `self_pairs` of capsules. All by name. Immutable:
    build another one when a door opens or a load is attached (about a millisecond). Raises
    KernelError for data that make no sense.
    """

    def __init__(
        self,
        chain: Chain,
        capsules: Sequence[CapsuleLike],
        bodies: Sequence[BodyLike],
        self_pairs: Iterable[tuple[str, str]],
        ignored_pairs: Iterable[tuple[str, str]] = (),
    ) -> None:
        self.chain = chain
        self._geometry: Geometry = geometry(chain, capsules, bodies, self_pairs, ignored_pairs)
        self.pairs: tuple[Pair, ...] = self._geometry.pairs
        self._core = core_of(self._geometry, compiled.MODULE)
        self._no_offset = np.zeros(len(self.pairs))

    def _per_pair(self, value: ArrayLike, name: str) -> FloatArray:
        """`value` for every pair: one number, or (Z,); -inf is allowed, NaN and +inf aren't."""
        values = np.asarray(value, dtype=np.float64)
        if values.shape not in ((), (len(self.pairs),)):
            raise KernelError(
                f"{name} has shape {values.shape}: expected one number or ({len(self.pairs)},)"
            )
        if not (values < np.inf).all():
            raise KernelError(
                f"{name} holds nan or +inf: expected lengths in m, or -inf to ignore a pair"
            )
        return np.ascontiguousarray(values) if values.ndim else np.full(len(self.pairs), values)

    def distances(self, q: ArrayLike) -> FloatArray:
        """(N, Z): signed distances [m] of all pairs at q (N, n)."""
        found: FloatArray = self._core.distances(self.chain.checked(q))
        return found

    def min_distance(self, q: ArrayLike, offset: ArrayLike | None = None) -> MinDistance:
        """The pair of least distance - offset (Z,) [m] at each q (N, n), and its true distance.

        With the safety distances as offset it is the pair that comes nearest to violating its own;
        an offset of -inf leaves a pair out.
        """
        shift = self._no_offset if offset is None else self._per_pair(offset, "offset")
        distance, pair, point_a, point_b, normal = self._core.min_distance(
            self.chain.checked(q), shift
        )
        return MinDistance(distance, pair, point_a, point_b, normal)

    def nearest(self, q: FloatArray, offset: FloatArray) -> tuple[float, int]:
        """Distance [m] and number of the pair of least distance - offset (Z,) at one q (n,); inf
        and -1 where there is none. Nothing is checked: for loops that ask all the time.
        """
        distance, pair, *_ = self._core.min_distance(q[None], offset)
        return float(distance[0]), int(pair[0])

    def witnesses(self, q: ArrayLike, pair: ArrayLike) -> Witnesses:
        """Distance, nearest points and normal of one pair (N,) at each q (N, n)."""
        q = self.chain.checked(q)
        pair = data.indices(pair, "pair", (len(q),), len(self.pairs))
        distance, point_a, point_b, normal, _ = self._core.witnesses(q, pair, False)
        return Witnesses(distance, pair, point_a, point_b, normal)

    def gradients(self, q: ArrayLike, pair: ArrayLike) -> FloatArray:
        """(N, n): derivative of the distance of one pair (N,) by the joint values at each q (N, n)
        [m/rad].

        The distance has a kink where two places are equally near; there it is the derivative of one
        of them.
        """
        q = self.chain.checked(q)
        pair = data.indices(pair, "pair", (len(q),), len(self.pairs))
        gradient: FloatArray = self._core.witnesses(q, pair, True)[-1]
        return gradient

    def is_free(self, q: ArrayLike, threshold: ArrayLike) -> BoolArray:
        """(N,): whether every pair's distance exceeds its threshold (one number or (Z,)) [m] at q
        (N, n).

        A threshold of -inf ignores the pair. Stops at the first pair that is too near.
        """
        free: BoolArray = self._core.is_free(
            self.chain.checked(q), self._per_pair(threshold, "threshold")
        )
        return free

    def certify_edges(self, q0: ArrayLike, q1: ArrayLike, threshold: ArrayLike) -> Certificates:
        """Whether all distances exceed their threshold everywhere on the straight segments q0 (N,
        n) to q1 (N, n).

        A FREE verdict is a proof: rounding is counted. See reference.certify for the bound. Raises
        KernelError for shapes that do not fit.
        """
        start = self.chain.checked(q0, "q0")
        goal = self.chain.checked(q1, "q1")
        if len(start) != len(goal):
            raise KernelError(f"q1 has {len(goal)} rows: expected {len(start)} as q0")
        limit = self._per_pair(threshold, "threshold")
        return Certificates(*self._core.certify_edges(start, goal, limit))

    def certify_trajectory(
        self, coefficients: ArrayLike, durations: ArrayLike, threshold: ArrayLike
    ) -> Certificate:
        """The same for one trajectory of segments q(t) = sum_k c_k t^k, t from the start of the
        segment [s].

        coefficients (S, n, K), lowest power first (quintics: K = 6); durations (S,) [s], not
        negative. Raises KernelError for durations that are not above 0.
        """
        c = data.array(coefficients, "coefficients", (None, self.chain.n, None))
        span = data.array(durations, "durations", (len(c),))
        if (span < 0.0).any():
            raise KernelError(f"durations holds {span.min()} s: expected at least 0")
        limit = self._per_pair(threshold, "threshold")
        verdict, begin, end, pair, bound = self._core.certify_trajectory(c, span, limit)
        return Certificate(verdict, (begin, end), pair, bound)


def core_of(geometry: Geometry, module: compiled.Core) -> compiled.Core:
    """The model of one compiled module, or the one in NumPy where that is None."""
    if module is None:
        # half of the import time, for those who need it
        from ir_kernels.reference.model import (
            Model,
        )

        return Model(geometry)
    chain = geometry.chain
    capsules = geometry.capsules
    scene = geometry.scene
    return module.Model(
        chain.joint_origin,
        chain.joint_axis,
        chain.base_pose,
        chain.first_slides,
        capsules.link,
        capsules.ends,
        capsules.radius,
        scene.kind,
        scene.pose,
        scene.size,
        [(hull.vertices, hull.sides, hull.normals, hull.offsets) for hull in scene.hulls],
        geometry.environment,
        geometry.self_pairs,
    )
