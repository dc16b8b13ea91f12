"""A movement that passes places on its way without a stop, in their order.

The legs from place to place are planned as movements of their own: driven with a stop at each place
they are an answer, and what any other is held against. Others are one spline through the points of
the legs with the best time scaling, straight steps with blended corners, and descents from these.
The cheapest that is certified and passes every place within its tolerance is the answer.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ir_description.cell import VIA_DISTANCE_MAX, VIA_MAX, VIA_TOLERANCE, VIA_TOLERANCES
from ir_kernels import portable
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import FreeSpace
from ir_planner.configurations import free_configurations, no_configuration
from ir_planner.curves import evenly_spaced
from ir_planner.errors import RequestError, TimingError
from ir_planner.optimize import Descents, path_of
from ir_planner.regional import MovementPlan, Searches, search_regional
from ir_planner.request import Context, Goal, bounded, within_limits
from ir_planner.scene import PlanningScene, movement_cost
from ir_planner.timing import Movement, check_requested, distinct, straight_steps
from ir_planner.trajectories.through_points import best_along
from ir_values.arrays import FloatArray

_CORNERS = 30  # of straight steps that are blended
_CONFIGURATIONS = 12  # of a pose that are looked at
_STEP = 1e-3  # s between the instants at which places are looked for
_INSTANTS = 20_000  # of a movement at most, beside its points
_PER_LEG = (2, 5)  # points between two places that a spline passes
_INSIDE = 0.9  # of the tolerance by which a place is moved towards the line beside it
_SMALL = 1e-3  # rad: points that near to the one before are left out


@dataclass(frozen=True, eq=False)
class Via:
    """Places to pass, and how near: tolerance [rad] of every joint from a configuration of the
    place; with distance [m] above 0 of the tcp's orientation, and that of the tcp.
    """

    places: tuple[Goal, ...]
    tolerance: float = VIA_TOLERANCE
    distance: float = 0.0

    def __post_init__(self) -> None:
        if len(self.places) > VIA_MAX:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"via has {len(self.places)} places: at most {VIA_MAX} are passed",
            )
        tolerance = bounded(self.tolerance, *VIA_TOLERANCES, "via_tolerance", "rad")
        distance = bounded(self.distance, 0.0, VIA_DISTANCE_MAX, "via_distance", "m")
        object.__setattr__(self, "tolerance", tolerance)
        object.__setattr__(self, "distance", distance)


class Nearness(NamedTuple):
    """How near a place is passed: tolerance [rad] of every joint; with distance [m] above 0 of the
    tcp's orientation, and that of the tcp.
    """

    tolerance: float
    distance: float


def passed_within(
    trajectory: JointTrajectory,
    places: FloatArray,
    nearness: Sequence[Nearness],
    scene: PlanningScene,
) -> list[float] | None:
    """Instants [s] at which the places (V, n) are passed, each within its nearness, one after the
    other; None where one isn't.
    """
    count = min(int(np.ceil(trajectory.duration / _STEP)), _INSTANTS) + 1
    times = np.union1d(np.linspace(0.0, trajectory.duration, count), trajectory.times)
    q = trajectory.sample(times).q
    by_pose = any(each.distance > 0.0 for each in nearness)
    poses = scene.chain.tcp_poses(q) if by_pose else None
    instants: list[float] = []
    first = 0
    for place, within in zip(places, nearness, strict=True):
        near = _near(q, poses, place, within, scene)[first:]
        if not near.any():
            return None
        first += int(np.argmax(near))
        instants.append(float(times[first]))
    return instants


def _near(
    q: FloatArray,
    poses: FloatArray | None,
    place: FloatArray,
    within: Nearness,
    scene: PlanningScene,
) -> FloatArray:
    """Which of states (N, n) are near enough to a place (n,)."""
    if poses is None or within.distance <= 0.0:
        return np.asarray(np.abs(q - place).max(axis=1) <= within.tolerance)
    wanted = scene.chain.tcp_poses(place[None])[0]
    apart = poses[:, :3, 3] - wanted[:3, 3]
    away = np.sqrt((apart * apart).sum(axis=1))
    turn = poses[:, :3, :3] - wanted[:3, :3]
    chord = np.sqrt((turn * turn).sum(axis=(1, 2)))  # 2 sqrt(2) sin(angle / 2)
    most = np.sqrt(8.0) * portable.sin(0.5 * within.tolerance)
    return np.asarray((away <= within.distance) & (chord <= most))


class ViaSearch:
    """Movement from start (n,) past all places to a goal. leg_context: of a leg, with work of its
    own. Raises RequestError, CancelledError when asked to stop.
    """

    def __init__(
        self,
        start: FloatArray,
        via: Via,
        goal: Goal,
        context: Context,
        leg_context: Callable[[], Context],
        searches: Searches,
    ) -> None:
        self.start = within_limits(
            start, context.scene.cell, "start", StatusCode.START_STATE_INVALID
        )
        self.context = context.upright_from(self.start)
        self.via = via
        self.goal = goal
        self.leg_context = leg_context
        self.searches = searches

    def plan(self) -> MovementPlan:
        """What `search` finds, as an answer."""
        journal = self.context.journal
        journal.planner_id = "via"
        journal.timing = "synchronous"
        status, movement = self.search()
        info = journal.info(self.start, self.context.joint_names)
        if movement is None:
            return MovementPlan(status, info, TrajectoryReport())
        return MovementPlan(status, info, movement.report, movement.trajectory, movement.path)

    def search(self) -> tuple[Status, Movement | None]:
        """The cheapest movement that is found, None where the status says why there is none."""
        journal = self.context.journal
        chosen = self._chain()
        if isinstance(chosen, Status):
            return chosen, None
        with journal.stage("legs") as notes:
            legs = self._legs(chosen)
            if isinstance(legs, Status):
                return legs, None
            stopping = self._stopping(legs)
            notes.append(f"{stopping.trajectory.duration:.3f} s with a stop at each place")
        best = None
        with journal.stage("without stops") as notes:
            for name, movement in self._without_stops(legs, chosen):
                if self._serves(movement, chosen) and (best is None or movement.cost < best.cost):
                    best = movement
                    notes.append(f"{name}: {movement.trajectory.duration:.3f} s")
        answer = self._best(stopping, best)
        if answer is None:
            raise self._too_short(stopping)
        times = self._instants(answer, chosen)
        assert times is not None  # of all that serve
        text = ", ".join(f"{t:.3f} s" for t in times)
        stops = "" if answer is best else ", with a stop at each"
        journal.note("via", f"passed at {text}{stops}")
        return Status.success(), answer

    def _best(self, stopping: Movement, best: Movement | None) -> Movement | None:
        """The cheaper one of both that is certified and not too long."""
        fits = [
            movement
            for movement in (best, self._lasting(stopping))
            if movement is not None and movement.prove().certified
        ]
        return min(fits, key=lambda movement: movement.cost, default=None)

    def _lasting(self, movement: Movement) -> Movement | None:
        """A movement at the requested duration; None where it takes longer."""
        requested = self.context.options.duration
        duration = movement.trajectory.duration
        if requested == 0.0:
            return movement
        return movement.stretched_by(requested / duration) if duration <= requested else None

    def _too_short(self, stopping: Movement) -> RequestError:
        check_requested(stopping.trajectory.duration, self.context)
        violation = stopping.prove().violation
        why = "nothing is certified" if violation is None else violation.sentence
        return RequestError(StatusCode.INVALID_MOTION_PLAN, f"via: {why}")

    def _chain(self) -> FloatArray | Status:
        """Configurations (V + 2, n) of start, places and goal that are cheapest together by W."""
        scene = self.context.scene
        layers = [self.start[None]]
        for k, place in enumerate((*self.via.places, self.goal)):
            configurations = self._configurations(place, k, layers[-1][0])
            if isinstance(configurations, Status):
                return configurations
            layers.append(configurations)
        cost = np.zeros(1)
        back = []
        for before, after in pairwise(layers):
            steps = movement_cost(scene.weights, before[:, None], after[None])
            whole = cost[:, None] + steps
            back.append(whole.argmin(axis=0))
            cost = whole.min(axis=0)
        k = int(cost.argmin())
        chain = [layers[-1][k]]
        for layer, came in zip(layers[-2::-1], back[::-1], strict=True):
            k = int(came[k])
            chain.append(layer[k])
        return np.array(chain[::-1])

    def _configurations(self, place: Goal, k: int, near: FloatArray) -> FloatArray | Status:
        context = self.context
        what = f"via {k + 1}" if k < len(self.via.places) else "goal"
        if place.configuration is not None:
            q = within_limits(
                place.configuration, context.scene.cell, what, StatusCode.GOAL_STATE_INVALID
            )
            return q[None]
        assert place.pose is not None  # a Goal has one of both
        solutions = free_configurations(place.pose, context.scene, context.thresholds(), near)
        if len(solutions.q) == 0:
            return no_configuration(place.pose, context.scene, solutions, place.text or what)
        return np.asarray(solutions.q[:_CONFIGURATIONS])

    def _legs(self, chain: FloatArray) -> list[Movement] | Status:
        """The movements from place to place, with a stop at each."""
        legs = []
        for k, (first, second) in enumerate(pairwise(chain)):
            context = self.leg_context().upright_from(self.start)
            options = replace(context.options, duration=0.0)
            if self.context.options.duration > 0.0:
                options = replace(options, objective="time")
            context = replace(context, options=options)
            status, movement = search_regional(first, second, context, self.searches)
            journal = self.context.journal
            journal.work.iterations += context.work.iterations
            journal.work.truncated |= context.work.truncated
            if movement is None:
                to = f"via {k + 1}" if k < len(self.via.places) else "the goal"
                return Status(status.code, f"to {to}: {status.message}")
            legs.append(movement)
        return legs

    def _stopping(self, legs: list[Movement]) -> Movement:
        """All legs as one movement."""
        times = [np.zeros(1, np.int64)]
        parts: list[list[FloatArray]] = [[], [], []]
        end = 0
        for k, leg in enumerate(legs):
            one = leg.trajectory
            first = 0 if k == 0 else 1
            times.append(one.times_ns[1:] + end)
            assert one.velocities is not None
            assert one.accelerations is not None
            for part, values in zip(
                parts, (one.positions, one.velocities, one.accelerations), strict=True
            ):
                part.append(values[first:])
            end += int(one.times_ns[-1])
        q, qd, qdd = (np.concatenate(part) for part in parts)
        names = self.context.joint_names
        trajectory = JointTrajectory(names, np.concatenate(times), q, qd, qdd)
        path = np.concatenate([legs[0].path, *(leg.path[1:] for leg in legs[1:])])
        return Movement(path, trajectory, self.context)

    def _without_stops(
        self, legs: list[Movement], chain: FloatArray
    ) -> Iterator[tuple[str, Movement]]:
        """Movements that may pass the places without a stop, with the name of their kind."""
        context = self.context
        space = FreeSpace.of(context.scene, context.safety_distance, context.work)
        pulled = self._pulled(chain)
        movements: list[Movement] = []
        steps = (distinct(np.concatenate([leg.path for leg in legs])), pulled)
        makers: list[tuple[str, Callable[[], Movement]]] = [
            ("blended", partial(straight_steps, points, context))
            for points in steps
            if 1 < len(points) <= _CORNERS and space.edges_free(points[:-1], points[1:]).all()
        ]
        splines = [self._points(legs, per_leg) for per_leg in _PER_LEG]
        splines += [pulled] if len(pulled) > 2 else []
        makers += [
            ("spline", partial(best_along, points, context, []))
            for points in splines
            if len(points) > 1
        ]
        for name, make in makers:
            if context.work.exhausted:
                return
            try:
                movement = make()
            except (TimingError, RequestError) as error:
                self.context.journal.reject(f"{name}: {error}")
                continue
            movements.append(movement)
            yield name, movement
        serving = [movement for movement in movements if self._serves(movement, chain)]
        for movement in sorted(serving, key=lambda movement: movement.cost)[:1]:
            better = Descents(self.context).improved(movement.trajectory, rounds=1)
            if better is not None:
                yield "descent", better

    def _pulled(self, chain: FloatArray) -> FloatArray:
        """The places moved towards the lines beside them, as far as the tolerance of joints lets
        them.
        """
        points = chain.copy()
        if self.via.distance > 0.0:
            return points
        most = _INSIDE * self.via.tolerance
        for k in range(1, len(points) - 1):
            middle = 0.5 * (points[k - 1] + points[k + 1])
            points[k] = chain[k] + np.clip(middle - chain[k], -most, most)
        return distinct(points)

    def _points(self, legs: list[Movement], per_leg: int) -> FloatArray:
        """Points along all legs, the places among them."""
        points = [legs[0].trajectory.positions[:1]]
        for leg in legs:
            along = evenly_spaced(path_of(leg.trajectory, self.context.scene), per_leg + 2)
            points += [along[1:-1], leg.trajectory.positions[-1:]]
        flat = np.concatenate(points)
        indices = [0]
        for k in range(1, len(flat)):
            if np.abs(flat[k] - flat[indices[-1]]).max() >= _SMALL:
                indices.append(k)
        indices[-1] = len(flat) - 1
        return np.asarray(flat[indices])

    def _instants(self, movement: Movement, chain: FloatArray) -> list[float] | None:
        """When a movement passes the places; None where it misses one."""
        places = chain[1:-1]
        near = [Nearness(self.via.tolerance, self.via.distance)] * len(places)
        return passed_within(movement.trajectory, places, near, self.context.scene)

    def _serves(self, movement: Movement, chain: FloatArray) -> bool:
        """Whether a movement is certified, passes all places, and is as long as requested."""
        requested = self.context.options.duration
        if requested > 0.0 and abs(movement.trajectory.duration - requested) > 1e-6 * requested:
            return False
        violation = movement.prove().violation
        if violation is not None:
            self.context.journal.reject(f"without stops: {violation.what}")
            return False
        if self._instants(movement, chain) is None:
            self.context.journal.reject("without stops: a place is missed")
            return False
        return True
