"""The pool: certified excursions from several postures, out and back along straight joint segments.

One axis at a time and several together, each at its fastest and at shares of that speed. Two points
at rest are a quintic, so a trajectory is as simple as its ends; the planner proves limits, torque
and clearance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner

SPEEDS = (1.0, 0.5, 0.2)  # of the fastest
REACHES = (1.4, 0.8, 0.4)  # rad, the largest that is free
TOGETHER = 4  # excursions of several axes at a posture
_SLOWER = 1.25
_TRIES = 5  # times slower by _SLOWER until torque allows it
_SHORTEST = 0.4  # s: with less the meter sees hardly a sample
_SAMPLES = 200  # random configurations that postures are chosen from
_PEAKS = (1.875, 5.7735, 60.0)  # speed, acceleration, jerk of a quintic over 1 rad in 1 s


@dataclass(frozen=True, eq=False)
class Excursion:
    """Out of posture number `posture` and back with a load text; `name` says which axes and how
    fast.
    """

    name: str
    posture: int
    load: str
    out: JointTrajectory
    back: JointTrajectory

    @property
    def seconds(self) -> float:
        """Out and back [s]."""
        return self.out.duration + self.back.duration


def postures(planner: Planner, load: str, margin: float, count: int, seed: int) -> list[FloatArray]:
    """Free configurations (n,) far from each other, machine home first; fewer where there are not
    so many.
    """
    robot = planner.cell.robot
    generator = np.random.default_rng(seed)
    low = np.maximum(robot.position_min + 0.3, -2.6)
    high = np.minimum(robot.position_max - 0.3, 2.6)
    drawn = generator.uniform(low, high, (_SAMPLES, robot.n))
    free = [q for q, ok in zip(drawn, _valid(planner, drawn, margin, load), strict=True) if ok]
    chosen = [np.array(planner.cell.machine_home)]
    while free and len(chosen) < count:
        nearest = [min(np.linalg.norm(q[:3] - p[:3]) for p in chosen) for q in free]
        chosen.append(free.pop(int(np.argmax(nearest))))
    return chosen


def _valid(planner: Planner, q: FloatArray, margin: float, load: str) -> list[bool]:
    return [bool(each) for each in planner.check_states(q, margin, load, "").valid]


def excursions(
    planner: Planner, places: Sequence[FloatArray], load: str, margin: float, seed: int
) -> Iterator[Excursion]:
    """All of the pool with a load, from places (n,): certified, out and back."""
    generator = np.random.default_rng(seed)
    for number, place in enumerate(places):
        for name, direction in _directions(len(place), generator):
            yield from _in_direction(planner, number, place, name, direction, load, margin)


def _directions(n: int, generator: np.random.Generator) -> Iterator[tuple[str, FloatArray]]:
    """Each axis in both directions, and a few of all axes together."""
    for axis in range(n):
        for sign in (1.0, -1.0):
            yield f"A{axis + 1}{'+' if sign > 0.0 else '-'}", sign * np.eye(n)[axis]
    for k in range(TOGETHER):
        yield f"together {k + 1}", generator.uniform(-1.0, 1.0, n)


def _in_direction(
    planner: Planner,
    number: int,
    place: FloatArray,
    name: str,
    direction: FloatArray,
    load: str,
    margin: float,
) -> Iterator[Excursion]:
    """The largest free excursion in a direction, at every speed."""
    robot = planner.cell.robot
    for reach in REACHES:
        there = np.clip(
            place + reach * direction, robot.position_min + 0.05, robot.position_max - 0.05
        )
        fastest = _certified_pair(
            planner, place, there, _least_seconds(planner, place, there), load, margin
        )
        if fastest is None:
            continue
        for share in SPEEDS:
            pair = fastest
            if share < 1.0:
                slow = fastest[0].duration / share
                slower = _certified_pair(planner, place, there, slow, load, margin)
                if slower is None:
                    continue
                pair = slower
            yield Excursion(f"{name} at {share:.0%}", number, load, *pair)
        return


def _least_seconds(planner: Planner, start: FloatArray, goal: FloatArray) -> float:
    """What speed, acceleration and jerk allow a quintic between two configurations (n,)."""
    robot = planner.cell.robot
    travel = np.abs(goal - start)
    bounds = (robot.velocity_max, robot.acceleration_max, robot.jerk_max)
    least = [
        float(((peak * travel / bound) ** (1.0 / order)).max())
        for order, (peak, bound) in enumerate(zip(_PEAKS, bounds, strict=True), start=1)
    ]
    return max(_SHORTEST, 1.01 * max(least))


def _certified_pair(
    planner: Planner, start: FloatArray, goal: FloatArray, seconds: float, load: str, margin: float
) -> tuple[JointTrajectory, JointTrajectory] | None:
    """Out and back in at least so many seconds, both certified; None where they are not."""
    for _ in range(_TRIES):
        pair = (
            straight(planner.cell.robot.joint_names, start, goal, seconds),
            straight(planner.cell.robot.joint_names, goal, start, seconds),
        )
        found = [planner.evaluate(each, margin, load, "").verification for each in pair]
        if all(each.certified for each in found):
            return pair
        if any(
            v is not None and v.what == "clearance" for each in found for v in (each.violation,)
        ):
            return None
        seconds *= _SLOWER
    return None


def straight(
    names: Sequence[str], start: FloatArray, goal: FloatArray, seconds: float
) -> JointTrajectory:
    """From rest to rest between two configurations (n,)."""
    still = np.zeros((2, len(start)))
    return JointTrajectory.from_seconds(
        names, [0.0, seconds], np.stack([start, goal]), still, still
    )
