"""Context of one request: what every stage needs to know, as one value."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ir_description.cell import ToolTilt
from ir_description.robot import ToolLimits
from ir_msgs_py.options import NO_TILT, ROBOTS_TIME_VALUE, TILT_MAX, UP, PlanOptions
from ir_msgs_py.report import PlanningInfo, PlanningStage, Rejection
from ir_msgs_py.search_log import ConfigurationLog, SearchLog
from ir_msgs_py.status import StatusCode
from ir_planner.errors import CancelledError, RequestError
from ir_planner.scene import MotionLimits, PlanningScene, ToolBounds, ToolCone
from ir_values.arrays import FloatArray

# How much work a request may cost: counted in certified edges, with time only as a ceiling, and
# how to stop it.
#
# Counting work keeps answers reproducible; a clock that cuts an answer short makes it say
# `truncated`.

Clock = Callable[[], float]


@dataclass
class Work:
    """Work left for one request.

    `max_iterations`: edges that searches may certify; the evaluations of a descent count as edges
    too. `deadline` [s] on `clock`. `cancelled` is asked at every step. `improvement`: how much of
    the work may go into better answers once there is one. `threads`: that may share it, 0: one per
    core; no answer depends on it.
    """

    max_iterations: int
    deadline: float
    clock: Clock
    cancelled: Callable[[], bool] = lambda: False
    improvement: int = 2_500
    threads: int = 0
    iterations: int = field(default=0, init=False)
    truncated: bool = field(default=False, init=False)

    def spend(self, edges: int) -> None:
        """Count work. Raises CancelledError when the caller asked to stop."""
        self.iterations += edges
        self.check()

    def check(self) -> None:
        """Raise CancelledError when the caller asked to stop."""
        if self.cancelled():
            raise CancelledError("stopped on request")

    @property
    def left(self) -> int:
        """Edges that may still be certified."""
        return max(self.max_iterations - self.iterations, 0)

    @property
    def late(self) -> bool:
        """Whether the time is up (then `truncated`)."""
        if self.clock() >= self.deadline:
            self.truncated = True
        return self.truncated

    @property
    def exhausted(self) -> bool:
        """Whether searches must end: by work, or cut by time."""
        return self.late or self.iterations >= self.max_iterations

    @property
    def ended_by(self) -> str:
        """The ceiling that ended searches before all was tried; "": none."""
        if self.truncated:
            return "planning_time"
        return "max_iterations" if self.left < self.improvement else ""


@dataclass
class Journal:
    """Kept by one request; the clock is its budget's."""

    work: Work
    seed: int
    begin: float = 0.0
    planner_id: str = ""
    timing: str = ""  # which the answer is
    stages: list[PlanningStage] = field(default_factory=list)
    rejected: Counter[str] = field(default_factory=Counter)
    too_heavy: int = 0  # candidates dropped for a load that can't even be moved slowly
    logs: list[SearchLog] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.begin = self.work.clock()

    @contextmanager
    def stage(self, name: str) -> Iterator[list[str]]:
        """Time a stage; what is appended to the list becomes its note."""
        notes: list[str] = []
        begin = self.work.clock()
        try:
            yield notes
        finally:
            self.stages.append(PlanningStage(name, self.work.clock() - begin, "; ".join(notes)))

    def note(self, name: str, text: str) -> None:
        """A remark without duration."""
        if text:
            self.stages.append(PlanningStage(name, 0.0, text))

    def reject(self, reason: str) -> None:
        """Count a candidate dropped for a reason."""
        self.rejected[reason] += 1

    def keep(self, log: SearchLog) -> None:
        """Let a log of a search travel with the answer; of searches at one station the first."""
        known = [other.station for other in self.logs if isinstance(other, ConfigurationLog)]
        if not (isinstance(log, ConfigurationLog) and log.station in known):
            self.logs.append(log)

    def info(self, start: FloatArray | None, joint_names: tuple[str, ...]) -> PlanningInfo:
        """The record of a request from start (n,), as it goes into the answer."""
        return PlanningInfo(
            planner_id=self.planner_id,
            seed=self.seed,
            start=np.zeros(0) if start is None else start,
            start_names=() if start is None else joint_names,
            iterations=self.work.iterations,
            truncated=self.work.truncated,
            planning_time=self.work.clock() - self.begin,
            stages=tuple(self.stages),
            rejected=tuple(
                Rejection(reason, count) for reason, count in sorted(self.rejected.items())
            ),
            timing=self.timing,
            searches=tuple(self.logs),
        )


