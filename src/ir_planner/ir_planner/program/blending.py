"""Movements of a program that are joined where nobody needs the robot to stand still.

Between two movements the robot rests: at the outer end of a station's line, and at a stop. Where
the cell allows a blend and nothing happens there, the second movement begins before the first has
ended: q(t) = q1(t) + q2(t) - q(rest). The longest overlap is taken that is certified and passes the
place within the blend; then its time scaling and its path are optimised. What costs less with the
rest keeps it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ir_msgs_py.report import MovementKind
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import NS_PER_S, JointTrajectory
from ir_planner.checks import clearance_violation, tilt_violation, torque_proof, verified
from ir_planner.errors import RequestError
from ir_planner.optimize import QUICK_TIMING, Descents, rescaled
from ir_planner.program.choice import Choice, Found, JoinedMovement
from ir_planner.program.cycle_time import SHORTEST_WAIT, Timed, TimedChoice, timed_choice
from ir_planner.program.movement_fronts import FASTEST, TimeValues
from ir_planner.program.request import Progress
from ir_planner.program.station_graph import ACROSS, ENTER, LEAVE, HopPart
from ir_planner.program.steps import Route
from ir_planner.request import Context
from ir_planner.timing import Movement, request_cost
from ir_planner.trajectories import Nearness, passed_within
from ir_values.arrays import FloatArray

RADIANS_PER_METRE = 4.0  # of the tool's turning: a rad counts 0.25 m, as along paths of the tool
_HALVINGS = 5  # of the longest overlap
_SHARES = (0.7, 0.4)  # of the longest certified overlap: what costs least is taken
_BETWEEN = 300_000  # ns: knots that are nearer to each other leave a jerk of rounding
_SHIFT = 170_000  # ns, by which an overlap is shortened where two knots are
_SHIFTS = 40
_MOST = 0.95  # of the shorter movement, of which the whole would undo a line in and out again
_SHORTEST = 2_000_000  # ns of an overlap
_LESS = 1e-6  # relative, that a joined movement costs at least
_SAME_TIME = 1e-5  # s
_TIMED_ANEW = 6  # movements of a run at most whose path gets another time scaling
STAGE = "blending"
"""Of the journal."""
NOTHING_CHEAPER = "nothing is cheaper without standing still"
"""What is noted there."""


def blend_at(route: Route, place: int, asked: float) -> float:
    """How near [m] a stop is passed: as its step says, else the request (below 0: it doesn't), else
    its station; 0 before the first stop.
    """
    if place < 0:
        return 0.0
    step = route.at(place).step
    if step.kind == "PATH":
        return 0.0
    if step.blend is not None:
        return step.blend
    if asked >= 0.0:
        return asked
    return route.scenes.cell.station(step.target).blend if step.kind == "STATION" else 0.0


class PassedPlace(NamedTuple):
    """Where a program stands still between two movements: its name, the joints (n,) [rad], and how
    near [m] it may be passed instead. stop: its name where it is one, "": the end of a line.
    """

    name: str
    stop: str
    q: FloatArray
    blend: float

    @property
    def nearness(self) -> Nearness:
        """Of the tcp and of its orientation."""
        return Nearness(min(RADIANS_PER_METRE * self.blend, np.pi), self.blend)


@dataclass(frozen=True, eq=False)
class _Run:
    """Movements in order with the places between them; joined: what they became, None for one that
    stays as it is.
    """

    parts: tuple[HopPart, ...]
    legs: tuple[Movement, ...]
    places: tuple[PassedPlace, ...] = ()
    joined: JoinedMovement | None = None

    @property
    def movements(self) -> tuple[Movement, ...]:
        """What is driven."""
        return self.legs if self.joined is None else (self.joined.movement,)

    @property
    def seconds(self) -> float:
        """How long the movements of the parts take."""
        return sum(leg.trajectory.duration for leg in self.legs)


class Blending:
    """Joins the movements of a chain, by the objective of a context, None: that of its request.
    lasting: they take as long as those of their parts, and are compared by joules at the mains.
    """

    def __init__(
        self, choice: Choice, context: Context | None = None, *, lasting: bool = False
    ) -> None:
        self.choice = choice
        self.lasting = lasting
        self.context = context or choice.movements.context
        self.route = choice.movements.route
        stations = self.route.scenes.cell.stations
        # where something has to be kept beside what holds everywhere
        self._special = {
            station.name for station in stations if station.allowed_contacts or station.limits.asked
        }
        self.places: dict[HopPart, PassedPlace] = {}
        for before, after in pairwise(choice.parts):
            place = self._place(before, after, choice.request.blend)
            if place is not None:
                self.places[after] = place

    def joined(self, found: Found) -> list[JoinedMovement]:
        """Movements that cost less than those of their parts with the rests between them.

        Where two stations say what a movement has to keep, one of them is left out: by what is
        joined from the first movement on, or from the last.
        """
        orders = (False, True)[: min(len({self._own(part) for part in self.choice.parts}), 2)]
        rows = [self._runs(found, backwards=backwards) for backwards in orders]
        finished = [[self._finished(run) for run in row] for row in rows]
        best = min(
            finished, key=lambda row: sum(self._cost(one) for run in row for one in run.movements)
        )
        return [run.joined for run in best if run.joined is not None]

    def said(self, joined: Sequence[JoinedMovement]) -> str:
        """Which places joined movements pass, and which they don't."""
        passed = {part for join in joined for part in join.parts[1:]}
        said = [place.name for part, place in self.places.items() if part in passed]
        rests = [place.name for part, place in self.places.items() if part not in passed]
        kept = f"; it stands still at {', '.join(rests)}" if rests else ""
        return f"passed without standing still: {', '.join(said)}{kept}"

    def _cost(self, movement: Movement) -> float:
        if self.lasting:
            return movement.energy.total
        return request_cost(movement.consumption, self.context.options)

    def _own(self, part: HopPart) -> str:
        """The station that says what the movement of a part has to keep; "": none."""
        name = self.route.name(part.hop - (part.kind == LEAVE))
        return name if part.kind != ACROSS and name in self._special else ""

    def _place(self, before: HopPart, after: HopPart, asked: float) -> PassedPlace | None:
        """The rest between two parts where it may be passed; None where it is needed."""
        route = self.route
        movements = self.choice.movements
        for part in (before, after):
            node = movements.nodes(part)[1]
            step = route.at(part.hop).step
            if (part.kind == ACROSS and step.via) or (part.kind == ENTER and node.driven):
                return None
        if before.hop == after.hop:
            stops = [before.hop - 1] if before.kind == LEAVE else []
            stops += [before.hop] if after.kind == ENTER else []
        else:
            stops = list(range(before.hop, after.hop))
            if not all(self._is_passable(stop) for stop in stops):
                return None
        blend = min(blend_at(route, stop, asked) for stop in stops)
        if blend <= 0.0:
            return None
        name = route.name(stops[-1])
        q = movements.ends(after)[0]
        if before.hop == after.hop:
            return PassedPlace(f"outer end at {name}", "", q, blend)
        return PassedPlace(name, name, q, blend)

    def _is_passable(self, stop: int) -> bool:
        """Whether nothing happens at a stop, and before the next movement."""
        route = self.route
        if stop + 1 >= len(route) or route.stops[stop] + 1 != route.stops[stop + 1]:
            return False
        step = route.at(stop).step
        following = route.at(stop + 1).step
        handled = step.attach or step.detach or step.set_signals or step.carries
        return (
            not (handled or step.dwell or following.wait_for)
            and route.arriving(stop) is route.arriving(stop + 1)
            and route.tilt(stop) == route.tilt(stop + 1)
        )

    def _runs(self, found: Found, *, backwards: bool) -> list[_Run]:
        """The movements, those that can be joined in runs; made from the first one on, or from the
        last.
        """
        runs: list[_Run] = []
        for part in reversed(self.choice.parts) if backwards else self.choice.parts:
            new = _Run((part,), (found[part],))
            if runs:
                first, second = (new, runs[-1]) if backwards else (runs[-1], new)
                place = self.places.get(second.parts[0])
                whole = None if place is None else self._extended(first, second, place)
                if whole is not None:
                    runs[-1] = whole
                    continue
            runs.append(new)
        return runs[::-1] if backwards else runs

    def _context(self, run: _Run) -> tuple[Context, MovementKind] | None:
        """What a run has to keep, and its kind; None where two stations say what."""
        first = run.parts[0]
        last = run.parts[-1]
        own = {self._own(part) for part in run.parts} - {""}
        here = self.route.name(first.hop - 1) if first.kind == LEAVE else ""
        there = self.route.name(last.hop) if last.kind == ENTER else ""
        if len(own) > 1 or not own <= {here, there}:
            return None
        station = next(iter(own), there or here)
        kind = MovementKind.REGIONAL
        if station:
            entering = station == there
            kind = MovementKind.SERVICE_ENTRY if entering else MovementKind.SERVICE_EXIT
        return self.choice.movements.asking(first, self.context).at(station), kind

    def _extended(self, first: _Run, second: _Run, place: PassedPlace) -> _Run | None:
        """Both as the cheapest movement that is found; None where none is cheaper than both with a
        rest between them.
        """
        whole = _Run(
            first.parts + second.parts,
            first.legs + second.legs,
            (*first.places, place, *second.places),
        )
        asked = self._context(whole)
        if asked is None:
            return None
        context, kind = asked
        apart = (*first.movements, *second.movements)
        best = min(self._overlaps(first, second, whole, context), key=self._cost, default=None)
        least = sum(map(self._cost, apart))
        if best is None or self._cost(best) >= least * (1.0 - _LESS):
            return None
        stops = tuple(each.stop for each in whole.places if each.stop)
        return replace(whole, joined=JoinedMovement(best, whole.parts, kind, stops))

    def _overlaps(
        self, first: _Run, second: _Run, whole: _Run, context: Context
    ) -> Iterator[Movement]:
        """Overlapping movements of two runs that serve: within all limits as they are, and on a
        free path that is timed anew.
        """
        before = first.movements[0]
        after = second.movements[0]
        ends = (before.trajectory, after.trajectory)
        shorter = min(first.legs[-1].trajectory.duration, second.legs[0].trajectory.duration)
        most = int(_MOST * shorter * NS_PER_S)
        path = np.concatenate([before.path, after.path[1:]])
        timing = before.timing if before.timing != "synchronous" else after.timing
        place = whole.places[len(first.places)]

        def overlap(by: int, driveable: bool) -> JointTrajectory | None:
            found = overlapped(*ends, by)
            if found is None:
                return None
            both, window = found
            kept = _passes(window, [place], context) and _is_free(window, context)
            return both if kept and (not driveable or _is_driveable(window, context)) else None

        for driveable in (True, False):
            by, longest = _longest(partial(overlap, driveable=driveable), most)
            if longest is None:
                continue
            movement = Movement(path, longest, context, timing=timing)
            if driveable:
                fast = self.lasting or context.options.objective == "time"
                shares = () if fast else _SHARES
                tried = [longest, *(overlap(int(share * by), True) for share in shares)]
                for each in tried:
                    if each is not None:
                        yield self._in_time(replace(movement, trajectory=each), whole)
            elif len(whole.legs) <= _TIMED_ANEW and not context.work.exhausted:
                timed = rescaled(movement, self._asking(context, whole), QUICK_TIMING)
                if timed is not None and self._serves(timed, whole):
                    yield timed

    def _asking(self, context: Context, run: _Run) -> Context:
        """What a joined movement is optimised for."""
        return context.asking("energy", run.seconds) if self.lasting else context

    def _in_time(self, movement: Movement, run: _Run) -> Movement:
        """The movement of a run, as slow as that has to be."""
        if not self.lasting:
            return movement
        slower = movement.stretched_by(run.seconds / movement.trajectory.duration)
        return replace(slower, context=self._asking(movement.context, run))

    def _finished(self, run: _Run) -> _Run:
        """A run with the best movement near its own that is certified as a whole; without a joined
        one where none is cheaper than its parts.
        """
        join = run.joined
        if join is None:
            return run
        candidates = [join.movement]
        context = join.movement.context
        if self.choice.movements.descends and not context.work.exhausted:
            asked = self._asking(context, run)
            moved = Descents(asked).improved(join.movement.trajectory, rounds=1)
            candidates += [] if moved is None else [moved]
        serving = [each for each in candidates if self._serves(each, run)]
        best = min(serving, key=self._cost, default=None)
        least = sum(map(self._cost, run.legs))
        if best is None or self._cost(best) >= least * (1.0 - _LESS):
            return replace(run, joined=None)
        return replace(run, joined=replace(join, movement=best))

    def _serves(self, movement: Movement, run: _Run) -> bool:
        """Whether a movement passes all places, and is certified."""
        if self.lasting and abs(movement.trajectory.duration - run.seconds) > _SAME_TIME:
            return False
        if not _passes(movement.trajectory, run.places, movement.context):
            return False
        violation = movement.prove().violation
        if violation is not None:
            movement.context.journal.reject(f"{STAGE}: {violation.what}")
        return violation is None


def _longest(
    overlap: Callable[[int], JointTrajectory | None], most: int
) -> tuple[int, JointTrajectory | None]:
    """The longest overlap [ns] up to `most` that is found to be one, and what it makes."""
    found = overlap(most)
    low = most
    high = most
    if found is None:
        low = 0
        for _ in range(_HALVINGS):
            middle = (low + high) // 2
            tried = overlap(middle)
            if tried is None:
                high = middle
            else:
                low = middle
                found = tried
    return low, found


def _passes(trajectory: JointTrajectory, places: Sequence[PassedPlace], context: Context) -> bool:
    near = [place.nearness for place in places]
    q = np.array([place.q for place in places])
    return passed_within(trajectory, q, near, context.scene) is not None


def _is_free(trajectory: JointTrajectory, context: Context) -> bool:
    """Whether a part of a movement keeps the distances and the tilt that the movement has to."""
    margin = context.safety_distance
    near = clearance_violation(trajectory, context.scene, margin, context.station)
    return near is None and tilt_violation(trajectory, context.cone) is None


def _is_driveable(trajectory: JointTrajectory, context: Context) -> bool:
    """Whether a part of a movement keeps all limits."""
    scene = context.scene
    torque = torque_proof(trajectory, scene, 1.0 - scene.drives.torque_reserve)
    moving = (False, False)
    return verified(trajectory, scene, None, torque, moving, None, context.tool_bounds).certified


def overlapped(
    first: JointTrajectory, second: JointTrajectory, by: int
) -> tuple[JointTrajectory, JointTrajectory] | None:
    """Both motions, the second begun `by` ns before the first has ended, from where that ends, and
    the part of it in which both move; a little less of it where knots would lie next to each other,
    None where less is nothing.
    """
    for _ in range(_SHIFTS):
        if by < _SHORTEST:
            return None
        begin = int(first.times_ns[-1]) - by
        times = np.union1d(first.times_ns, second.times_ns + begin)
        if np.diff(times).min() >= _BETWEEN:
            break
        by -= _SHIFT
    else:
        return None
    one = first.sample(times / NS_PER_S)
    other = second.sample((times - begin) / NS_PER_S)
    q = one.q + (other.q - second.positions[0])
    q[0] = first.positions[0]
    q[-1] = second.positions[-1]
    values = (q, one.qd + other.qd, one.qdd + other.qdd)
    both = (times >= begin) & (times <= first.times_ns[-1])
    names = first.joint_names
    return (
        JointTrajectory(names, times, *values),
        JointTrajectory(names, times[both] - begin, *(part[both] for part in values)),
    )


# Within a cycle time: the time that a blend saves is spent on the joined movement itself, or, where
# the cycle is too short for a program that stands still, on all movements alike.


def timed_with_blends(
    choice: Choice, cycle_time: float, standing: float, progress: Progress
) -> TimedChoice:
    """The cheapest movements for a cycle [s] of which `standing` s are pauses, without the rests
    that cost more. Raises what `timed_choice` raises.
    """
    try:
        timed = timed_choice(choice, cycle_time, standing, progress)
    except RequestError:
        faster = _shortest(choice, cycle_time, standing)
        if faster is None:
            raise
        return faster
    return blended(timed)


def blended(timed: TimedChoice) -> TimedChoice:
    """The same movements in the same time, without the rests that cost more."""
    blending = Blending(timed.choice, lasting=True)
    context = timed.choice.movements.context
    if not blending.places or context.work.exhausted:
        return timed
    with context.journal.stage(STAGE) as notes:
        joined = blending.joined(timed.timed.movements)
        passing = replace(timed, joined=tuple(joined))
        if not joined or passing.energy >= timed.energy:
            notes.append(NOTHING_CHEAPER)
            return timed
        notes.append(blending.said(joined))
    return passing


def _shortest(choice: Choice, cycle_time: float, standing: float) -> TimedChoice | None:
    """The fastest movements without rests, slowed down evenly to the cycle; None where nothing is
    joined. Raises RequestError where they are too slow.

    cycle_time [s], of which `standing` s are pauses.
    """
    context = choice.movements.context
    blending = Blending(choice, context.asking("time"))
    if not blending.places or context.work.exhausted:
        return None
    values = TimeValues(choice.ladder, choice.parts)
    values.bracket(0.0, FASTEST - 1)
    found = values.fastest
    with context.journal.stage(STAGE) as notes:
        joined = blending.joined(found)
        notes.append(blending.said(joined) if joined else NOTHING_CHEAPER)
    if not joined:
        return None
    within = {part for join in joined for part in join.parts}
    alone = [movement for part, movement in found.items() if part not in within]
    driven = [*(join.movement for join in joined), *alone]

    # what is left of the cycle for movements whose time isn't fixed
    fixed = sum(one.trajectory.duration for one in driven if one.fixed_time)
    moving = sum(one.trajectory.duration for one in driven if not one.fixed_time)
    left = cycle_time - standing - fixed
    if moving > left:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"cycle_time is {cycle_time:g} s: the shortest is {standing + fixed + moving:.3f} s, "
            f"of which {standing:.3f} s are pauses",
        )
    factor = float(np.floor(1e6 * left / moving) / 1e6)
    slower = {part: _movement_slowed(movement, factor) for part, movement in found.items()}
    slower_joined = [
        replace(join, movement=_movement_slowed(join.movement, factor)) for join in joined
    ]
    slower_alone = [movement for part, movement in slower.items() if part not in within]
    driven = [*(join.movement for join in slower_joined), *slower_alone]
    wait = cycle_time - standing - sum(one.trajectory.duration for one in driven)
    energy = sum(one.energy.total for one in driven)
    timed = Timed(slower, wait if wait >= SHORTEST_WAIT else 0.0, energy)
    return TimedChoice(choice, timed, cycle_time, joined=tuple(slower_joined))


def _movement_slowed(movement: Movement, factor: float) -> Movement:
    """The movement slower by a factor, where it may be and that is certified."""
    if movement.fixed_time:
        return movement
    slower = movement.stretched_by(max(factor, 1.0))
    return slower if slower.prove().certified else movement
