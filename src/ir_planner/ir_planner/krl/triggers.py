"""When triggers act: the instants of a movement that TRIGGER WHEN DISTANCE and WHEN PATH mean."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ir_krl.run import Switch, Target
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.krl.blended_motions import Move
from ir_planner.krl.geometry import Arm
from ir_planner.timing import GRID_S
from ir_values.arrays import FloatArray

# As KUKA's manual for system integrators has it (KSS 8, TRIGGER): DISTANCE=0 is the start of the
# motion, where that is a rounded corner the end of the rounding; DISTANCE=1 is its end, in a
# rounded corner the middle of the rounding. DELAY shifts an instant within the motion, in a rounded
# corner within the rounding. PATH is measured along the tool's path from the end of the motion or
# of the spline's part, with ONSTART from its start; it leads no farther than to the start of the
# motion and, over a rounded corner, to the next one. What leads farther acts at that limit.

_RATE = 500.0  # Hz, of the samples of a path: between them its speed hardly changes
_MINIMUM = 2  # samples
_SAME = 0.5 * GRID_S  # s


@dataclass(frozen=True)
class MotionInstants:
    """A motion of a movement, or a part of a spline, in seconds from the start of the movement:
    `free` of the corner before, the `corner` at its end begins, it `ends`; earliest, latest: how
    far a PATH leads.
    """

    free: float
    corner: float
    ends: float
    earliest: float
    latest: float

    @property
    def exact(self) -> bool:
        """Whether it ends in no rounded corner."""
        return self.corner >= self.ends

    def reference(self, switch: Switch) -> float:
        """Where DISTANCE and PATH count from."""
        return self.free if switch.from_start else 0.5 * (self.corner + self.ends)

    def limits(self, switch: Switch) -> tuple[float, float]:
        """The first and the last instant that a trigger can be shifted to."""
        if switch.path is not None:
            return self.earliest, self.latest
        if switch.from_start:
            return self.free, max(self.corner, self.free)
        return (self.free if self.exact else self.corner), self.ends


Shifted = Callable[[float, float], float]
"""The instant [s] at which the tool is a distance [m] of its path after where it is at another."""


def instant(switch: Switch, instants: MotionInstants, shifted: Shifted) -> tuple[float, bool]:
    """When a trigger acts [s], and whether that is a limit that it would lead beyond."""
    first, last = instants.limits(switch)
    at = instants.reference(switch)
    if switch.path:
        at = shifted(at, switch.path)
    at += switch.delay
    acts = min(max(at, first), last)
    return acts + switch.waited, abs(acts - at) > _SAME


def instants_of_motions(
    moves: Sequence[Move], overlaps: Sequence[int]
) -> list[tuple[MotionInstants, ...]]:
    """The instants of each motion that is driven through, one for each part of a spline."""
    lasting = [one.law.total for one in moves]
    begins = [0, *itertools.accumulate(a - b for a, b in zip(lasting[:-1], overlaps, strict=True))]
    before = [0, *overlaps]
    after = [*overlaps, 0]
    free = [at + rounded for at, rounded in zip(begins, before, strict=True)]
    ends = [at + steps for at, steps in zip(begins, lasting, strict=True)]
    corners = [end - rounded for end, rounded in zip(ends, after, strict=True)]
    found = []
    for k, one in enumerate(moves):
        latest = ends[k] if after[k] == 0 else corners[k + 1]
        passed = [float(begins[k] + step) for step in one.passing()]
        found.append(_instants(passed, free[k], corners[k], begins[k], latest))
    return found


def instants_of_parts(times: FloatArray) -> tuple[MotionInstants, ...]:
    """The instants of a spline that passes its points at these times (parts + 1,) s."""
    first, *passed = times / GRID_S
    return _instants(passed, first, passed[-1], first, passed[-1])


def _instants(
    passed: Sequence[float], free: float, corner: float, earliest: float, latest: float
) -> tuple[MotionInstants, ...]:
    """Instants of parts that end at grid steps (parts,)."""
    starts = [free, *passed[:-1]]
    rounding = [*passed[:-1], corner]
    return tuple(
        MotionInstants(*(GRID_S * float(one) for one in (start, corner_of, end, earliest, latest)))
        for start, corner_of, end in zip(starts, rounding, passed, strict=True)
    )


def along_path(driven: JointTrajectory, target: Target, arm: Arm) -> Shifted:
    """Distances along the path that the tool of `target` takes in a movement."""
    count = max(int(np.ceil(driven.duration * _RATE)) + 1, _MINIMUM)
    times = np.linspace(0.0, driven.duration, count)
    places = arm.tool_poses(target, driven.sample(times).q)[:, :3, 3]
    steps = np.sqrt((np.diff(places, axis=0) ** 2).sum(axis=1))
    covered = np.concatenate([[0.0], np.cumsum(steps)])

    def shifted(at: float, distance: float) -> float:
        wanted = float(np.interp(at, times, covered)) + distance
        if wanted < covered[0]:
            return -np.inf
        if wanted > covered[-1]:
            return np.inf
        k = int(np.searchsorted(covered, wanted))
        if k == 0 or covered[k] <= covered[k - 1]:
            return float(times[k])
        part = (wanted - covered[k - 1]) / (covered[k] - covered[k - 1])
        return float(times[k - 1] + part * (times[k] - times[k - 1]))

    return shifted