def noted(info: PlanningInfo, note: str, about: str = "options") -> PlanningInfo:
    """The record with a remark on the options, or about something else ("": none)."""
    return replace(info, stages=(*info.stages, PlanningStage(about, 0.0, note))) if note else info


def one_tilt(asked: Mapping[str, ToolTilt | None], what: str) -> ToolTilt | None:
    """The smallest tilt of those who ask for one, by their names; None: nobody does. Raises
    RequestError where they are of different axes or directions.
    """
    given = {name: tilt for name, tilt in asked.items() if tilt is not None}
    if len({(tilt.axis, tilt.direction) for tilt in given.values()}) > 1:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"{what}: {' and '.join(given)} bound the tilt of different axes of the tool, or from "
            "different directions: they must be the same",
        )
    return min(given.values(), key=lambda tilt: tilt.most, default=None)


def upright_options(options: PlanOptions, scene: PlanningScene, start: FloatArray) -> PlanOptions:
    """The options with tilt_direction, and tilt_axis where none is given: that which points in the
    direction at the start (n,). A tilt of pi bounds nothing.
    """
    if options.tilt_max == NO_TILT or options.tilt_max >= TILT_MAX:
        return _leaning_freely(options)
    direction = options.tilt_direction or UP
    axis = options.tilt_axis
    if not axis:
        turned = scene.chain.tcp_poses(np.asarray(start)[None])[0, :3, :3]
        axis = tuple((turned * np.array(direction)[:, None]).sum(axis=0).tolist())
    return replace(options, tilt_axis=axis, tilt_direction=direction)


def _leaning_freely(options: PlanOptions) -> PlanOptions:
    if options.tilt_max == NO_TILT:
        return options
    return replace(options, tilt_max=NO_TILT, tilt_axis=(), tilt_direction=())


def cone_of(options: PlanOptions, scene: PlanningScene) -> ToolCone | None:
    """The cone that options with an axis ask for; None: none."""
    if options.tilt_max == NO_TILT or not options.tilt_axis:
        return None
    axis, direction = (np.array(of) for of in (options.tilt_axis, options.tilt_direction or UP))
    return ToolCone(scene.chain, axis, direction, options.tilt_max)


def tool_bounds_of(options: PlanOptions, scene: PlanningScene, station: str = "") -> ToolBounds:
    """How fast the tool may be: what the request, the loads and the station say."""
    asked = [ToolLimits(options.tool_speed, options.tool_acceleration, options.whole_tool)]
    asked += [s.limits for s in scene.cell.stations if s.name == station]
    return scene.tool_bounds.within(ToolBounds.of(asked))


