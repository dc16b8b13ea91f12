"""Trajectory execution: path time with speed scaling, hold, stop along the path, tolerances.

The semantics are those of ros2_controllers' joint_trajectory_controller; docs/driver.md says what
that leaves open.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ir_description import RobotModel
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.motion.goal import (
    ErrorCode,
    ExecutionSettings,
    GoalOutcome,
    GoalTolerances,
    TrajectoryGoal,
)
from ir_sim_driver.motion.path import Path, PathMotion
from ir_sim_driver.motion.tool_point import EXACT_FROM, ToolPoint
from ir_sim_driver.motion.trajectory_checks import CurrentPath, LeadPath
from ir_sim_driver.plant import Backend
from ir_values.arrays import FloatArray

_STOPPED = "stopped on the path"
_NOT_BEGUN = "it had not begun to move"
"""How sentences end of goals that a stop along the path ends."""

# Commands of the steps ahead: while path time passes evenly, many cost what one does.

_STEPS = 64
"""At once: the array functions' own time is spread over them, and few are dropped when the speed
changes.
"""


def ahead(path: Path, s: float, step: float) -> Iterator[tuple[float, FloatArray]]:
    """Path times [s] and commands (n,) after one, two, ... steps of path time from s < duration on.

    Path times are summed as one step after another would; the last pair, if it is reached, is the
    end.
    """
    times = np.add.accumulate(np.concatenate(([s], np.full(_STEPS, step))))[1:]
    within = times[times < path.duration]
    commands = path.positions(within)
    commands.setflags(write=False)  # they are handed out
    yield from zip(within.tolist(), commands, strict=True)
    if len(within) < _STEPS:
        yield path.duration, path.end


# The speed along the path: scaling, hold and stop brake here, so that they never leave the path.
#
# With s the path time, qdd = q'' sd^2 + q' sdd: the limits of acceleration and torque bound sdd.

_TINY = 1e-12


class PathSpeed:
    """Speed sd of the path time, from 0 to 1 and towards `target`.

    dynamics: an ir_kernels DynamicsModel (torques along the path); acceleration_max (n,); stop_time
    [s]: the shortest stop from full speed.
    """

    def __init__(
        self, dynamics: DynamicsModel, acceleration_max: FloatArray, stop_time: float, dt: float
    ) -> None:
        self.dynamics = dynamics
        self._limit = acceleration_max
        self._rate = 1.0 / stop_time
        self._dt = dt
        self.value = 0.0

    def set_stop_time(self, stop_time: float) -> None:
        """Take another shortest stop [s]."""
        self._rate = 1.0 / stop_time

    def advance(self, target: float, motion: PathMotion) -> float:
        """Step towards another target; the path time [s] covered. motion: at the present path
        time.
        """
        before = self.value
        wanted = min(max((target - before) / self._dt, -self._rate), self._rate)
        low, high = self._bounds(motion, wanted < 0.0)
        wanted = min(max(wanted, low), high)
        after = before + wanted * self._dt
        if (wanted < 0.0 and after < target) or (wanted > 0.0 and after > target) or after < 0.0:
            after = target
        self.value = min(max(after, 0.0), 1.0)
        return 0.5 * (before + self.value) * self._dt

    def _bounds(self, motion: PathMotion, braking: bool) -> tuple[float, float]:
        """Range of sdd within the limits; when it is empty: what exceeds them least while slowing
        down.
        """
        v = motion.qd * self.value
        base = motion.qdd * self.value**2
        low, high = _range(motion.qd, base, self._limit)
        rows = np.array((base, base + motion.qd))
        torque = self.dynamics.inverse_dynamics(
            np.array((motion.q, motion.q)), np.array((v, v)), rows
        )
        limit = self.dynamics.torque_limit(v[None])[0]
        low_t, high_t = _range(torque[1] - torque[0], torque[0], limit)
        low = max(low, low_t)
        high = min(high, high_t)
        if low <= high:
            return low, high
        return (-self._rate, -self._rate) if braking else (0.0, 0.0)


def _range(slope: FloatArray, base: FloatArray, limit: FloatArray) -> tuple[float, float]:
    """Interval of x with |base + slope x| <= limit for all components."""
    low = -math.inf
    high = math.inf
    for k, b, bound in zip(slope.tolist(), base.tolist(), limit.tolist(), strict=True):
        if abs(k) > _TINY:
            one = (-bound - b) / k
            other = (bound - b) / k
            low = max(low, min(one, other))
            high = min(high, max(one, other))
    return low, high


@dataclass(eq=False)
class _Run:
    """The goal that is executed and how far it is."""

    outcome: GoalOutcome  # as it would end now
    route: LeadPath
    path_tolerance: GoalTolerances
    goal_tolerance: GoalTolerances
    goal_time: float
    label: str
    wait: int  # steps until it may start
    quiet: float  # bound of the tool's deviation [m] below which nothing can be broken
    error: FloatArray  # largest of each joint so far (n,) [rad]
    note: str  # what the outcome says beside how the goal ended
    s: float = 0.0
    # at an even speed
    ahead: Iterator[tuple[float, FloatArray]] = field(default_factory=lambda: iter(()))
    settling: int = 0
    stopping: bool = False
    reason: str = ""  # why it stops
    deviation: float = 0.0


@dataclass(frozen=True, eq=False)
class Following:
    """Command and robot side by side: positions (n,), velocities (n,), the command's accelerations
    (n,).
    """

    command: PathMotion
    q: FloatArray
    qd: FloatArray
    label: str
    path_time: float
    path_speed: float
    deviation: float


class Executor:
    """Follows one goal at a time; commands (n,) once per step of dt [s].

    robot: ir_description RobotModel. dynamics: ir_kernels DynamicsModel with the present load.
    """

    def __init__(
        self,
        robot: RobotModel,
        dynamics: DynamicsModel,
        tool: ToolPoint,
        settings: ExecutionSettings,
        dt: float,
        q: FloatArray,
    ) -> None:
        self._names: tuple[str, ...] = tuple(robot.joint_names)
        self._settings = settings
        self._dt = dt
        self._tool = tool
        self.stop_time = settings.stop_time  # s
        self._speed = PathSpeed(dynamics, np.array(robot.acceleration_max), settings.stop_time, dt)
        self._still: FloatArray = np.zeros(len(q))
        self._run: _Run | None = None
        self._fresh = False
        self._outcomes: list[GoalOutcome] = []
        self.command: FloatArray = np.array(q)
        self.deviation = 0.0

    @property
    def active(self) -> bool:
        """Whether a goal is executed (or still stopping)."""
        return self._run is not None

    @property
    def ended(self) -> bool:
        """Whether goals have ended since `take_outcomes`."""
        return bool(self._outcomes)

    @property
    def goal_id(self) -> int | None:
        """The goal that is executed."""
        return None if self._run is None else self._run.outcome.goal_id

    @property
    def label(self) -> str:
        """Name of the trajectory that is executed; "" while holding."""
        return "" if self._run is None else self._run.label

    @property
    def path_time(self) -> float:
        """Time [s] along the trajectory; negative in its lead-in."""
        return 0.0 if self._run is None else self._run.s - self._run.route.offset

    @property
    def path_speed(self) -> float:
        """Present speed of path time."""
        return self._speed.value if self._run is not None else 0.0

    @property
    def path(self) -> Path | None:
        """The path of the goal that is executed."""
        return None if self._run is None else self._run.route.path

    @property
    def driven(self) -> CurrentPath | None:
        """The movement that another may join; None where none goes on."""
        run = self._run
        if run is None or run.stopping or run.wait > 0 or run.s >= run.route.path.duration:
            return None
        return CurrentPath(run.route.path, run.s)

    @property
    def path_parameter(self) -> float:
        """Time [s] along the path, lead-in included."""
        return 0.0 if self._run is None else self._run.s

    @property
    def stopping(self) -> bool:
        """Whether the goal is being stopped."""
        return self._run is not None and self._run.stopping

    def set_dynamics(self, dynamics: DynamicsModel) -> None:
        """Use the dynamics of another load."""
        self._speed.dynamics = dynamics

    def set_settings(self, settings: ExecutionSettings) -> None:
        """Use other bounds from the next goal on."""
        self._settings = settings
        self.stop_time = settings.stop_time
        self._speed.set_stop_time(settings.stop_time)

    def motion(self) -> PathMotion:
        """The commanded motion now."""
        run = self._run
        v = self.path_speed
        if run is None or v == 0.0:
            return PathMotion(self.command, self._still, self._still)
        path = run.route.path.motion(run.s)
        return PathMotion(self.command, path.qd * v, path.qdd * v**2)

    def motion_in(self, seconds: float) -> PathMotion | None:
        """The commanded motion so many seconds from now, before now where below 0, as the movement
        goes on at its present speed; None before the movement began.
        """
        run = self._run
        if run is None:
            return None if seconds < 0.0 else self.motion()
        v = self.path_speed
        s = run.s + (seconds - run.wait * self._dt) * v
        if s < 0.0:
            return None if seconds < 0.0 else self.motion()
        path = run.route.path.motion(s)
        return PathMotion(path.q, path.qd * v, path.qdd * v**2)

    def following(self, q: FloatArray, qd: FloatArray) -> Following:
        """How the robot at q, qd (n,) follows."""
        return Following(
            self.motion(), q, qd, self.label, self.path_time, self.path_speed, self.deviation
        )

    def start(
        self, goal_id: int, goal: TrajectoryGoal, route: LeadPath, delay: float = 0.0
    ) -> None:
        """Follow the route, which starts at the commanded motion; a running goal ends as
        preempted.
        """
        moving = self.motion().qd.any()
        speed = self.path_speed
        before = self._run
        if before is not None:
            outcome = before.outcome
            if not before.stopping:
                self._will_end(
                    ErrorCode.INVALID_GOAL, "preempted by another trajectory", canceled=False
                )
            elif moving:
                sentence = f"{before.reason}; another trajectory took over before the robot stood"
                self._will_end(outcome.code, sentence, outcome.canceled)
            self._finish()
        s = self._settings
        path_tolerance = GoalTolerances.of(self._names, goal.path_tolerance, s.path_tolerance)
        quiet = self._tool.quiet_bound(path_tolerance.position)
        label = goal.label or goal.trajectory.trajectory_id
        self._run = _Run(
            GoalOutcome(goal_id, ErrorCode.SUCCESSFUL, "", label=label),
            route,
            path_tolerance,
            GoalTolerances.of(self._names, goal.goal_tolerance, s.goal_tolerance),
            goal.settling_time(s),
            label,
            max(0, round(delay / self._dt)),
            -1.0 if path_tolerance.has_velocity else quiet,
            np.zeros(len(self._still)),
            goal.note,
        )
        # a route from rest starts with speed zero, so path time may start at once; one in motion
        # carries on, in the present time of the path where it goes on along that
        if route.joined:
            self._speed.value = speed
            return
        self._speed.value = 1.0 if moving else 0.0
        self._fresh = not moving

    def stop(self, code: ErrorCode, reason: str, canceled: bool = False) -> None:
        """Stop along the path; the goal ends so when the robot stands, with the reason and that it
        stopped there. A stop that has begun stays.
        """
        run = self._run
        if run is not None and not run.stopping:
            has_begun = run.s != 0.0 or self._speed.value != 0.0
            sentence = f"{reason}; {_STOPPED if has_begun else _NOT_BEGUN}"
            self._will_end(code, sentence, canceled)
            run.stopping = True
            run.reason = reason

    def drop(self, sentence: str, code: ErrorCode = ErrorCode.INVALID_GOAL) -> None:
        """End the goal at once: nobody follows the command any more. One that was stopping has not
        stopped on its path, whatever it was stopped for.
        """
        run = self._run
        if run is None:
            return
        if run.stopping and code is ErrorCode.INVALID_GOAL:
            before = run.outcome
            code = code if before.code is ErrorCode.SUCCESSFUL else before.code
            sentence = f"{sentence}, before the robot stood: {run.reason}"
        self._will_end(code, sentence, canceled=False)
        self._finish()

    def hold(self, q: FloatArray) -> None:
        """Command to stay at q (n,). Only while no goal is executed."""
        self.command = np.array(q)
        self.deviation = 0.0

    def take_outcomes(self) -> list[GoalOutcome]:
        """Goals that have ended since the last call."""
        outcomes = self._outcomes
        self._outcomes = []
        return outcomes

    def advance(self, scaling: float, ready: bool = True) -> FloatArray:  # noqa: C901
        """Command (n,) for the end of this step. scaling in [0, 1]; not ready: the robot cannot
        move yet.
        """
        run = self._run
        if run is None:
            return self.command
        if run.wait > 0:
            run.wait -= 1
            if run.stopping:
                self._finish()
            return self.command
        target = 0.0 if run.stopping else scaling
        if not ready:
            if run.stopping:
                self._finish()
            return self.command
        if self._fresh:
            self._speed.value = target
            self._fresh = False
        speed = self._speed
        path = run.route.path
        if run.s < path.duration:
            if speed.value != target:
                run.ahead = iter(())
                run.s = min(run.s + speed.advance(target, path.motion(run.s)), path.duration)
                self.command = path.position(run.s)
            elif target > 0.0:
                self._go_on(run, target)
        if run.stopping and (speed.value == 0.0 or run.s >= path.duration):
            self._finish()
        return self.command

    def _go_on(self, run: _Run, speed: float) -> None:
        """Make a step at the present speed."""
        following = next(run.ahead, None)
        if following is None:
            run.ahead = ahead(run.route.path, run.s, speed * self._dt)
            following = next(run.ahead)
        run.s, self.command = following

    def supervise(self, robot: Backend) -> None:
        """Compare the robot with the command after the step: tube, tolerances, end."""
        q = robot.q
        run = self._run
        error = self._still
        size = self._still
        bound = 0.0
        if q is not self.command:
            error = self.command - q
            size = np.abs(error)
            bound = self._tool.bound(size)
        self.deviation = bound if bound <= EXACT_FROM else self._tool.deviation(self.command, q)
        if run is None:
            return
        if self.deviation > run.deviation:
            run.deviation = self.deviation
        if bound > 0.0:
            np.maximum(run.error, size, out=run.error)
        if not run.stopping:
            sentence = "" if bound <= run.quiet else self._broken(run, error, robot)
            if sentence:
                self.stop(ErrorCode.PATH_TOLERANCE_VIOLATED, sentence)
            elif run.s >= run.route.path.duration and run.wait == 0:
                self._settle(run, error, robot)

    def _broken(self, run: _Run, error: FloatArray, robot: Backend) -> str:
        sentence = run.path_tolerance.broken_position(self._names, error)
        if not sentence and run.path_tolerance.has_velocity:
            sentence = run.path_tolerance.broken_velocity(self._names, self.motion().qd - robot.qd)
        return f"{sentence} at {self.path_time:.3f} s" if sentence else ""

    def _settle(self, run: _Run, error: FloatArray, robot: Backend) -> None:
        sentence = run.goal_tolerance.broken_position(self._names, error)
        if not sentence and run.goal_tolerance.has_velocity:
            sentence = run.goal_tolerance.broken_velocity(self._names, robot.qd)
        if not sentence:
            self._finish()
            return
        run.settling += 1
        if run.settling * self._dt > run.goal_time:
            self._will_end(
                ErrorCode.GOAL_TOLERANCE_VIOLATED,
                f"{sentence} {run.goal_time:g} s after the end",
                False,
            )
            self._finish()

    def _will_end(self, code: ErrorCode, sentence: str, canceled: bool) -> None:
        assert self._run is not None
        self._run.outcome = replace(
            self._run.outcome, code=code, sentence=sentence, canceled=canceled
        )

    def _finish(self) -> None:
        run = self._run
        assert run is not None
        self._outcomes.append(
            replace(
                run.outcome,
                sentence="; ".join(text for text in (run.outcome.sentence, run.note) if text),
                max_tool_deviation=run.deviation,
                max_tracking_error=tuple(run.error.tolist()),
                settling_time=run.settling * self._dt,
            )
        )
        self._run = None
        self._speed.value = 0.0
