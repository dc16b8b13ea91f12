"""Time laws whose ramps step down in levels: much acceleration while slow, less near full speed.

The torque envelope of a drive falls with its speed, so one acceleration for the whole ramp is
either too much at its end or too little at its start. Here each ramp has a level per band of speed,
joined by constant jerk. Durations are whole grid steps; the accelerations follow from the distance
1 and equal speed of both ramps.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ir_msgs_py.arrays import FloatArray, IntArray
from ir_planner.timing.time_law import GRID_S

BANDS = np.array([0.6, 0.84, 1.0])  # upper ends of the bands, as shares of the cruising speed
LEVELS = len(BANDS)
PHASES = 4 * LEVELS + 3


@dataclass(frozen=True)
class LevelLaws:
    """K laws: phases (K, PHASES) grid steps, accelerations (K, PHASES + 1) 1/s^2 at their ends,
    linear between.
    """

    steps: IntArray
    accelerations: FloatArray

    @cached_property
    def speeds(self) -> FloatArray:
        """Speed (K, PHASES + 1) 1/s at the ends of the phases."""
        t = self.steps * GRID_S
        a = self.accelerations
        gains = 0.5 * t * (a[:, :-1] + a[:, 1:])
        return np.concatenate([np.zeros((len(t), 1)), np.cumsum(gains, axis=1)], axis=1)

    @cached_property
    def path_parameters(self) -> FloatArray:
        """s (K, PHASES + 1) at the ends of the phases."""
        t = self.steps * GRID_S
        a = self.accelerations
        v = self.speeds
        gains = t * (v[:, :-1] + t * (2.0 * a[:, :-1] + a[:, 1:]) / 6.0)
        return np.concatenate([np.zeros((len(t), 1)), np.cumsum(gains, axis=1)], axis=1)

    @property
    def jerks(self) -> FloatArray:
        """Jerk (K, PHASES) 1/s^3; 0 in phases that are empty."""
        t = self.steps * GRID_S
        change = np.diff(self.accelerations, axis=1)
        return np.asarray(np.divide(change, t, out=np.zeros_like(change), where=self.steps > 0))


@dataclass(frozen=True)
class LevelLaw:
    """One of them, with the interface of a TimeLaw."""

    steps: tuple[int, ...]
    accelerations: tuple[float, ...]

    @property
    def total(self) -> int:
        """Duration in grid steps."""
        return sum(self.steps)

    @property
    def ramp_up(self) -> int:
        """Grid steps until the speed is constant."""
        return sum(self.steps[: 2 * LEVELS + 1])

    @property
    def ramp_down(self) -> int:
        """Grid steps of braking."""
        return sum(self.steps[2 * LEVELS + 2 :])

    def switches(self) -> IntArray:
        """Grid steps at which a phase starts or ends, (M,) ascending without doubles."""
        return np.unique(np.concatenate([[0], np.cumsum(self.steps)]))

    def at(self, steps: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """s, sd, sdd (M,) at grid steps (M,); at rest before 0 and after the end."""
        laws = LevelLaws(np.array([self.steps]), np.array([self.accelerations]))
        ends = np.concatenate([[0], np.cumsum(self.steps)])
        inside = np.clip(steps, 0, self.total)
        phase = np.clip(np.searchsorted(ends, inside, side="right") - 1, 0, PHASES - 1)
        tau = (inside - ends[phase]) * GRID_S
        a = laws.accelerations[0]
        v = laws.speeds[0]
        s = laws.path_parameters[0]
        j = laws.jerks[0]
        sdd = a[phase] + j[phase] * tau
        sd = v[phase] + tau * (a[phase] + j[phase] * tau / 2)
        here = s[phase] + tau * (v[phase] + tau * (a[phase] / 2 + j[phase] * tau / 6))
        over = inside >= self.total
        return np.where(over, 1.0, here), np.where(over, 0.0, sd), np.where(over, 0.0, sdd)


def level_laws(speed: FloatArray, up: FloatArray, down: FloatArray, jerk: float) -> LevelLaws:
    """Laws that cruise at about `speed` (K,) and whose ramps have levels `up` and `down` (K,
    LEVELS), all >
    0.
    """
    rising = _ramp(speed, up, jerk)
    falling = _ramp(speed, down, jerk)
    levels_up = _at_ends(up)
    levels_down = _at_ends(down)
    reached_up, length_up = _gains(rising, levels_up)
    reached_down, length_down = _gains(falling, levels_down)
    scale = reached_up / reached_down
    left = np.maximum(1.0 - length_up - scale * length_down, 0.0)
    cruise = np.ceil(left / reached_up / GRID_S - 1e-9).astype(np.int64)
    distance = length_up + scale * length_down + reached_up * cruise * GRID_S
    steps = np.concatenate([rising, cruise[:, None], falling[:, ::-1]], axis=1)
    # the last level before the cruise is 0, and so is the first after it: both ends of the cruising
    # phase
    ends = np.concatenate([levels_up, -scale[:, None] * levels_down[:, ::-1]], axis=1)
    return LevelLaws(steps, ends / distance[:, None])


def _ramp(speed: FloatArray, levels: FloatArray, jerk: float) -> IntArray:
    """Durations (K, 2 LEVELS + 1) of a ramp: change of level, level, change, ..., change to 0."""
    around = np.concatenate(
        [np.zeros((len(levels), 1)), levels, np.zeros((len(levels), 1))], axis=1
    )
    change = np.abs(np.diff(around, axis=1)) / jerk
    gained = 0.5 * change * (around[:, :-1] + around[:, 1:])
    share = np.full(gained.shape, 0.5)
    share[:, 0] = share[:, -1] = 1.0
    bands = np.diff(np.concatenate([[0.0], BANDS])) * speed[:, None]
    by_change = gained[:, :-1] * share[:, :-1] + gained[:, 1:] * share[:, 1:]
    hold = np.maximum(bands - by_change, 0.0) / levels
    result = np.zeros((len(levels), 2 * LEVELS + 1))
    result[:, ::2] = change
    result[:, 1::2] = hold
    steps = np.ceil(result / GRID_S - 1e-9).astype(np.int64)
    steps[:, ::2] = np.maximum(steps[:, ::2], 1)
    return steps


def _at_ends(levels: FloatArray) -> FloatArray:
    """Accelerations (K, 2 LEVELS + 2) at the ends of a ramp's phases."""
    ends = np.zeros((len(levels), 2 * LEVELS + 2))
    ends[:, 1:-1:2] = levels
    ends[:, 2:-1:2] = levels
    return ends


def _gains(steps: IntArray, ends: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speed and length in s (K,) of a ramp from rest."""
    t = steps * GRID_S
    gains = 0.5 * t * (ends[:, :-1] + ends[:, 1:])
    before = np.cumsum(gains, axis=1) - gains
    length = t * (before + t * (2.0 * ends[:, :-1] + ends[:, 1:]) / 6.0)
    return gains.sum(axis=1), length.sum(axis=1)
