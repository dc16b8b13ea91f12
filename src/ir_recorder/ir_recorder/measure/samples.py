"""What a robot did, sample by sample on one grid: motion, mode, load and, where there is a meter,
watts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ir_description import Load
from ir_msgs_py.arrays import BoolArray, FloatArray, IntArray

UNKNOWN = -1
MOVING = 0.002  # rad/s: less than the slowest planned motion, more than the noise of a held joint


@dataclass(frozen=True, eq=False)
class Samples:
    """M samples of `step` [s]; each value belongs to the whole step.

    time (M,) s: middles of the steps. q, qd, qdd (M, n). mode (M,): place in the names of modes,
    UNKNOWN in transitions and where nobody knows; load (M,): place in `loads`, UNKNOWN as well.
    watts (M,): mean at the mains, NaN where it wasn't measured. motors (M,): whether the drives are
    on.
    """

    step: float
    time: FloatArray
    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    mode: IntArray
    load: IntArray
    motors: BoolArray
    watts: FloatArray
    loads: tuple[tuple[Load, ...], ...]

    @property
    def known(self) -> BoolArray:
        """Samples (M,) in which motion, mode and load are known."""
        return np.asarray(
            np.isfinite(self.q).all(axis=1) & (self.mode != UNKNOWN) & (self.load != UNKNOWN)
        )

    @property
    def moving(self) -> BoolArray:
        """Samples (M,) in which any joint moves."""
        return np.asarray((np.abs(np.nan_to_num(self.qd)) > MOVING).any(axis=1))

    def __len__(self) -> int:
        return len(self.time)

    def part(self, start: float, end: float) -> Samples:
        """The samples whose middles lie between two times [s]."""
        rows = (self.time >= start) & (self.time < end)
        arrays = {
            field.name: getattr(self, field.name)[rows]
            for field in fields(self)
            if field.name not in ("step", "loads")
        }
        return replace(self, **arrays)


def movements(
    samples: Samples, shortest: float = 0.3, pause: float = 0.2
) -> tuple[tuple[int, int], ...]:
    """Rows (first, behind the last) of stretches in which the robot moves for at least `shortest`
    [s]; a stop of less than `pause` [s] belongs to the movement.
    """
    moving = samples.moving & samples.known
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]]).astype(int)))
    runs: list[list[int]] = []
    for first, behind in edges.reshape(-1, 2).tolist():
        if runs and (first - runs[-1][1]) * samples.step < pause:
            runs[-1][1] = behind
        else:
            runs.append([first, behind])
    return tuple((a, b) for a, b in runs if (b - a) * samples.step >= shortest)


def one_load(loads: Sequence[Load], count: int) -> tuple[tuple[tuple[Load, ...], ...], IntArray]:
    """What `Samples` takes as loads and load (count,) where the same is held all the time."""
    return (tuple(loads),), np.zeros(count, np.int64)
