"""A robotic cell as the public benchmark describes it: robots that pass through places in a cycle.

A robot stays at each of its stops once in a cycle, at one of the stop's places, and moves along
hops in between; which hops, and so in which order, is open. Times are seconds, energies joules.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class EnergyCurve:
    """Energy over duration: the sum of coefficient * duration**degree.

    Terms that are convex over positive durations stay as they are; the others are bounded from
    below by their chord over [least, most], so tangents are nowhere above the curve.
    """

    terms: tuple[tuple[int, float], ...]
    least: float
    most: float

    def energy(self, duration: float) -> float:
        """What the movement needs [J] in a duration [s]."""
        return float(sum(c * duration**p for p, c in self.terms))

    def tangent(self, duration: float) -> tuple[float, float]:
        """Slope [W] and value at zero [J] of a line that is nowhere above the curve."""
        slope = 0.0
        zero = 0.0
        for p, c in self.terms:
            if _bends_up(p, c) or self.most <= self.least:
                steep = c * p * duration ** (p - 1)
                at = c * duration**p - steep * duration
            else:
                low = c * self.least**p
                steep = (c * self.most**p - low) / (self.most - self.least)
                at = low - steep * self.least
            slope += steep
            zero += at
        return slope, zero

    def cheapest(self) -> float:
        """The duration of least energy, within 1e-9 of the range."""
        grid = np.linspace(self.least, self.most, 65)
        values = [self.energy(t) for t in grid]
        k = int(np.argmin(values))
        low = grid[max(k - 1, 0)]
        high = grid[min(k + 1, len(grid) - 1)]
        golden = (5.0**0.5 - 1.0) / 2.0
        for _ in range(60):
            a = high - golden * (high - low)
            b = low + golden * (high - low)
            low, high = (low, b) if self.energy(a) <= self.energy(b) else (a, high)
        return float((low + high) / 2.0)


def _bends_up(degree: int, coefficient: float) -> bool:
    return coefficient * degree * (degree - 1) >= 0.0


@dataclass(frozen=True)
class HopMovement:
    """One way to do a hop: from a place to a place."""

    number: int
    start: int
    end: int
    curve: EnergyCurve


@dataclass(frozen=True)
class DynamicActivity:
    """A dynamic activity: from one stop to another, by one of its movements."""

    number: int
    start: int
    end: int
    movements: tuple[HopMovement, ...]


@dataclass(frozen=True)
class StopLocation:
    """A location of a stop; power: W by mode of the robot."""

    number: int
    point: int
    power: Mapping[int, float]


@dataclass(frozen=True)
class StaticActivity:
    """A static activity: how long it may take, and where; closes: the last of the robot's cycle."""

    number: int
    least: float
    most: float
    places: tuple[StopLocation, ...]
    closes: bool = False


@dataclass(frozen=True)
class InstanceRobot:
    """Stops and hops; modes: the shortest wait [s] by power mode."""

    name: str
    stops: tuple[StaticActivity, ...]
    hops: tuple[DynamicActivity, ...]
    modes: Mapping[int, float]

    @property
    def closing(self) -> StaticActivity:
        """The stop after which the cycle begins again."""
        return next(stop for stop in self.stops if stop.closes)


@dataclass(frozen=True)
class TimeLag:
    """start of `later` - start of `earlier` >= length - height * cycle."""

    earlier: int
    later: int
    length: float
    height: int


@dataclass(frozen=True)
class Handover:
    """Places of two stops that fit together: pairs of their numbers."""

    stops: tuple[int, int]
    pairs: frozenset[tuple[int, int]]


@dataclass(frozen=True)
class Conflict:
    """Two activities that may not overlap in time when both are done so: each the number of an
    activity and of its place or movement.
    """

    first: tuple[int, int]
    second: tuple[int, int]


@dataclass(frozen=True)
class Instance:
    """A cell with its cycle [s]."""

    name: str
    cycle: float
    robots: tuple[InstanceRobot, ...]
    lags: tuple[TimeLag, ...] = ()
    handovers: tuple[Handover, ...] = ()
    conflicts: tuple[Conflict, ...] = ()
    robot_of: Mapping[int, int] = field(init=False)

    def __post_init__(self) -> None:
        owner: dict[int, int] = {}
        for k, robot in enumerate(self.robots):
            owner |= dict.fromkeys((stop.number for stop in robot.stops), k)
            owner |= dict.fromkeys((hop.number for hop in robot.hops), k)
        object.__setattr__(self, "robot_of", owner)


@dataclass(frozen=True)
class ScheduledActivity:
    """An activity of a schedule: place or movement by its number, power mode of a stop (-1: a
    movement), start and duration [s], energy [J].
    """

    activity: int
    choice: int
    mode: int
    start: float
    duration: float
    energy: float


@dataclass(frozen=True)
class Schedule:
    """What each robot does in a cycle, in order."""

    robots: tuple[tuple[ScheduledActivity, ...], ...]

    @property
    def energy(self) -> float:
        """Energy of a cycle [J]."""
        return float(sum(done.energy for robot in self.robots for done in robot))


@dataclass(frozen=True)
class ModeRange:
    """A range of durations of a stay at a place in which one power mode is cheapest."""

    mode: int
    power: float
    least: float
    most: float


def stay_ranges(
    stop: StaticActivity, place: StopLocation, modes: Mapping[int, float]
) -> list[ModeRange]:
    """The lower envelope of power over duration: disjoint ranges, each with its cheapest mode."""
    begins = sorted({max(stop.least, shortest) for shortest in modes.values()})
    ranges: list[ModeRange] = []
    for k, begin in enumerate(begins):
        end = begins[k + 1] if k + 1 < len(begins) else stop.most
        end = min(end, stop.most)
        if begin > stop.most:
            break
        open_modes = [mode for mode, shortest in modes.items() if shortest <= begin]
        mode = min(open_modes, key=lambda each: (place.power[each], modes[each], each))
        if ranges and ranges[-1].mode == mode:
            ranges[-1] = ModeRange(mode, place.power[mode], ranges[-1].least, end)
        else:
            ranges.append(ModeRange(mode, place.power[mode], begin, end))
    return ranges
