"""What of two robots' programs could meet: the cells from which their zones follow.

Activities of a robot in turn are the stop before its first movement (0), that movement (1), the
next stop (2) and so on. Two of them are free of each other where that is proved for every pair of
instants (`ir_kernels.swept`); all others have to be ordered.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ir_description import Equipment, RobotCells
from ir_kernels import FREE
from ir_kernels.swept import SweptArm, meeting
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.robots.arm_program import ArmProgram
from ir_planner.robots.joint_cycle import ExclusiveZone, ZoneStretch
from ir_planner.scene import PROOF_TOLERANCE
from ir_planner.timing import Movement

Pair = tuple[int, int]  # an activity of either robot
Cells = dict[Pair, set[int]]  # with the robots that have to be first


@dataclass
class Meetings:
    """Proofs between movements and stops of robots; each is made once. margin [m]: what robots
    keep.
    """

    margin: float
    _swept: dict[int, tuple[object, SweptArm]] = field(default_factory=dict)
    _free: dict[tuple[int, int], bool] = field(default_factory=dict)

    @property
    def proved(self) -> int:
        """How many pairs were proved free."""
        return sum(self._free.values())

    def cells(
        self, arms: tuple[ArmProgram, ArmProgram], movements: Sequence[Sequence[Movement]]
    ) -> Cells:
        """Activities of two robots that could meet with these movements; where a stop could, so
        could the movements beside it.
        """
        cells: Cells = {}
        for a, first in enumerate(movements[0]):
            for b, second in enumerate(movements[1]):
                for cell in self._of_pair(arms, (a, b), (first, second)):
                    cells.update((cell_near, set()) for cell_near in _with_neighbours(cell, arms))
        return cells

    def _of_pair(
        self, arms: tuple[ArmProgram, ArmProgram], at: Pair, pair: tuple[Movement, Movement]
    ) -> Iterator[Pair]:
        """Which of two movements and the stops before them could meet. A stop is the begin of its
        movement, with what is carried then: what is free of the movement is free of the stop.
        """
        moving = tuple(self._moving(arm, one) for arm, one in zip(arms, pair, strict=True))
        if self._is_free_of(moving[0], moving[1]):
            return
        a, b = at
        yield 2 * a + 1, 2 * b + 1
        standing = tuple(self._standing(arm, k) for arm, k in zip(arms, at, strict=True))
        first = self._is_free_of(standing[0], moving[1])
        second = self._is_free_of(moving[0], standing[1])
        if not first:
            yield 2 * a, 2 * b + 1
        if not second:
            yield 2 * a + 1, 2 * b
        if not (first or second or self._is_free_of(standing[0], standing[1])):
            yield 2 * a, 2 * b

    def _moving(self, arm: ArmProgram, movement: Movement) -> SweptArm:
        key = id(movement)
        if key not in self._swept:
            self._swept[key] = movement, arm.swept(movement)
        return self._swept[key][1]

    def _standing(self, arm: ArmProgram, k: int) -> SweptArm:
        key = id(arm.stops[k])
        if key not in self._swept:
            self._swept[key] = arm.stops[k], arm.standing(k)
        return self._swept[key][1]

    def _is_free_of(self, one: SweptArm, other: SweptArm) -> bool:
        """Whether two arms keep the margin wherever each of them is in what it sweeps."""
        key = id(one), id(other)
        if key not in self._free:
            closest = meeting(one, other, self.margin - PROOF_TOLERANCE)
            self._free[key] = closest.verdict == FREE
        return self._free[key]


def _with_neighbours(cell: Pair, arms: tuple[ArmProgram, ArmProgram]) -> Iterator[Pair]:
    """A cell, and where it is that of a stop the movements beside it: a robot can't be held between
    a movement and the stop that it ends in.
    """
    spans = []
    for activity, arm in zip(cell, arms, strict=True):
        around = 2 * len(arm.steps)
        stop = activity % 2 == 0
        near = (activity - 1, activity, activity + 1) if stop else (activity,)
        spans.append([each % around for each in near])
    for a in spans[0]:
        for b in spans[1]:
            yield a, b


def ordered(
    cell: Pair, zones: Sequence[ExclusiveZone], arms: tuple[ArmProgram, ArmProgram]
) -> bool:
    """Whether a zone keeps two activities apart."""
    return any(
        all(
            _holds(stretch, activity, len(arm.steps))
            for stretch, activity, arm in zip((zone.one, zone.other), cell, arms, strict=True)
        )
        for zone in zones
    )


def _holds(stretch: ZoneStretch, activity: int, count: int) -> bool:
    return (activity - (2 * stretch.first + 1)) % (2 * count) < 2 * stretch.count - 1


# Parts that one robot leaves and another one takes: the place holds one part. The taker's program
# begins with a part there, so it is first; the giver brings the next one when that is gone.


def hand_over_cells(arms: tuple[ArmProgram, ArmProgram], robots: tuple[int, int]) -> Cells:
    """Movements of two robots that parts between them order, by the places where one of them puts
    a part down and the other one takes it up.
    """
    cells: Cells = {}
    for giver, taker in ((0, 1), (1, 0)):
        for part, station, left, taken in _hand_overs(arms[giver], arms[taker]):
            lying = _lying(arms[giver], part, station)
            before = [k for k in range(left + 1) if k == left or _is_near(arms[giver], k, lying)]
            after = [
                k
                for k in range(taken, len(arms[taker].steps))
                if k == taken or _is_near(arms[taker], k, lying)
            ]
            pairs = [(k, taken) for k in before] + [(left, k) for k in after]
            for gives, takes in pairs:
                cell = (2 * gives + 1, 2 * takes + 1)
                key = cell if giver == 0 else cell[::-1]
                cells.setdefault(key, set()).add(robots[taker])
    return cells


def _hand_overs(giver: ArmProgram, taker: ArmProgram) -> Iterator[tuple[str, str, int, int]]:
    """Part, station, the movement that ends with leaving it, and the one that ends with taking
    it.
    """
    starts = {part.name: part.station for part in taker.cell.parts}
    for left, step in enumerate(giver.steps):
        for taken, other in enumerate(taker.steps):
            station = step.to_station
            if (
                step.detach != ""
                and step.detach == other.attach
                and station == other.to_station == starts[other.attach]
            ):
                yield step.detach, station, left, taken


def _lying(arm: ArmProgram, part: str, station: str) -> Equipment:
    """A part at a station, as what another robot may meet there."""
    cell = arm.cell
    own = cell.part(part).lying(cell.station(station).pose)
    name = f"{part}.at.{station}"
    machine = cell.machine(cell.station(station).equipment)
    bodies = tuple(replace(body, name=f"{name}.{k}") for k, body in enumerate(own))
    return Equipment(name, np.eye(4), bodies, machine.zone)


def check_places(cells: RobotCells) -> None:
    """Refuse, by RequestError, a station where one robot leaves a part that another one takes,
    unless just these two are there, once a cycle each; and one where robots take different parts.
    """
    left: dict[str, list[tuple[str, str]]] = {}
    taken: dict[str, list[tuple[str, str]]] = {}
    for robot, cell in zip(cells.robots, cells.cells, strict=True):
        for step in cell.program:
            if step.detach:
                left.setdefault(step.target, []).append((robot, step.detach))
            if step.attach:
                taken.setdefault(step.target, []).append((robot, step.attach))
    for station, takers in taken.items():
        givers = left.get(station, [])
        parts = {part for _, part in (*givers, *takers)}
        if len({robot for robot, _ in (*givers, *takers)}) == 1:
            continue
        handed_over = len(givers) == len(takers) == len(parts) == 1
        if handed_over or (not givers and len(parts) == 1):
            continue
        several = [f"{robot} leaves {part}" for robot, part in givers]
        several += [f"{robot} takes {part}" for robot, part in takers]
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"{station} holds one part, which one robot leaves and another one takes, once a cycle "
            f"each; there {', '.join(several)}: give each of them a station of its own",
        )


def check_lying_parts(arms: Sequence[ArmProgram]) -> None:
    """Refuse a movement that comes too near to a part that its own scene doesn't have there: one
    that another robot leaves or finds, or the next one at a station to which no robot brings any.
    """
    for owner in arms:
        for part, station in _places(owner):
            if not owner.cell.part(part).bodies:
                continue
            lying = _lying(owner, part, station)
            brought = any(_leaves(arm, part, station) for arm in arms)
            for other in arms:
                for k in _unaware(other, part, station, brought or other is not owner):
                    if _is_near(other, k, lying):
                        raise RequestError(
                            StatusCode.INVALID_GOAL_CONSTRAINTS,
                            f"{other.robot} comes too near to {part}, which {owner.robot} has at "
                            f"{station}, in {other.label(k)}: let its program take another way, "
                            "by a station or a posture between",
                        )


def _unaware(arm: ArmProgram, part: str, station: str, brought: bool) -> Sequence[int]:
    """Movements of a robot that are planned without a part that may lie at a station. brought: by
    robots, in turns that zones keep; else the next one lies there once this one was taken and left.
    """
    handled = [k for k, step in enumerate(arm.steps) if part in (step.attach, step.detach)]
    here = [k for k in handled if arm.steps[k].to_station == station]
    if here:
        return () if brought else range(here[0] + 2, len(arm.steps))
    lies = {each.name: each.station for each in arm.cell.parts}[part] == station
    return () if lies and not handled else range(len(arm.steps))


def _leaves(arm: ArmProgram, part: str, station: str) -> bool:
    return any((step.detach, step.to_station) == (part, station) for step in arm.steps)


def _places(arm: ArmProgram) -> list[tuple[str, str]]:
    """Parts of a robot's program with the stations where they lie before or after it."""
    handled = [(step.attach or step.detach, step.to_station) for step in arm.steps]
    return sorted({each for each in handled if each[0]})


def _is_near(arm: ArmProgram, k: int, equipment: Equipment) -> bool:
    """Whether any of the movements of a column comes too near."""
    return any(arm.too_near(one, equipment) for one in arm.columns[k].movements)
