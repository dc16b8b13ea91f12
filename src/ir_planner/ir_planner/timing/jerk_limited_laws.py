"""Jerk-limited time laws s(t) from 0 to 1, at rest at both ends, on a grid of 1 ms.

A TimeLaw has seven phases of constant jerk: jerk up, constant acceleration, jerk down, constant
speed, and the same for braking; the two halves may differ. A LevelLaw steps down in levels, with
much acceleration while slow and less near full speed: the torque envelope of a drive falls with its
speed, so one acceleration for the whole ramp is too much at its end or too little at its start.

All durations are whole milliseconds. Switches of several laws then never come closer than 1 ms,
stretching by a factor of six decimals keeps whole nanoseconds, and the interpolant of the points is
the law itself. Given the durations, speed, accelerations and jerks follow from the distance 1:
rounding durations up never breaks a limit.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from ir_values.arrays import FloatArray, IntArray

GRID_S = 1e-3
GRID_NS = 1_000_000
_NEWTON_STEPS = 40


class LawLimits(NamedTuple):
    """Bounds of s, arrays (K,) of K candidate laws: speed 1/s, acceleration and braking 1/s^2,
    their jerks 1/s^3.
    """

    speed: FloatArray
    acceleration: FloatArray
    braking: FloatArray
    jerk: FloatArray


def _ramp(
    speed: FloatArray, acceleration: FloatArray, jerk: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Durations (jerk phase, constant acceleration) (K,) s of a ramp from rest to `speed`.

    The two jerk phases alone gain a^2 / j. Below that the acceleration is not reached, and each
    phase takes sqrt(v / j).
    """
    full = speed * jerk >= acceleration * acceleration
    phase = np.where(full, acceleration / jerk, np.sqrt(speed / jerk))
    constant = np.where(full, speed / acceleration - acceleration / jerk, 0.0)
    return phase, np.maximum(constant, 0.0)


def reached_speed(limits: LawLimits) -> FloatArray:
    """Largest speed (K,) 1/s that the distance 1 allows, at most the limit.

    The distance of both ramps grows with the speed and is convex, so Newton's steps from above stay
    above.
    """
    speed = limits.speed.copy()
    for _ in range(_NEWTON_STEPS):
        up, up_slope = _ramp_distance(speed, limits.acceleration, limits.jerk)
        down, down_slope = _ramp_distance(speed, limits.braking, limits.jerk)
        excess = up + down - 1.0
        if np.all(excess <= 1e-14):
            break
        speed = speed - np.maximum(excess, 0.0) / (up_slope + down_slope)
    return speed


