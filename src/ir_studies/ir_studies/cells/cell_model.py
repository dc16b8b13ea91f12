"""The cell as a mixed-integer linear program.

A robot's clock begins when it leaves the stop that closes its cycle. Each movement and each range
of a stay has a duration of its own, zero unless chosen; starts flow along the hops with their
movements, so orders need no large constants. Duration and energy of a movement are a mean of the
corners of a polygon below its curve; where a solution lies below the curve, the tangent there cuts
corners off. Robots differ by the phase of their clocks; two activities that exclude each other are
separated by a whole number of cycles.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from ir_planner.cycle import LinearProgram
from ir_studies.cells.instance import (
    DynamicActivity,
    EnergyCurve,
    HopMovement,
    Instance,
    InstanceRobot,
    ModeRange,
    Schedule,
    ScheduledActivity,
    StaticActivity,
    TimeLag,
    stay_ranges,
)
from ir_values.arrays import FloatArray

_FIRST_TANGENTS = 9
_SLACK = 1e-7  # s, of bounds that were derived
_SAME = 1e-7  # of a slope: a tangent that close is there already
_ON_IT = 1e-9  # J: a corner that near to a tangent lies on it


@dataclass(frozen=True)
class _Corner:
    """Of the polygon below a curve of energies; its weight is a variable."""

    weight: int
    duration: float
    energy: float


@dataclass(frozen=True)
class _Moving:
    """Variables of a movement."""

    hop: DynamicActivity
    movement: HopMovement
    on: int
    most: float
    row: int  # in which the weights of its corners are together what `on` is
    corners: list[_Corner]  # by duration


@dataclass(frozen=True)
class _Staying:
    """Variables of a stay at a place in a range of durations."""

    stop: StaticActivity
    place: int
    range: ModeRange
    on: int


@dataclass
class _Clock:
    """A robot: earliest and latest starts on its clock [s], and its variables."""

    robot: InstanceRobot
    phase: int = -1
    phase_low: float = 0.0
    phase_high: float = 0.0
    start: dict[int, int] = field(default_factory=dict)  # of a stop
    leave: dict[int, int] = field(default_factory=dict)  # of a hop, zero unless it is done
    begins: dict[int, tuple[float, float]] = field(default_factory=dict)
    ends: dict[int, tuple[float, float]] = field(default_factory=dict)


Terms = dict[int, float]


class CellModel:
    """Variables and rows of an instance."""

    def __init__(self, instance: Instance) -> None:
        self.instance = instance
        self.program = LinearProgram()
        self.moving: list[_Moving] = []
        self.staying: list[_Staying] = []
        self.separations: dict[tuple[int, int], int] = {}
        self._duration: dict[int, int] = {}  # of an activity, zero unless it is done
        self._duration_row: dict[int, int] = {}
        self._clocks = [self._clock(robot) for robot in instance.robots]
        self._stops = {s.number: s for robot in instance.robots for s in robot.stops}
        self._hops = {h.number: h for robot in instance.robots for h in robot.hops}
        self._moves_of: dict[int, list[_Moving]] = {}
        self._stays_of: dict[int, list[_Staying]] = {}
        for clock in self._clocks:
            self._choices(clock)
            self._flows(clock)
        bindings = self._bindings()
        self._phases(bindings)
        for event, lag in bindings:
            self._lag(event, lag)
        self._fits()
        self._conflicts()

    # Bounds on each clock.

    def _clock(self, robot: InstanceRobot) -> _Clock:
        """The earliest and latest starts and ends of a robot's stops and hops [s], from the least
        that comes before and after each.
        """
        cycle = self.instance.cycle
        closing = robot.closing.number
        stays = {stop.number: stop.least for stop in robot.stops}
        quickest = {}
        entering = {stop.number: math.inf for stop in robot.stops}  # the quickest hop to each
        for hop in robot.hops:
            seconds = min(movement.curve.least for movement in hop.movements)
            quickest[hop.number] = seconds
            entering[hop.end] = min(entering[hop.end], seconds)
        must = _before(robot)
        first = _distances(robot, stays, quickest, forward=True)
        last = _distances(robot, stays, quickest, forward=False)
        clock = _Clock(robot)
        for stop in robot.stops:
            number = stop.number
            earlier = [other for other in must if number in must[other]]
            before = sum(stays[other] + entering[other] for other in earlier) + entering[number]
            after = sum(stays[other] + entering[other] for other in must[number])
            low = max(first[number], before)
            rest = 0.0 if number == closing else max(last[number], after)
            high = cycle - stays[number] - rest
            clock.begins[number] = (low, high)
            clock.ends[number] = (low + stays[number], high + stays[number])
        for hop in robot.hops:
            least = quickest[hop.number]
            latest_end = clock.begins[hop.end][1]
            low = 0.0
            high = 0.0
            if hop.start != closing:
                low = clock.ends[hop.start][0]
                high = latest_end - least
            clock.begins[hop.number] = (low, high)
            clock.ends[hop.number] = (low + least, latest_end)
        return clock

    # One robot.

    def _choices(self, clock: _Clock) -> None:
        """Which movement each hop takes, where and in which mode each stop stays, and how long
        they last: a binary variable for each, and durations between their least and their most.
        """
        program = self.program
        for hop in clock.robot.hops:
            available = clock.ends[hop.number][1] - clock.begins[hop.number][0]
            took: Terms = {}
            for movement in hop.movements:
                most = min(movement.curve.most, available + _SLACK)
                if most < movement.curve.least:
                    continue
                on = program.binary()
                corners = []
                for duration, energy in _first_corners(movement.curve, most):
                    weight = program.variable(cost=energy)
                    corners.append(_Corner(weight, duration, energy))
                weights = {corner.weight: 1.0 for corner in corners}
                row = program.row({on: -1.0} | weights, low=0.0, high=0.0)
                took |= {corner.weight: corner.duration for corner in corners}
                moving = _Moving(hop, movement, on, most, row, corners)
                self.moving.append(moving)
                self._moves_of.setdefault(hop.number, []).append(moving)
            self._lasts(hop.number, took)
        for stop in clock.robot.stops:
            latest = self.instance.cycle if stop.closes else clock.ends[stop.number][1]
            took = {}
            for place in stop.places:
                for stay in stay_ranges(stop, place, clock.robot.modes):
                    most = min(stay.most, latest - clock.begins[stop.number][0] + _SLACK)
                    if most < stay.least:
                        continue
                    on = program.binary(cost=stay.power * stay.least)
                    longer = program.variable(cost=stay.power)
                    program.row({longer: 1.0, on: stay.least - most}, high=0.0)
                    took |= {on: stay.least, longer: 1.0}
                    staying = _Staying(stop, place.number, stay, on)
                    self.staying.append(staying)
                    self._stays_of.setdefault(stop.number, []).append(staying)
            self._lasts(stop.number, took)

    def _lasts(self, activity: int, took: Terms) -> None:
        """A variable for what an activity takes."""
        duration = self.program.variable()
        self._duration[activity] = duration
        self._duration_row[activity] = self.program.row(took | {duration: -1.0}, low=0.0, high=0.0)

    def _flows(self, clock: _Clock) -> None:
        """Rows that make the chosen movements and stays one way of the robot through its stops: as
        many movements enter and leave each place as stays there are, and each stop has one stay.
        """
        program = self.program
        cycle = self.instance.cycle
        closing = clock.robot.closing.number
        for stop in clock.robot.stops:
            clock.start[stop.number] = program.variable(*clock.begins[stop.number])
        for hop in clock.robot.hops:
            if hop.start == closing:
                continue
            low, high = clock.begins[hop.number]
            leave = program.variable(0.0, max(high, 0.0))
            clock.leave[hop.number] = leave
            on = self._on(hop.number)
            program.row({leave: 1.0} | dict.fromkeys(on, -low), low=0.0)
            program.row({leave: 1.0} | dict.fromkeys(on, -high), high=0.0)
        for stop in clock.robot.stops:
            number = stop.number
            stays = self._stays_of.get(number, ())
            for place in stop.places:
                here = {stay.on: -1.0 for stay in stays if stay.place == place.number}
                for end in ("start", "end"):
                    movements = self._movements_at(clock, number, place.point, end)
                    program.row(dict.fromkeys(movements, 1.0) | here, low=0.0, high=0.0)
            program.row({stay.on: 1.0 for stay in stays}, low=1.0, high=1.0)
            self._in_time(clock, stop, -cycle if number == closing else 0.0)

    def _movements_at(self, clock: _Clock, stop: int, point: int, end: str) -> list[int]:
        """Variables of the movements that start or end (`end`) at a point of a stop."""
        found: list[int] = []
        for hop in clock.robot.hops:
            if getattr(hop, end) != stop:
                continue
            moves = self._moves_of.get(hop.number, ())
            found += [each.on for each in moves if getattr(each.movement, end) == point]
        return found

    def _in_time(self, clock: _Clock, stop: StaticActivity, rest: float) -> None:
        """Movements end when a stop begins, and begin when it ends."""
        v = stop.number
        arrive: Terms = {clock.start[v]: -1.0}
        depart: Terms = {clock.start[v]: -1.0}
        depart[self._duration[v]] = -1.0
        for hop in clock.robot.hops:
            if hop.end == v:
                arrive[self._duration[hop.number]] = 1.0
                if hop.number in clock.leave:
                    arrive[clock.leave[hop.number]] = 1.0
            if hop.start == v and hop.number in clock.leave:
                depart[clock.leave[hop.number]] = 1.0
        self.program.row(arrive, low=0.0, high=0.0)
        self.program.row(depart, low=rest, high=rest)

    def _on(self, activity: int) -> list[int]:
        return [m.on for m in self._moves_of.get(activity, ())]

    # Robots against each other.

    def _bindings(self) -> list[tuple[_Event, TimeLag]]:
        """Lags with the event that they begin at: all hops of a stop together are its end."""
        found = []
        groups: dict[tuple[int, int, float, int], set[int]] = {}
        for lag in self.instance.lags:
            hop = self._hops.get(lag.earlier)
            if hop is None:
                found.append((_Event(start_of=lag.earlier), lag))
            else:
                key = (hop.start, lag.later, lag.length, lag.height)
                groups.setdefault(key, set()).add(hop.number)
        for (stop, later, length, height), hops in groups.items():
            robot = self.instance.robots[self.instance.robot_of[stop]]
            leaving = {hop.number for hop in robot.hops if hop.start == stop}
            events = (
                [_Event(end_of=stop)]
                if hops == leaving
                else [_Event(start_of=hop) for hop in sorted(hops)]
            )
            found += [(event, TimeLag(min(hops), later, length, height)) for event in events]
        return found

    def _phases(self, bindings: list[tuple[_Event, TimeLag]]) -> None:
        """Ranges of the phases: as the lags leave them, a cycle where nothing binds them."""
        cycle = self.instance.cycle
        count = len(self._clocks)
        linked = self._distances_of_phases(bindings)
        apart = self._apart
        heights = max((abs(lag.height) for lag in self.instance.lags), default=0)
        far = cycle * (count + heights)
        for k, clock in enumerate(self._clocks):
            roots = [r for r in range(k) if linked[r][k]]
            if roots:
                base = self._clocks[roots[0]]
                clock.phase_low = max(base.phase_low - apart[k][roots[0]], base.phase_low - far)
                clock.phase_high = min(base.phase_high + apart[roots[0]][k], base.phase_high + far)
                clock.phase_high = max(clock.phase_high, clock.phase_low)
            elif k > 0:
                clock.phase_high = cycle
            clock.phase = self.program.variable(clock.phase_low, clock.phase_high)
        for i in range(count):
            for j in range(count):
                if i != j and math.isfinite(apart[i][j]):
                    self.program.row(
                        {self._clocks[j].phase: 1.0, self._clocks[i].phase: -1.0}, high=apart[i][j]
                    )

    def _distances_of_phases(self, bindings: list[tuple[_Event, TimeLag]]) -> list[list[bool]]:
        """The largest differences of phases [s], and which robots lags connect at all: over chains
        of robots too, as shortest paths between all of them.
        """
        cycle = self.instance.cycle
        robots = range(len(self._clocks))
        apart = [[math.inf for _ in robots] for _ in robots]
        linked = [[False for _ in robots] for _ in robots]
        for i in robots:
            apart[i][i] = 0.0
        for event, lag in bindings:
            i = self.instance.robot_of[lag.earlier]
            j = self.instance.robot_of[lag.later]
            linked[i][j] = True
            linked[j][i] = True
            if i == j or self._conditions(event) or self._conditions(_Event(lag.later)):
                continue
            # phase_i - phase_j <= late_j - early_i - length + height * cycle
            most = self._clocks[j].begins[lag.later][1] - self._times(event)[0]
            apart[j][i] = min(apart[j][i], most - lag.length + lag.height * cycle)
        for over, i, j in itertools.product(robots, repeat=3):
            apart[i][j] = min(apart[i][j], apart[i][over] + apart[over][j])
            linked[i][j] = linked[i][j] or (linked[i][over] and linked[over][j])
        self._apart = apart
        return linked

    def _conditions(self, event: _Event) -> list[int]:
        """What must be on, one of them, for an event to take place; nothing: it always does."""
        hop = self._hops.get(event.start_of)
        if hop is None:
            return []
        robot = self.instance.robots[self.instance.robot_of[hop.number]]
        if sum(other.start == hop.start for other in robot.hops) == 1:
            return []
        return self._on(hop.number)

    def _times(self, event: _Event) -> tuple[float, float]:
        """Earliest and latest time of an event on its robot's clock."""
        if event.start_of >= 0:
            return self._clock_of(event.start_of).begins[event.start_of]
        if self._stops[event.end_of].closes:
            return 0.0, 0.0
        return self._clock_of(event.end_of).ends[event.end_of]

    def _moment(self, event: _Event) -> Terms:
        """Terms of an event's time; of a hop that isn't done only its robot's phase."""
        if event.end_of < 0:
            clock = self._clock_of(event.start_of)
            started = clock.start if event.start_of in self._stops else clock.leave
            terms: Terms = {clock.phase: 1.0}
            if event.start_of in started:
                terms[started[event.start_of]] = 1.0
            return terms
        clock = self._clock_of(event.end_of)
        if self._stops[event.end_of].closes:
            return {clock.phase: 1.0}
        return {
            clock.phase: 1.0,
            clock.start[event.end_of]: 1.0,
            self._duration[event.end_of]: 1.0,
        }

    def _lag(self, event: _Event, lag: TimeLag) -> None:
        """later - earlier >= bound, less `spare` for each of the two that doesn't take place."""
        other = _Event(start_of=lag.later)
        terms = _sum(self._moment(other), self._moment(event), -1.0)
        bound = lag.length - lag.height * self.instance.cycle
        low = 0.0 if self._conditions(other) else self._times(other)[0]
        low += self._clock_of(lag.later).phase_low
        high = self._clock_of(lag.earlier).phase_high + self._times(event)[1]
        spare = max(high - low + bound, 0.0)
        for each in (event, other):
            conditions = self._conditions(each)
            terms = _sum(terms, dict.fromkeys(conditions, spare), -1.0)
            bound -= spare if conditions else 0.0
        self.program.row(terms, low=bound)

    def _clock_of(self, activity: int) -> _Clock:
        return self._clocks[self.instance.robot_of[activity]]

    def _fits(self) -> None:
        for handover in self.instance.handovers:
            for side in (0, 1):
                here = handover.stops[side]
                there = handover.stops[1 - side]
                for place in self._stops[here].places:
                    fitting = {
                        pair[1 - side] for pair in handover.pairs if pair[side] == place.number
                    }
                    terms = {
                        s.on: 1.0 for s in self._stays_of.get(here, ()) if s.place == place.number
                    }
                    for s in self._stays_of.get(there, ()):
                        if s.place in fitting:
                            terms[s.on] = terms.get(s.on, 0.0) - 1.0
                    self.program.row(terms, high=0.0)

    def _conflicts(self) -> None:
        grouped: dict[tuple[int, int], set[tuple[int, int]]] = {}
        for conflict in self.instance.conflicts:
            a, g = conflict.first
            b, h = conflict.second
            if self.instance.robot_of[a] == self.instance.robot_of[b]:
                continue
            if a > b:
                (a, g), (b, h) = (b, h), (a, g)
            grouped.setdefault((a, b), set()).add((g, h))
        for (a, b), modes in sorted(grouped.items()):
            self._separate(a, b, modes)

    def _separate(self, a: int, b: int, modes: set[tuple[int, int]]) -> None:
        """Where both choices are taken: end of a <= start of b + k cycles, and end of that b <=
        start of the next a; k is a variable of the program.
        """
        cycle = self.instance.cycle
        robot_a = self.instance.robot_of[a]
        robot_b = self.instance.robot_of[b]
        clock_a = self._clocks[robot_a]
        clock_b = self._clocks[robot_b]

        # how much later the clock of b may begin than that of a
        phase_low = max(clock_b.phase_low - clock_a.phase_high, -self._apart[robot_b][robot_a])
        phase_high = min(clock_b.phase_high - clock_a.phase_low, self._apart[robot_a][robot_b])
        _, start_a_high = clock_a.begins[a]
        _, start_b_high = clock_b.begins[b]
        end_a_low, _ = clock_a.ends[a]
        end_b_low, _ = clock_b.ends[b]

        # start b - end a is at most `later`, start a - end b at most `earlier`: that bounds k
        later = phase_high + start_b_high - end_a_low
        earlier = start_a_high - end_b_low - phase_low
        low = math.ceil((-later - _SLACK) / cycle)
        high = math.floor((earlier + cycle + _SLACK) / cycle)
        sides = self._rows_of_conflict(a, b, modes)
        if low > high:
            for one, others in sides:
                self.program.row(dict.fromkeys([*one, *others], 1.0), high=1.0)
            return
        k = self.program.variable(low, high, whole=True)
        self.separations[a, b] = k
        spare = self._longest(a) + self._longest(b)
        start_a, end_a, early_a, early_end_a = self._interval(a)
        start_b, end_b, early_b, early_end_b = self._interval(b)
        start_to_end = _sum(_sum(start_b, end_a, -1.0), {k: cycle}, 1.0)
        end_to_start = _sum(_sum(start_a, end_b, -1.0), {k: -cycle}, 1.0)
        for one, others in sides:
            on = dict.fromkeys([*one, *others], spare)
            low_1 = -2.0 * spare + early_end_a - early_b
            low_2 = -cycle - 2.0 * spare + early_end_b - early_a
            self.program.row(_sum(start_to_end, on, -1.0), low=low_1)
            self.program.row(_sum(end_to_start, on, -1.0), low=low_2)

    def _longest(self, activity: int) -> float:
        if activity in self._stops:
            return max((s.range.most for s in self._stays_of.get(activity, ())), default=0.0)
        return max((m.most for m in self._moves_of.get(activity, ())), default=0.0)

    def _rows_of_conflict(
        self, a: int, b: int, modes: set[tuple[int, int]]
    ) -> list[tuple[list[int], list[int]]]:
        """Choices of a and of b that exclude each other, as few rows as one side needs: variables
        of the one side, and all of the other that any of them excludes.
        """
        by_first: dict[int, set[int]] = {}
        by_second: dict[int, set[int]] = {}
        for first, second in modes:
            by_first.setdefault(first, set()).add(second)
            by_second.setdefault(second, set()).add(first)
        pairs: list[tuple[set[int], set[int]]]
        if len(by_first) <= len(by_second):
            pairs = [({first}, seconds) for first, seconds in by_first.items()]
        else:
            pairs = [(firsts, {second}) for second, firsts in by_second.items()]
        rows = []
        for firsts, seconds in pairs:
            one: list[int] = []
            for first in sorted(firsts):
                one += self._chosen(a, first)
            others: list[int] = []
            for second in sorted(seconds):
                others += self._chosen(b, second)
            if one and others:
                rows.append((one, others))
        return rows

    def _chosen(self, activity: int, choice: int) -> list[int]:
        if activity in self._stops:
            return [s.on for s in self._stays_of.get(activity, ()) if s.place == choice]
        return [m.on for m in self._moves_of.get(activity, ()) if m.movement.number == choice]

    def _interval(self, activity: int) -> tuple[Terms, Terms, float, float]:
        """Start and end as terms and constants; a hop that isn't done lies at its earliest time."""
        clock = self._clock_of(activity)
        start: Terms = {clock.phase: 1.0}
        if activity in self._stops:
            start[clock.start[activity]] = 1.0
            return start, start | {self._duration[activity]: 1.0}, 0.0, 0.0
        if activity in clock.leave:
            start[clock.leave[activity]] = 1.0
        end = start | {self._duration[activity]: 1.0}
        early = clock.begins[activity][0]
        early_end = clock.ends[activity][0]
        on = self._on(activity)
        start = start | dict.fromkeys(on, -early)
        return start, end | dict.fromkeys(on, -early_end), early, early_end

    # Curves.

    def refine(self, values: FloatArray, close: float) -> int:
        """Cut the polygons by tangents where a solution's energy is more than `close` below the
        curve; how many.
        """
        cut = 0
        for moving in self.moving:
            on = float(values[moving.on])
            if on < 1e-3:
                continue
            duration = self._took(moving, values) / on
            energy = sum(float(values[c.weight]) * c.energy for c in moving.corners) / on
            slope, zero = moving.movement.curve.tangent(duration)
            if slope * duration + zero - energy > close:
                self._cut(moving, slope, zero)
                cut += 1
        return cut

    def _took(self, moving: _Moving, values: FloatArray) -> float:
        """Duration of a movement [s], zero unless it is done."""
        return sum(float(values[c.weight]) * c.duration for c in moving.corners)

    def _cut(self, moving: _Moving, slope: float, zero: float) -> None:
        """Cut off the corners below a line; the shortest and the longest duration stay."""
        corners = moving.corners
        above = [c.energy - slope * c.duration - zero for c in corners]
        below = [each < -_ON_IT for each in above]
        kept: list[_Corner] = []
        for k, corner in enumerate(corners):
            if k > 0 and below[k - 1] != below[k]:
                share = above[k - 1] / (above[k - 1] - above[k])
                duration = corners[k - 1].duration
                duration += min(max(share, 0.0), 1.0) * (corner.duration - duration)
                kept.append(self._corner(moving, duration, slope, zero))
            if not below[k]:
                kept.append(corner)
                continue
            self.program.close(corner.weight)
            if k in (0, len(corners) - 1):
                kept.append(self._corner(moving, corner.duration, slope, zero))
        moving.corners[:] = kept

    def _corner(self, moving: _Moving, duration: float, slope: float, zero: float) -> _Corner:
        energy = slope * duration + zero
        row = self._duration_row[moving.hop.number]
        weight = self.program.column({moving.row: 1.0, row: duration}, cost=energy)
        return _Corner(weight, duration, energy)

    # Answers.

    def wholes_within(self, robots: set[int]) -> list[int]:
        """Whole variables of some robots, and of what keeps them apart from each other."""
        owner = self.instance.robot_of
        found = [m.on for m in self.moving if owner[m.hop.number] in robots]
        found += [s.on for s in self.staying if owner[s.stop.number] in robots]
        apart = self.separations.items()
        return found + [k for (a, b), k in apart if {owner[a], owner[b]} <= robots]

    def wholes_outside(self, robots: set[int]) -> list[int]:
        """All other whole variables."""
        within = set(self.wholes_within(robots))
        return [k for k, whole in enumerate(self.program.whole) if whole and k not in within]

    def of_others(self, robots: set[int], values: FloatArray) -> dict[int, float]:
        """What a solution decides of all but some robots, and of what keeps them apart."""
        others = set(range(len(self._clocks))) - robots
        return {k: float(round(values[k])) for k in self.wholes_within(others)}

    def of_places(self, values: FloatArray) -> dict[int, float]:
        """What isn't chosen where a solution's places are kept."""
        kept = {(s.stop.number, s.place) for s in self.staying if values[s.on] > 0.5}
        points = {
            place.point
            for stop in self._stops.values()
            for place in stop.places
            if (stop.number, place.number) in kept
        }
        elsewhere = [s.on for s in self.staying if (s.stop.number, s.place) not in kept]
        elsewhere += [m.on for m in self.moving if not {m.movement.start, m.movement.end} <= points]
        return dict.fromkeys(elsewhere, 0.0)

    def of_orders(self, values: FloatArray) -> dict[int, float]:
        """What isn't done where a solution's orders are kept."""
        done = {m.hop.number for m in self.moving if values[m.on] > 0.5}
        return {m.on: 0.0 for m in self.moving if m.hop.number not in done}

    def choices(self, values: FloatArray) -> dict[int, float]:
        """What is decided by a solution: whole variables, rounded."""
        return {k: float(round(values[k])) for k, whole in enumerate(self.program.whole) if whole}

    def schedule(self, values: FloatArray) -> Schedule:
        """The schedule of a solution, with energies by the curves themselves."""
        moves = {m.hop.start: m for m in self.moving if values[m.on] > 0.5}
        stays = {s.stop.number: s for s in self.staying if values[s.on] > 0.5}
        shift = min(float(values[clock.phase]) for clock in self._clocks)
        robots = []
        for clock in self._clocks:
            time = float(values[clock.phase]) - shift
            done: list[ScheduledActivity] = []
            at = clock.robot.closing.number
            for _ in clock.robot.stops:
                moving = moves[at]
                at = moving.hop.number
                curve = moving.movement.curve
                took = min(max(self._took(moving, values), curve.least), curve.most)
                done.append(
                    ScheduledActivity(
                        moving.hop.number,
                        moving.movement.number,
                        -1,
                        time,
                        took,
                        curve.energy(took),
                    )
                )
                time += took
                at = moving.hop.end
                stay = stays[at]
                took = float(values[self._duration[at]])
                done.append(
                    ScheduledActivity(
                        at, stay.place, stay.range.mode, time, took, stay.range.power * took
                    )
                )
                time += took
            robots.append(tuple(done))
        return Schedule(tuple(robots))


