"""Which excursions: greedily the one that says most per second, by the determinant of the
information.

The information of an excursion is what its windows of 50 ms, with the noise of a meter and a model,
say of the parameters beyond their prior (D-optimal design; Fedorov, 1972).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ir_cli.excitation.pool import Excursion
from ir_description import IDLE, Load, PowerParameters
from ir_msgs_py.arrays import FloatArray
from ir_recorder.measure import PowerModel, planned_samples

WINDOW = 0.05  # s
NOISE = 60.0  # W of a window in motion: what fits leave
REST = 0.6  # s beside each movement
IDENTIFIED = 0.8  # of the deviation before: at most so much is left


@dataclass(frozen=True, eq=False)
class Identified:
    """What a programme says of the parameters: names, and the share (P,) of their deviation that is
    left.
    """

    names: tuple[str, ...]
    left: FloatArray

    @property
    def found(self) -> tuple[str, ...]:
        """Those that the programme identifies."""
        return tuple(n for n, left in zip(self.names, self.left, strict=True) if left < IDENTIFIED)

    @property
    def missing(self) -> tuple[str, ...]:
        """Those that it does not."""
        return tuple(n for n, left in zip(self.names, self.left, strict=True) if left >= IDENTIFIED)


class Design:
    """Excursions chosen one after another for a model and a prior."""

    def __init__(self, model: PowerModel, prior: PowerParameters) -> None:
        self._model = model
        self._prior = prior
        self._free = prior.deviation > 0.0
        self._scale = np.where(self._free, prior.deviation, 0.0)
        self._information = np.eye(len(self._scale))  # in deviations of the prior

    def of(self, excursion: Excursion, loads: Sequence[Load]) -> FloatArray:
        """Information (P, P) of an excursion, out and back."""
        total = np.zeros_like(self._information)
        for trajectory in (excursion.out, excursion.back):
            samples = planned_samples(trajectory, loads, self._prior.modes)
            _, slopes = self._model.watts_and_slopes(self._prior.mean, self._model.prepare(samples))
            scaled = slopes * self._scale / NOISE
            total += scaled.T @ scaled * (samples.step / WINDOW)
        return np.asarray(total)

    def choose(
        self, pool: Sequence[Excursion], informations: Sequence[FloatArray], seconds: float
    ) -> list[Excursion]:
        """Excursions of the pool, with the information (P, P) of each, at most once each, until
        they take so long together.
        """
        left = list(range(len(pool)))
        chosen = []
        taken = 0.0
        while left and taken < seconds:
            root = np.linalg.cholesky(np.linalg.inv(self._information))
            cost = [pool[k].seconds + 2.0 * REST for k in left]
            gains = [
                np.linalg.slogdet(np.eye(len(root)) + root.T @ informations[k] @ root)[1] / each
                for k, each in zip(left, cost, strict=True)
            ]
            best = int(np.argmax(gains))
            taken += cost[best]
            k = left.pop(best)
            chosen.append(pool[k])
            self._information = self._information + informations[k]
        return chosen

    def rest(self, mode: str, loads: Sequence[Load], seconds: float, q: FloatArray) -> None:
        """Count a stay of so many seconds in a mode at q (n,)."""
        still = np.zeros(len(self._scale))
        still[self._prior.index(f"watts.{mode}")] = 1.0
        watts = sum(load.watts_always for load in loads)
        if mode in ("STAND_ON_MOTORS", "STAND_ON_BRAKES"):
            watts += sum(load.watts_drive_bus for load in loads)
        still[self._prior.index("tool_watts")] = watts
        if mode == "STAND_ON_MOTORS":
            still[self._prior.index("drives_watts")] = still[self._prior.index(IDLE)] = 1.0
        scaled = still * self._scale
        self._information = (
            self._information + np.outer(scaled, scaled) * seconds / WINDOW / NOISE**2
        )

    def identified(self) -> Identified:
        """What is known of each parameter after all that was chosen."""
        left = np.sqrt(np.diag(np.linalg.inv(self._information)))
        return Identified(self._prior.names, np.where(self._free, left, 1.0))