@dataclass(frozen=True, eq=False)
class Context:
    """scene: where the robot moves. options: as they were checked, with the robot's own price of a
    second where none was given. journal: what happened so far; it counts the work. station: whose
    allowed contacts hold in its zone; "": nobody's. motion (2, 2, n): qd, qdd at the start and at
    the goal of a movement that isn't at rest at both; None: it is.
    """

    scene: PlanningScene
    options: PlanOptions
    journal: Journal
    station: str = ""
    motion: FloatArray | None = None

    def __post_init__(self) -> None:
        if self.options.time_value == ROBOTS_TIME_VALUE:
            options = replace(self.options, time_value=self.scene.cell.robot.time_value)
            object.__setattr__(self, "options", options)

    @staticmethod
    def of(scene: PlanningScene, options: PlanOptions, work: Work, station: str = "") -> "Context":
        """The context of a new request, with a journal of its own."""
        return Context(scene, options, Journal(work, options.seed), station)

    @property
    def work(self) -> Work:
        """What the request may still cost."""
        return self.journal.work

    @property
    def safety_distance(self) -> float:
        """S_m [m]."""
        return self.options.safety_distance

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the robot's order."""
        return self.scene.cell.robot.joint_names

    @cached_property
    def limits(self) -> MotionLimits:
        """The robot's bounds times the request's scalings, and those of the tool."""
        options = self.options
        limits = self.scene.limits.scaled(options.velocity_scaling, options.acceleration_scaling)
        return replace(limits, tool=self.tool_bounds)

    @cached_property
    def tool_bounds(self) -> ToolBounds:
        """How fast the tool may be."""
        return tool_bounds_of(self.options, self.scene, self.station)

    @cached_property
    def cone(self) -> ToolCone | None:
        """In which the tool has to stay; None: nothing is asked, or its axis is that of a start
        which nobody has named yet.
        """
        return cone_of(self.options, self.scene)

    def leaning_by(self, tilt: ToolTilt | None) -> "Context":
        """The same with what the cell asks of the tool's tilt beside the request. Raises
        RequestError where both bound different axes.
        """
        options = self.options
        own = None
        if options.tilt_max != NO_TILT:
            own = ToolTilt(options.tilt_max, options.tilt_axis, options.tilt_direction)
        both = one_tilt({"the cell": tilt, "the request": own}, "the movement")
        if both is None or both is own:
            return self
        asked = replace(
            options, tilt_max=both.most, tilt_axis=both.axis, tilt_direction=both.direction
        )
        return replace(self, options=asked)

    def upright_from(self, start: FloatArray) -> "Context":
        """The context with the axis named whose tilt counts on a movement from start (n,)."""
        if self.options.tilt_max == NO_TILT:
            return self
        return replace(self, options=upright_options(self.options, self.scene, start))

    def leaning_freely(self) -> "Context":
        """The context without a bound of the tool's tilt."""
        return replace(self, options=_leaning_freely(self.options))

    @property
    def at_rest(self) -> tuple[bool, bool]:
        """Whether the movement starts and ends at rest."""
        if self.motion is None:
            return True, True
        return not self.motion[0].any(), not self.motion[1].any()

    def in_motion(self, motion: FloatArray | None) -> "Context":
        """The context of a movement with motion (2, 2, n) at its ends: qd [rad/s] and qdd
        [rad/s^2] at start and goal; None: at rest.
        """
        return replace(self, motion=motion)

    def thresholds(self) -> FloatArray:
        """Distance (Z,) m that each pair must exceed."""
        return self.scene.thresholds(self.safety_distance, self.station)

    def asking(self, objective: str, duration: float = 0.0) -> "Context":
        """The context with another objective and requested duration [s], 0: free."""
        return replace(self, options=replace(self.options, objective=objective, duration=duration))

    def valuing_time(self, times: float) -> "Context":
        """The same asking for least J where a second is worth so many times the robot's own value
        of it.
        """
        time_value = times * self.scene.cell.robot.time_value
        options = replace(self.options, objective="time_and_energy", time_value=time_value)
        return replace(self, options=options)

    def planned_by(self, planner_id: str) -> "Context":
        """The context that asks for another search."""
        return replace(self, options=replace(self.options, planner_id=planner_id))

    def with_timing(self, timing: str) -> "Context":
        """The same with "synchronous" or "asynchronous" joints."""
        return replace(self, options=replace(self.options, timing=timing))

    def at(self, station: str) -> "Context":
        """The context with the allowed contacts of a station."""
        return replace(self, station=station)

    def inside(self, scene: PlanningScene) -> "Context":
        """The context in another scene of the request: other loads, other places of the parts."""
        return replace(self, scene=scene)