def _ramp_distance(
    speed: FloatArray, acceleration: FloatArray, jerk: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Distance (K,) of a ramp between rest and `speed`, and its derivative by the speed.

    A ramp is symmetric, so its distance is v / 2 times its duration: v / a + a / j, or 2 sqrt(v /
    j) where the acceleration is not reached.
    """
    full = speed * jerk >= acceleration * acceleration
    root = np.sqrt(speed / jerk)
    distance = np.where(
        full, 0.5 * speed * (speed / acceleration + acceleration / jerk), speed * root
    )
    slope = np.where(full, speed / acceleration + 0.5 * acceleration / jerk, 1.5 * root)
    return distance, slope


def phase_steps(limits: LawLimits) -> IntArray:
    """Durations (K, 7) in grid steps of the fastest laws within `limits`; rounded up, so never
    faster.
    """
    speed = reached_speed(limits)

    # what both ramps don't cover of the distance 1 is left for constant speed
    up, steady = _ramp(speed, limits.acceleration, limits.jerk)
    down, slowing = _ramp(speed, limits.braking, limits.jerk)
    covered = 0.5 * speed * (2 * up + steady + 2 * down + slowing)
    cruise = np.maximum(1.0 - covered, 0.0) / speed
    exact = np.stack([up, steady, up, cruise, down, slowing, down], axis=-1) / GRID_S
    steps = np.ceil(exact - 1e-9).astype(np.int64)
    steps[:, (0, 2, 4, 6)] = np.maximum(steps[:, (0, 2, 4, 6)], 1)
    return steps


class LawStates(NamedTuple):
    """Laws at the 8 switches of their phases: times (K, 8) s, s, its derivatives (K, 8), and jerk
    (K, 7).
    """

    times: FloatArray
    s: FloatArray
    sd: FloatArray
    sdd: FloatArray
    jerk: FloatArray


def law_states(steps: IntArray) -> LawStates:
    """States of the laws with phases `steps` (K, 7) of GRID_S each, at the eight instants between
    the phases (K, 8), and their jerks (K, 7): s goes from 0 to 1, derivatives are per s, s^2, s^3.

    The first half is integrated from 0, the second back from 1: both ends are met exactly.
    """
    t = steps * GRID_S
    cruise = t[:, 3]

    # Durations alone determine the law. Each ramp covers v / 2 times its duration, the cruise v
    # times its own, and all is 1: that gives v. A ramp of phases t0, t1, t0 gains j t0 (t0 + t1) =
    # v.
    rise = t[:, 0] * (t[:, 0] + t[:, 1])
    fall = t[:, 4] * (t[:, 4] + t[:, 5])
    both_ramps = 2 * t[:, 0] + t[:, 1] + 2 * t[:, 4] + t[:, 5]
    speed = 1.0 / (0.5 * both_ramps + cruise)
    jerk = np.zeros(steps.shape)
    jerk[:, 0] = speed / rise
    jerk[:, 2] = -speed / rise
    jerk[:, 4] = -speed / fall
    jerk[:, 6] = speed / fall

    s, sd, sdd = np.zeros((3, len(steps), 8))
    peak = jerk[:, 0] * t[:, 0]
    brake = jerk[:, 4] * t[:, 4]
    sdd[:, 1] = peak
    sdd[:, 2] = peak
    sdd[:, 5] = brake
    sdd[:, 6] = brake

    sd[:, 1] = 0.5 * peak * t[:, 0]
    sd[:, 2] = sd[:, 1] + peak * t[:, 1]
    sd[:, 3] = speed
    sd[:, 4] = speed
    sd[:, 6] = -0.5 * brake * t[:, 6]
    sd[:, 5] = sd[:, 6] - brake * t[:, 5]

    s[:, 7] = 1.0
    for k in (0, 1, 2):
        gained = t[:, k] * (sdd[:, k] / 2 + jerk[:, k] * t[:, k] / 6)
        s[:, k + 1] = s[:, k] + t[:, k] * (sd[:, k] + gained)
    for k in (6, 5, 4):
        gained = t[:, k] * (sdd[:, k + 1] / 2 - jerk[:, k] * t[:, k] / 6)
        s[:, k] = s[:, k + 1] - t[:, k] * (sd[:, k + 1] - gained)
    ends = np.cumsum(steps, axis=1) * GRID_S
    times = np.concatenate([np.zeros((len(t), 1)), ends], axis=1)
    return LawStates(times, s, sd, sdd, jerk)


@dataclass(frozen=True)
class TimeLaw:
    """One law: its seven phases in grid steps."""

    steps: tuple[int, ...]

    @property
    def total(self) -> int:
        """Duration in grid steps."""
        return sum(self.steps)

    @property
    def ramp_up(self) -> int:
        """Grid steps until the speed is constant."""
        return sum(self.steps[:3])

    @property
    def ramp_down(self) -> int:
        """Grid steps of braking."""
        return sum(self.steps[4:])

    def switches(self) -> IntArray:
        """Grid steps at which a phase starts or ends, (M,) ascending without doubles."""
        return np.unique(np.concatenate([[0], np.cumsum(self.steps)]))

    def at(self, steps: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """s, sd, sdd (M,) at grid steps (M,); at rest before 0 and after the end."""
        states = law_states(np.array([self.steps]))
        ends = np.concatenate([[0], np.cumsum(self.steps)])
        inside = np.clip(steps, 0, self.total)
        phase = np.clip(np.searchsorted(ends, inside, side="right") - 1, 0, 6)
        # the second half is measured back from its end, so that the law closes exactly
        anchor = np.where(phase < 4, phase, phase + 1)
        tau = (inside - ends[anchor]) * GRID_S
        j = states.jerk[0, phase]
        s0 = states.s[0, anchor]
        v0 = states.sd[0, anchor]
        a0 = states.sdd[0, anchor]
        s = s0 + tau * (v0 + tau * (a0 / 2 + j * tau / 6))
        return s, v0 + tau * (a0 + j * tau / 2), a0 + j * tau


class Law(Protocol):
    """What blending needs of a law, in grid steps."""

    @property
    def total(self) -> int:
        """Duration."""

    @property
    def ramp_up(self) -> int:
        """Until the speed is constant."""

    @property
    def ramp_down(self) -> int:
        """Of braking."""

    def switches(self) -> IntArray:
        """Where a phase starts or ends, (M,)."""

    def at(self, steps: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """s, sd, sdd (M,)."""


@dataclass(frozen=True)
class StepLaws:
    """Laws of one straight step: one for all joints (synchronous), or one for each
    (asynchronous).
    """

    laws: tuple[Law, ...]

    @property
    def total(self) -> int:
        """Duration in grid steps."""
        return max(law.total for law in self.laws)

    @property
    def ramp_up(self) -> int:
        """Grid steps at the start in which the next-door movement may still brake; none where
        joints differ.
        """
        return self.laws[0].ramp_up if len(self.laws) == 1 else 0

    @property
    def ramp_down(self) -> int:
        """Grid steps at the end in which the next movement may already start; none where joints
        differ.
        """
        return self.laws[0].ramp_down if len(self.laws) == 1 else 0

    def switches(self) -> IntArray:
        """Grid steps (K,) at which a phase of any joint starts or ends, ascending without
        doubles.
        """
        return np.unique(np.concatenate([law.switches() for law in self.laws]))

    def at(self, steps: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """s, sd, sdd (M, 1 or n) at grid steps (M,)."""
        states = [law.at(steps) for law in self.laws]
        s, sd, sdd = (np.stack([state[k] for state in states], axis=1) for k in range(3))
        return s, sd, sdd


# Laws whose ramps have a level of acceleration per band of speed, joined by constant jerk.

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
    LEVELS), all > 0.
    """
    rising = _ramp_level_law(speed, up, jerk)
    falling = _ramp_level_law(speed, down, jerk)
    levels_up = _at_ends(up)
    levels_down = _at_ends(down)
    reached_up, length_up = _gains(rising, levels_up)
    reached_down, length_down = _gains(falling, levels_down)

    # Braking has to lose what speeding up gained: its accelerations are scaled by that. The law
    # that comes of it covers `distance` and is scaled to 1 at the end.
    scale = reached_up / reached_down
    left = np.maximum(1.0 - length_up - scale * length_down, 0.0)
    cruise = np.ceil(left / reached_up / GRID_S - 1e-9).astype(np.int64)
    distance = length_up + scale * length_down + reached_up * cruise * GRID_S
    steps = np.concatenate([rising, cruise[:, None], falling[:, ::-1]], axis=1)
    # the last level before the cruise is 0, and so is the first after it: both ends of the cruising
    # phase
    ends = np.concatenate([levels_up, -scale[:, None] * levels_down[:, ::-1]], axis=1)
    return LevelLaws(steps, ends / distance[:, None])


def _ramp_level_law(speed: FloatArray, levels: FloatArray, jerk: float) -> IntArray:
    """Durations (K, 2 LEVELS + 1) of a ramp: change of level, level, change, ..., change to 0."""
    around = np.concatenate(
        [np.zeros((len(levels), 1)), levels, np.zeros((len(levels), 1))], axis=1
    )

    # A change of level takes |a1 - a0| / j and gains the mean of both times that. It counts by
    # halves in the bands of speed on either side; the first and the last belong to one band.
    change = np.abs(np.diff(around, axis=1)) / jerk
    gained = 0.5 * change * (around[:, :-1] + around[:, 1:])
    share = np.full(gained.shape, 0.5)
    share[:, 0] = 1.0
    share[:, -1] = 1.0

    # each level is held for what its band still lacks
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