@dataclass(frozen=True)
class _Event:
    """A point in time: the start of an activity or the end of a stop."""

    start_of: int = -1
    end_of: int = -1


def _first_corners(curve: EnergyCurve, most: float) -> list[tuple[float, float]]:
    """Duration [s] and energy [J] of the corners that a few tangents leave, up to a duration."""
    low = curve.least
    ratio = (most / low) ** (1.0 / (_FIRST_TANGENTS - 1))
    points = {low * ratio**k for k in range(_FIRST_TANGENTS - 1)} | {most}
    points.add(min(max(curve.cheapest(), low), most))

    # tangents with slopes that differ: others would meet nowhere, or far away
    lines: list[tuple[float, float]] = []
    for duration in sorted(points):
        slope, zero = curve.tangent(duration)
        if lines:
            flatter = lines[-1][0]
            if slope - flatter <= _SAME * max(abs(slope), abs(flatter)):
                continue
        lines.append((slope, zero))
    durations = [low]
    for (slope, zero), (steeper, zero_2) in itertools.pairwise(lines):
        crossing = (zero - zero_2) / (steeper - slope)
        durations.append(min(max(crossing, durations[-1]), most))
    if most > low:
        durations.append(most)
    corners = []
    for duration in durations:
        energy = max(slope * duration + zero for slope, zero in lines)
        corners.append((duration, energy))
    return corners


