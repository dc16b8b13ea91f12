"""The cheapest joint cycle of several robots: programs, zones, order, speeds, waits and modes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ir_description import RobotCells
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_planner.cycle import WaitMode
from ir_planner.errors import RequestError
from ir_planner.planner import CLOCK, Planner
from ir_planner.presentation import plot_robots
from ir_planner.program import MOTORS, ProgramPlan, StageError, program_of
from ir_planner.request import Clock, Journal, Work, bounded
from ir_planner.robots.arm_program import ArmProgram, check_processes, check_repeatable, planned_arm
from ir_planner.robots.joint_cycle import (
    NEVER,
    ArmSchedule,
    ArmWork,
    ExclusiveZone,
    JointCycle,
    Stopped,
    ZoneStretch,
    cheapest_joint,
    shortest_joint,
    zones_of,
)
from ir_planner.robots.meetings import (
    Cells,
    Meetings,
    check_lying_parts,
    check_places,
    hand_over_cells,
    ordered,
)
from ir_planner.settings import PlannerSettings
from ir_planner.timing import Movement

PERIOD_MAX = 86_400.0  # s
WATTS_MAX = 1e7
_ROUNDING = 1e-6  # s: of the linear program
_SLACK = 1.0005  # of the shortest period, where none is asked for
_ROUNDS = 20  # until no chosen movements meet outside the zones
_FOREVER = 1e6  # s

Arms = tuple[ArmProgram, ...]
Chosen = list[list[Movement]]


@dataclass(frozen=True)
class SharedZone:
    """A zone that two robots pass in turns. turn: whose it is when the programs begin; the signal
    is false then, and true while it is the other one's. movements: of each, from its first to its
    last one there. enter, leave [s]: of both, in the cycle of the first robot.
    """

    robots: tuple[str, str]
    movements: tuple[tuple[str, str], tuple[str, str]]
    signal: str
    turn: str
    first: str
    enter: tuple[float, float]
    leave: tuple[float, float]


@dataclass(frozen=True, eq=False)
class RobotsPlan:
    """programs: one cycle of each of `robots`, from the stop before its first movement on; begins
    [s]: when that is, in the cycle of the first robot; leads: the pause of each until then, from
    the earliest of these on; period [s]; fastest [s]: the shortest that is possible. joules of all
    in a cycle; full_speed [J]: of the same zones with all movements as fast as they can and motors
    on in every wait. gap [%]: how far joules can be above the least for these configurations, zones
    and curves. peak_power [W]: no shift of the robots needs more. proved: pairs of movements and
    stops that are free of each other at every relative timing.
    """

    status: Status
    name: str
    robots: tuple[str, ...] = ()
    programs: tuple[ProgramPlan, ...] = ()
    leads: tuple[PlannedMovement, ...] = ()
    planners: tuple[Planner, ...] = ()
    zones: tuple[SharedZone, ...] = ()
    begins: tuple[float, ...] = ()
    period: float = 0.0
    fastest: float = 0.0
    full_speed: float = 0.0
    gap: float = 0.0
    proved: int = 0

    @property
    def joules(self) -> float:
        """Of all robots in a cycle."""
        return sum(program.report.energy for program in self.programs)

    @property
    def peak_power(self) -> float:
        """The sum of the peaks [W], which is enough for every shift."""
        return sum(program.report.peak_power for program in self.programs)

    @property
    def certified(self) -> bool:
        """Whether every robot keeps clear of the cell and of the others, whenever each moves."""
        return bool(self.programs) and all(each.report.certified for each in self.programs)

    def run(self, robot: str, cycles: int) -> tuple[PlannedMovement, ...]:
        """The steps of a robot for so many cycles, where all of them are started at once."""
        k = self.robots.index(robot)
        lead = self.leads[k : k + 1] if self.leads[k].duration > 0.0 else ()
        return (*lead, *self.programs[k].movements * cycles)

    def __repr__(self) -> str:
        if not self.programs:
            return f"RobotsPlan({self.status.message})"
        names = ", ".join(self.robots)
        return f"RobotsPlan({names}: {self.period:.2f} s, {self.joules:.0f} J a cycle)"

    def plot(self) -> Any:
        """What each robot does over a cycle, and the zones; a matplotlib figure."""
        rows = [
            (robot, begin, program.movements)
            for robot, begin, program in zip(self.robots, self.begins, self.programs, strict=True)
        ]
        zones = [
            (zone.signal, robot, zone.enter[side], zone.leave[side] - zone.enter[side])
            for zone in self.zones
            for side, robot in enumerate(zone.robots)
        ]
        return plot_robots(rows, zones, self.period, repr(self))


def plan_robots(
    cells: RobotCells,
    *,
    cycle_time: float = 0.0,
    peak_power: float = 0.0,
    options: PlanOptions | None = None,
    settings: PlannerSettings | None = None,
    cancelled: Stopped = NEVER,
    clock: Clock = CLOCK,
) -> RobotsPlan:
    """The cheapest joint cycle of the programs of all robots of a cell that takes `cycle_time` s,
    0: as short as possible. peak_power [W]: no shift of the robots needs more, 0: no limit. Raises
    RequestError for what makes no sense, CancelledError when `cancelled`. clock: as in Planner.
    """
    bounded(cycle_time, 0.0, PERIOD_MAX, "cycle_time", "s")
    bounded(peak_power, 0.0, WATTS_MAX, "peak_power", "W")
    planners = tuple(Planner(cell, settings=settings, clock=clock) for cell in cells.cells)
    for robot in cells.robots:
        check_repeatable(robot, cells.of_robot(robot))
    check_processes(cells.by_name)
    check_places(cells)
    arms: list[ArmProgram] = []
    try:
        for robot, planner in zip(cells.robots, planners, strict=True):
            request, work = planner.cycle_request(options, cancelled)
            arms.append(planned_arm(robot, request, Journal(work, request.options.seed)))
        check_lying_parts(arms)
        arms = _sharing_power(arms, peak_power)
        return _Joint(cells.name, tuple(arms), planners, work).plan(cycle_time)
    except StageError as failed:
        return RobotsPlan(failed.status, cells.name, cells.robots)


def _sharing_power(arms: list[ArmProgram], watts: float) -> list[ArmProgram]:
    """Programs that need at most so many watts together, whenever each of them moves: every robot
    gets a share as large as its part of the sum of all peaks.
    """
    whole = sum(arm.peak_power for arm in arms)
    if watts == 0.0 or whole <= watts:
        return arms
    return [arm.within(watts * arm.peak_power / whole) for arm in arms]


class _Joint:
    """The joint cycle of programs that are known."""

    def __init__(self, name: str, arms: Arms, planners: tuple[Planner, ...], work: Work) -> None:
        self._work = work
        self.name = name
        self.arms = arms
        self.planners = planners
        self._meetings = Meetings(max(arm.request.options.safety_distance for arm in arms))
        self._pairs = list(itertools.combinations(range(len(arms)), 2))
        self._cells: dict[tuple[int, int], Cells] = {
            pair: hand_over_cells(self._both(pair), pair) for pair in self._pairs
        }
        for end in (0, -1):
            self._take([[column.movements[end] for column in arm.columns] for arm in arms], ())

    def _both(self, pair: tuple[int, int]) -> tuple[ArmProgram, ArmProgram]:
        return self.arms[pair[0]], self.arms[pair[1]]

    def _take(self, chosen: Chosen, zones: Sequence[ExclusiveZone]) -> bool:
        """Add what could meet with these movements and isn't ordered by a zone; whether anything
        was.
        """
        new = False
        for pair in self._pairs:
            self._work.check()
            arms = self._both(pair)
            between = [zone for zone in zones if (zone.one.robot, zone.other.robot) == pair]
            found = self._meetings.cells(arms, [chosen[k] for k in pair])
            for cell in found:
                if not ordered(cell, between, arms):
                    self._cells[pair].setdefault(cell, set())
                    new = True
        return new

    def _zones(self) -> tuple[ExclusiveZone, ...]:
        """The zones of all pairs. Raises RequestError for one that no cycle passes."""
        zones = []
        for pair in self._pairs:
            counts = tuple(len(self.arms[k].steps) for k in pair)
            found = zones_of(pair, (counts[0], counts[1]), self._cells[pair])
            zones += [self._passable(zone) for zone in found]
        return tuple(zones)

    def _passable(self, zone: ExclusiveZone) -> ExclusiveZone:
        """The zone; where a program begins within its stretch, the other robot passes first."""
        first = set(zone.first)
        for own, other in ((zone.one, zone.other), (zone.other, zone.one)):
            count = len(self.arms[own.robot].steps)
            if own.count >= count:
                raise self._blocked(own, other)
            if own.first + own.count > count:
                first.add(other.robot)
        if len(first) > 1:
            raise self._blocked(zone.one, zone.other)
        return replace(zone, first=tuple(first))

    def _blocked(self, own: ZoneStretch, other: ZoneStretch) -> RequestError:
        arms = self.arms[own.robot], self.arms[other.robot]
        there = self._span(other)
        return RequestError(
            StatusCode.PLANNING_FAILED,
            f"{arms[0].robot} is in the way of {arms[1].robot} ({there[0]} .. {there[1]}) wherever "
            f"its program lets it wait, or the programs begin where both are in each other's way: "
            f"give {arms[0].robot} a waiting place out of reach, as a step {{posture: park}} with "
            "a park posture that faces away, between the others",
        )

    def _span(self, stretch: ZoneStretch) -> tuple[str, str]:
        arm = self.arms[stretch.robot]
        return arm.label(stretch.first), arm.label(stretch.first + stretch.count - 1)

    def plan(self, cycle_time: float) -> RobotsPlan:
        """The joint cycle, certified for every timing that its signals admit."""
        works = [arm.work() for arm in self.arms]
        for _ in range(_ROUNDS):
            zones = self._zones()
            fastest = shortest_joint(works, zones, self._work.cancelled)
            self._work.check()
            if fastest is None:
                break
            period = cycle_time or fastest.period * _SLACK
            self._check_period(period, fastest.period)
            first = cheapest_joint(works, zones, period, self._work.cancelled)
            self._work.check()
            if first is None:
                break
            chosen = [
                arm.taking(schedule) for arm, schedule in zip(self.arms, first.arms, strict=True)
            ]
            if self._take(chosen, zones):
                continue
            return self._answer(zones, chosen, first, fastest.period)
        sentence = "no order of the zones lets every robot pass: give the programs waiting places"
        return RobotsPlan(Status(StatusCode.PLANNING_FAILED, sentence), self.name)

    @staticmethod
    def _check_period(period: float, fastest: float) -> None:
        if period < fastest - _ROUNDING:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"cycle_time is {period:g} s: the shortest of all robots together is "
                f"{fastest:.3f} s",
            )

    def _answer(
        self, zones: tuple[ExclusiveZone, ...], chosen: Chosen, first: JointCycle, fastest: float
    ) -> RobotsPlan:
        """The answer: durations as chosen, the cheapest order and waits for them, signals that keep
        the order, and a program for each robot. fastest: the shortest period [s].
        """
        fixed = [arm.work(own) for arm, own in zip(self.arms, chosen, strict=True)]
        cycle = cheapest_joint(fixed, zones, first.period + _ROUNDING)
        assert cycle is not None  # no movement takes longer than was chosen
        names = self._names(len(zones))
        turns = [
            _turn(zone, later, self.arms) for zone, later in zip(zones, cycle.later, strict=True)
        ]
        signals = self._signals(zones, names, turns)
        begins = [self._begin(k, schedule) for k, schedule in enumerate(cycle.arms)]
        programs = []
        leads = []
        for k, (arm, planner) in enumerate(zip(self.arms, self.planners, strict=True)):
            steps = arm.driven(chosen[k], cycle.arms[k].waits, signals[k])
            programs.append(planner.kept_program(program_of(steps), arm.request))
            leads.append(arm.lead(begins[k] - min(begins)))
        shared = []
        for k, zone in enumerate(zones):
            shared.append(self._shared(k, zone, cycle, (names[k], turns[k])))
        excess = max(cycle.joules - first.bound, 0.0)
        return RobotsPlan(
            status=Status.success(),
            name=self.name,
            robots=tuple(arm.robot for arm in self.arms),
            programs=tuple(programs),
            leads=tuple(leads),
            planners=self.planners,
            zones=tuple(shared),
            begins=tuple(begins),
            period=cycle.period,
            fastest=fastest,
            full_speed=self._full_speed(zones, cycle.period),
            gap=100.0 * excess / cycle.joules,
            proved=self._meetings.proved,
        )

    def _begin(self, robot: int, schedule: ArmSchedule) -> float:
        """When the stop before the first movement begins [s]."""
        waited = sum(wait.seconds for wait in schedule.waits[0])
        return schedule.begin[0] - waited - self.arms[robot].stops[0].seconds + 0.0

    def _full_speed(self, zones: tuple[ExclusiveZone, ...], period: float) -> float:
        """Joules with all movements as fast as they can, and motors on in every wait."""
        works = [
            _on_motors(arm.work([column.movements[0] for column in arm.columns]))
            for arm in self.arms
        ]
        cycle = cheapest_joint(works, zones, period)
        return np.inf if cycle is None else cycle.joules

    def _names(self, count: int) -> list[str]:
        """Names of the signals of zones, none of which the cell has."""
        taken = {signal.name for signal in self.arms[0].cell.signals}
        numbered = map("zone_{}".format, itertools.count(1))
        free = (name for name in numbered if name not in taken)
        return list(itertools.islice(free, count))

    def _signals(
        self, zones: Sequence[ExclusiveZone], names: Sequence[str], turns: Sequence[int]
    ) -> list[list[tuple[tuple[str, ...], tuple[str, ...]]]]:
        """Of each movement of each robot, the signals that it waits for and that it sets.

        `turns`: which of the two stretches of a zone comes first. Its robot waits until the signal
        is off, and switches it on behind the zone; the other one does the reverse.
        """
        waits: list[list[list[str]]] = [[[] for _ in arm.steps] for arm in self.arms]
        sets: list[list[list[str]]] = [[[] for _ in arm.steps] for arm in self.arms]
        for zone, name, turn in zip(zones, names, turns, strict=True):
            stretches = (zone.one, zone.other)
            off = f"{name}=0"
            for stretch, free, done in (
                (stretches[turn], off, name),
                (stretches[1 - turn], name, off),
            ):
                count = len(self.arms[stretch.robot].steps)
                last = (stretch.first + stretch.count - 1) % count
                waits[stretch.robot][stretch.first].append(free)
                sets[stretch.robot][last].append(done)
        signals = []
        for own_waits, own_sets in zip(waits, sets, strict=True):
            of_arm = []
            for awaited, switched in zip(own_waits, own_sets, strict=True):
                of_arm.append((tuple(awaited), tuple(switched)))
            signals.append(of_arm)
        return signals

    def _shared(
        self, n: int, zone: ExclusiveZone, cycle: JointCycle, signal: tuple[str, int]
    ) -> SharedZone:
        spans = [
            _passed(stretch, cycle, len(self.arms[stretch.robot].steps))
            for stretch in (zone.one, zone.other)
        ]
        robots = [self.arms[stretch.robot].robot for stretch in (zone.one, zone.other)]
        return SharedZone(
            (robots[0], robots[1]),
            (self._span(zone.one), self._span(zone.other)),
            signal[0],
            robots[signal[1]],
            robots[int(cycle.later[n])],
            (spans[0][0], spans[1][0]),
            (spans[0][1], spans[1][1]),
        )


def _turn(zone: ExclusiveZone, later: bool, arms: Arms) -> int:
    """Whose turn it is when the programs begin, 0 or 1: of who begins within, else who is first."""
    begun = [
        stretch.first + stretch.count > len(arms[stretch.robot].steps)
        for stretch in (zone.one, zone.other)
    ]
    return int(begun[1] or (later and not begun[0]))


def _passed(stretch: ZoneStretch, cycle: JointCycle, count: int) -> tuple[float, float]:
    """When a robot enters and leaves a zone [s]."""
    schedule = cycle.arms[stretch.robot]
    last = stretch.first + stretch.count - 1
    left = schedule.begin[last % count] + schedule.seconds[last % count]
    return schedule.begin[stretch.first], left + (cycle.period if last >= count else 0.0)


def _on_motors(work: ArmWork) -> ArmWork:
    """The work of a robot with motors on in every wait, however long."""
    modes = tuple(
        tuple(WaitMode(MOTORS, 0.0, _FOREVER, 0.0, mode.watts) for mode in own[:1])
        for own in work.modes
    )
    return replace(work, modes=modes)
