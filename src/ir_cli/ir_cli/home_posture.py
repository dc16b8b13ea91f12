"""A machine home for a robot that has none: free, above the floor, and held without effort."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ir_cli.robot_shapes import FLOOR_ROOM, floor_below, lowest_points
from ir_cli.self_pairs import ROOM, SAFETY, Pairs
from ir_description import InvalidValueError
from ir_description.files.making import UrdfArm, holding_torques
from ir_description.shapes import Capsule
from ir_kernels import Chain, CollisionModel
from ir_values.arrays import BoolArray, FloatArray

USUAL = (
    (0, 0, 0, 0, 0, 0),
    (0, 0, 0, 0, 30, 0),
    (0, -90, 90, 0, 0, 0),
    (0, -90, 90, 0, 30, 0),
    (0, 0, 0, 0, -30, 0),
    (0, -90, -90, -90, 90, 0),
    (0, -90, 90, -90, -90, 0),
    (0, -30, 60, 0, 30, 0),
    (0, 30, -60, 0, -30, 0),
)
"""deg: postures in which arms are usually drawn or parked."""
ROOMS = ((0.01, 0.01), (0.01, 0.9 * ROOM), (0.01, 0.3 * ROOM), (1e-4, 1e-4))
"""m more than pairs must keep, the first that some posture has: of pairs with the safety distance,
and of pairs that are near by construction.
"""
LEAST = ROOMS[-1][0]
HELD = 0.7  # of the peak torque
_INSIDE = np.radians(2.0)  # from both ends of an axis
_TRIED = 4000


class Postures:
    """Which postures of an arm are free and can be held."""

    def __init__(
        self,
        arm: UrdfArm,
        capsules: tuple[Capsule, ...],
        pairs: Pairs,
        limits: tuple[FloatArray, FloatArray],
        peak: FloatArray,
        payload: float,
    ) -> None:
        self._arm = arm
        self._chain = Chain(arm)
        self._capsules = capsules
        self._model = CollisionModel(self._chain, capsules, (), pairs.pairs)
        own = {frozenset(each[:2]): each.distance for each in pairs.reduced}
        self._kept = np.array(
            [min(SAFETY, own.get(frozenset((a, b)), SAFETY)) for _, a, b in self._model.pairs]
        )
        self._reduced = np.array(
            [frozenset((a, b)) in own for _, a, b in self._model.pairs], dtype=bool
        )
        self._floor = floor_below(self._chain, capsules)
        self._low, self._high = limits
        self._peak = peak
        self._payload = payload

    def home(self) -> FloatArray:
        """The first (6,) [rad] that is free and held. Raises InvalidValueError where none is."""
        for room in ROOMS:
            for q in self._candidates():
                good = self._free(q, *room) & self._above_floor(q) & self._held(q)
                if good.any():
                    return np.asarray(q[int(np.argmax(good))])
        raise InvalidValueError(self._reason())

    def _candidates(self) -> Iterator[FloatArray]:
        inside = np.minimum(_INSIDE, 0.25 * (self._high - self._low))
        low = self._low + inside
        high = self._high - inside
        middle = 0.5 * (low + high)
        yield np.clip(np.radians([*USUAL]), low, high)
        yield middle[None]
        drawn = np.random.default_rng(0).uniform(low, high, (_TRIED, len(low)))
        yield drawn[np.argsort(np.abs(drawn - middle).max(axis=1), kind="stable")]

    def _free(self, q: FloatArray, room: float, reduced: float) -> BoolArray:
        wanted = self._kept + np.where(self._reduced, reduced, room)
        return np.asarray((self._model.distances(q) > wanted).all(axis=1))

    def _above_floor(self, q: FloatArray) -> BoolArray:
        """Whether the links after the first stay above the floor (N,)."""
        others = [each for each in self._capsules if each.link > 1]
        return np.asarray(lowest_points(self._chain, q, others) > self._floor + FLOOR_ROOM - LEAST)

    def _held(self, q: FloatArray) -> BoolArray:
        torque = np.abs(holding_torques(self._arm, q, self._payload))
        return np.asarray((torque < HELD * self._peak).all(axis=1))

    def _reason(self) -> str:
        """Why no posture will do."""
        *_, drawn = self._candidates()
        distance = self._model.distances(drawn) - self._kept
        far = (distance > 0.0).mean(axis=0)
        counts = {
            "free of itself": self._free(drawn, *ROOMS[-1]),
            "above the floor": self._above_floor(drawn),
            "held by its drives": self._held(drawn),
        }
        shares = ", ".join(f"{100.0 * good.mean():.0f} % {name}" for name, good in counts.items())
        worst = ""
        swept = list[str]()
        if len(far) and far.min() < 1.0:
            pair = self._model.pairs[int(np.argmin(far))]
            worst = f"; nearest most often: {pair.body_a} and {pair.body_b}"
            swept = self._swept({pair.body_a, pair.body_b})
        remedy = (
            "give machine_home_deg or gear_peak_torque_nm in a drive sheet (ir robot new "
            "--template)"
        )
        if not counts["free of itself"].any() and swept:
            words = " ".join(f"--without {link}" for link in swept)
            remedy = (
                "what joints beside the planned axes carry fills all that they can reach: leave "
                f"it out ({words})"
            )
        elif not counts["free of itself"].any():
            remedy = (
                "give collision shapes that are nearer to the real links, whose capsules overlap "
                "or whose bodies meet wherever the joints turn, or leave one out (--without LINK)"
            )
        return f"no machine home was found: of {_TRIED} postures are {shares}{worst}; {remedy}"

    def _swept(self, names: set[str]) -> list[str]:
        """What joints beside the planned axes move, of the links of capsules."""
        links = {each.link for each in self._capsules if each.name in names}
        shapes = [shape for link in sorted(links) for shape in self._arm.links[link].shapes]
        return [*dict.fromkeys(shape.motions[-1].child for shape in shapes if shape.motions)]