def _sum(terms: Mapping[int, float], more: Mapping[int, float], factor: float) -> Terms:
    """terms + factor * more."""
    result = dict(terms)
    for key, value in more.items():
        result[key] = result.get(key, 0.0) + factor * value
    return result


def _distances(
    robot: InstanceRobot,
    stays: Mapping[int, float],
    quickest: Mapping[int, float],
    *,
    forward: bool,
) -> dict[int, float]:
    """Least time from the begin of the cycle to the start of each stop; backward from the end of
    each stop to the end of the cycle.
    """
    closing = robot.closing.number
    found = {stop.number: math.inf for stop in robot.stops}
    for _ in range(len(robot.stops) + 1):
        for hop in robot.hops:
            tail, head = (hop.start, hop.end) if forward else (hop.end, hop.start)
            begin = 0.0 if tail == closing and forward else found[tail] + stays[tail]
            if tail == closing and not forward:
                begin = stays[closing]
            found[head] = min(found[head], begin + quickest[hop.number])
    return found


def _before(robot: InstanceRobot) -> dict[int, set[int]]:
    """By stop: stops that are surely passed after it, the closing one included."""
    closing = robot.closing.number
    after: dict[int, set[int]] = {}
    for stop in robot.stops:
        v = stop.number
        if v == closing:
            after[v] = set()
            continue
        # What is reached from the begin without passing v may come before it.
        seen = {closing}
        stack = [closing]
        while stack:
            at = stack.pop()
            for hop in robot.hops:
                if hop.start == at and hop.end not in seen and hop.end not in (v, closing):
                    seen.add(hop.end)
                    stack.append(hop.end)
        after[v] = {other.number for other in robot.stops} - seen - {v} | {closing}
    return after
