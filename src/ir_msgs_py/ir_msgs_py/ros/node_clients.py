"""Clients of the driver and of the planner, for coroutines of another node.

Every answer is a Status; nothing blocks, and nothing is waited for without end: while the meter is
heard the driver is alive, and when it falls silent every wait ends.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Bool, Header, UInt64

from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import ControllerTimers as ControllerTimersMsg
from ir_msgs.msg import PowerState as PowerStateMsg
from ir_msgs.srv import GetProgram, GetTrajectory, QueryModes
from ir_msgs.srv import SetLoad as SetLoadSrv
from ir_msgs.srv import SetPlcInput as SetPlcInputSrv
from ir_msgs_py.announcements import ControllerTimers
from ir_msgs_py.modes import OFF_THE_NETWORK, Mode, PowerMode
from ir_msgs_py.names import STOPS_STATE
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.ros.conversions import (
    recovery_from_msg,
    status_from_msg,
    time_from_msg,
    trajectory_from_msg,
    trajectory_to_msg,
)
from ir_msgs_py.ros.goal_clients import cancel_unanswered, new_goal_id
from ir_msgs_py.ros.plan_conversions import planned_movement_from_msg
from ir_msgs_py.ros.power_conversions import controller_timers_from_msg, power_mode_from_msg
from ir_msgs_py.ros.topics import ACTION_SERVICES, LATCHED, SERVICE, LatestMessage
from ir_msgs_py.ros.waiting import Waiting
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.errors import InvalidValueError

_UNSEEN = 1.5
"""s without a look at the meter: nodes look once a second at least, so that this process was
stopped.
"""
_AHEAD = 2.0
"""s by which stamps may be ahead of the time that has passed: a plant that lagged makes up for it,
and a reading comes late on a busy machine. Beyond that somebody has set the clock.
"""


def node_time(node: Node) -> float:
    """/clock where the node uses it, else a steady clock [s]."""
    clock = node.get_clock()
    return float(clock.now().nanoseconds) * 1e-9 if clock.ros_time_is_active else time.monotonic()


class PlantTime:
    """Seconds that have passed in the plant, by the stamps of its readings.

    A plant that gets too little of the processor lags, and makes up for it at twice the speed: what
    is to last so long in the plant is waited for in its time. Where stamps jump, or are none, the
    time of `clock` passes.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._came = 0.0
        self._seconds: float | None = None
        self.stamp_ns = 0

    def hear(self, stamp_ns: int, age: float) -> None:
        """Take the stamp of a reading that came `age` [s] ago."""
        came = self._clock() - age
        passed = came - self._came
        stamped = (stamp_ns - self.stamp_ns) * 1e-9
        believed = stamp_ns > 0 and 0.0 <= stamped <= 2.0 * passed + _AHEAD
        if self._seconds is None:
            self._seconds = 0.0
        else:
            self._seconds += stamped if believed else max(0.0, passed)
        self._came = came
        self.stamp_ns = stamp_ns

    def __call__(self) -> float:
        """Seconds since the first reading, 0 before."""
        return self._seconds or 0.0


class DriverClient:
    """Clients of one driver; times in s.

    response_timeout: for services, and to take a goal. silence_timeout: without a reading of the
    meter the driver counts as gone. cancel_timeout: to stop along the path. The meter is read when
    something is asked of it: a node that waits for nothing is not woken a hundred times a second.
    timers: those of the controller, None before they came. stops: number of the last stop, and
    stop_latched: whether it is latched; None before they came. stop_heard: called when a number has
    come.
    """

    def __init__(
        self,
        node: Node,
        waiting: Waiting,
        name: str,
        *,
        response_timeout: float = 2.0,
        silence_timeout: float = 2.0,
        cancel_timeout: float = 5.0,
        stop_heard: Callable[[], None] = lambda: None,
    ) -> None:
        self.name = name
        self._node = node
        self._stop_heard = stop_heard
        self._mode: Mode | None = None
        self.timers: ControllerTimers | None = None
        self._energy = 0.0
        self._waiting = waiting
        self._response_timeout = response_timeout
        self._silence_timeout = silence_timeout
        self._cancel_timeout = cancel_timeout
        self._heard = -float("inf")
        self._looked = -float("inf")
        self._time = PlantTime(lambda: node_time(node))
        self._plc = node.create_client(SetPlcInputSrv, f"{name}/set_plc_input", qos_profile=SERVICE)
        self._load = node.create_client(SetLoadSrv, f"{name}/set_load", qos_profile=SERVICE)
        self._modes = node.create_client(QueryModes, f"{name}/query_modes", qos_profile=SERVICE)
        self._execute = ActionClient(
            node, ExecuteTrajectory, f"{name}/execute_trajectory", **ACTION_SERVICES
        )
        self._meter = LatestMessage(node, PowerStateMsg, f"{name}/power_state")
        node.create_subscription(
            ControllerTimersMsg, f"{name}/controller_timers", self._read_timers, LATCHED
        )
        self.stops: int | None = None
        self.stop_latched: bool | None = None
        self._recovery: tuple[int, int] | None = None
        node.create_subscription(UInt64, f"{name}/stop_number", self._read_stops, LATCHED)
        node.create_subscription(Bool, f"{name}/stop_latched", self._read_latched, LATCHED)
        node.create_subscription(Header, f"{name}/last_recovery", self._read_recovery, LATCHED)

    @property
    def mode(self) -> Mode | None:
        """Power mode of the last reading; None before the first."""
        self._read_meter()
        return self._mode

    @property
    def energy(self) -> float:
        """Energy [J] of the last reading."""
        self._read_meter()
        return self._energy

    @property
    def plant_time(self) -> float:
        """Time of the plant [s] at the last reading, see `PlantTime`."""
        self._read_meter()
        return self._time()

    @property
    def stamp_ns(self) -> int:
        """Stamp [ns] of the last reading, 0 before the first."""
        self._read_meter()
        return self._time.stamp_ns

    @property
    def silent(self) -> bool:
        """Whether the meter has not been heard for too long, while this process could hear."""
        self._read_meter()
        now = time.monotonic()
        if self._mode is not None and now - self._looked > _UNSEEN:
            self._heard = now
        self._looked = now
        return now - self._heard > self._silence_timeout

    @property
    def off_the_network(self) -> bool:
        """Whether the controller hibernates, so that it answers nothing."""
        return self.mode in OFF_THE_NETWORK

    def state(self) -> Status:
        """Say whether the driver can be talked to."""
        if self.silent:
            sentence = f"nothing was heard from {self.name} for {self._silence_timeout:g} s"
            return Status(StatusCode.ROBOT_STATE_STALE, sentence)
        return Status.success()

    async def set_plc_input(self, name: str, value: bool) -> Status:
        """Set one level, the others stay."""
        return _status_of(await self.ask(self._plc, SetPlcInputSrv.Request(name=name, value=value)))

    async def set_load(self, load: str) -> Status:
        """Let the robot carry exactly this load text."""
        return _status_of(await self.ask(self._load, SetLoadSrv.Request(load=load)))

    async def query_modes(self) -> tuple[Status, tuple[PowerMode, ...]]:
        """Ask for the modes with their times."""
        response = await self.ask(self._modes, QueryModes.Request())
        if isinstance(response, Status):
            return response, ()
        return status_from_msg(response.status), tuple(
            power_mode_from_msg(mode) for mode in response.modes
        )

    async def drive(
        self,
        trajectory: JointTrajectory,
        stop: Callable[[], bool],
        cell_hash: str = "",
        load: str = "",
        station: str = "",
        states: Sequence[str] = (),
        after_stop: int | None = None,
    ) -> Status:
        """Execute a trajectory; `stop` is looked at all the time, and when it is true the goal is
        canceled.

        SUCCESS, PREEMPTED when it was stopped along the path, else the driver's code and sentence.
        The duration is not limited: speed scaling may prolong or hold a movement. cell_hash, load:
        what it was planned with, "": the driver doesn't compare. station: whose contacts are
        allowed; states: of machines that the movement relies on; after_stop: the last stop that the
        caller knows, the driver refuses the movement after a later one.
        """
        if after_stop is not None:
            states = (*states, f"{STOPS_STATE}={after_stop}")
        if not await self._waiting.until(self._execute.server_is_ready, self._response_timeout):
            return _timed_out(
                f"no node offers {self.name}/execute_trajectory", self._response_timeout
            )
        goal = ExecuteTrajectory.Goal(
            trajectory=trajectory_to_msg(trajectory),
            trajectory_id=trajectory.trajectory_id,
            cell_hash=cell_hash,
            load=load,
            station=station,
            states=list(states),
        )
        goal_id = new_goal_id()
        sent: Future = self._execute.send_goal_async(goal, goal_uuid=goal_id)
        if not await self._waiting.answer(sent, self._response_timeout):
            cancel_unanswered(self._execute, goal_id, sent)
            return _timed_out(f"{self.name} did not take the trajectory", self._response_timeout)
        handle = sent.result()
        if not handle.accepted:
            return Status(StatusCode.FAILURE, f"{self.name} rejected the trajectory")
        result = await self._result(handle, stop)
        if result.done():
            return self._status_of_goal(result.result())
        return await self._give_up(handle, result, stop())

    async def _result(self, handle: Any, stop: Callable[[], bool]) -> Future:
        """Wait for the result of a goal, or for what ends the wait before.

        The answer may be lost, as where this process was held up for longer than the middleware
        believes in it: the result is asked for again, every silence_timeout while the robot stands
        and more and more seldom while it moves.
        """
        patience = self._silence_timeout
        while True:
            result: Future = handle.get_result_async()
            answered = self._waiting.answer(
                result, patience, lambda: stop() or self.silent or self.off_the_network
            )
            if await answered:
                return result
            moves = self._mode is Mode.MOVING
            patience = 2.0 * patience if moves else self._silence_timeout

    def _status_of_goal(self, response: Any) -> Status:
        if response.status == GoalStatus.STATUS_UNKNOWN:
            sentence = f"{self.name} knows this movement no more: how it ended is not known"
            return Status(StatusCode.FAILURE, sentence)
        return _status_of_result(response.result)

    async def ask(self, client: Any, request: Any) -> Any:
        """Call a service: its response, or a Status that says why there is none."""
        if self.off_the_network:
            sentence = f"{self.name} hibernates: {client.service_name} is not available"
            return Status(StatusCode.TIMED_OUT, sentence)
        return await self._waiting.ask(client, request, self._response_timeout)

    async def _give_up(self, handle: Any, result: Future, stopped: bool) -> Status:
        alive = self.state()
        handle.cancel_goal_async()
        if not stopped:
            asleep = f"{self.name} went into hibernation during the movement"
            return alive if not alive.ok else Status(StatusCode.INVALID_ROBOT_STATE, asleep)
        if not await self._waiting.answer(result, self._cancel_timeout):
            return _timed_out(f"{self.name} did not confirm the stop", self._cancel_timeout)
        return Status(
            StatusCode.PREEMPTED, result.result().result.error_string or "stopped along the path"
        )

    def _read_stops(self, message: UInt64) -> None:
        self.stops = int(message.data)
        self._stop_heard()
        self._waiting.look()

    @property
    def recovery_known(self) -> bool:
        """Whether it is known when the last stop that was heard of was recovered, or it is latched:
        stop and recovery are told by topics of their own, and either may come late.
        """
        if self._recovery is None:  # a driver of another kind does not tell
            return self._node.count_publishers(f"{self.name}/last_recovery") == 0
        return self.stop_latched is True or self._recovery[0] == self.stops

    def recovered_after(self, sent: int) -> bool:
        """Whether the last stop was recovered after `sent` [ns of the system's clock], or may have
        been; 0: not known when that was.
        """
        if self._recovery is None or sent == 0:
            return False
        return self._recovery[0] != self.stops or sent < self._recovery[1]

    def _read_recovery(self, message: Header) -> None:
        self._recovery = recovery_from_msg(message)
        self._waiting.look()

    def _read_latched(self, message: Bool) -> None:
        self.stop_latched = bool(message.data)
        self._waiting.look()

    def _read_timers(self, message: ControllerTimersMsg) -> None:
        with contextlib.suppress(
            InvalidValueError
        ):  # of a driver of another kind: the settings' count
            self.timers = controller_timers_from_msg(message)

    def _read_meter(self) -> None:
        """Take what has come since the last look."""
        reading = self._meter.take()
        if reading is None:
            return
        self._heard = time.monotonic() - reading.age
        self._energy = float(reading.message.energy)
        self._time.hear(time_from_msg(reading.message.header.stamp), reading.age)
        if reading.message.mode != self._mode:
            self._mode = Mode(reading.message.mode)


def _status_of(response: Any) -> Status:
    return response if isinstance(response, Status) else status_from_msg(response.status)


def _status_of_result(result: Any) -> Status:
    if result.error_code == ExecuteTrajectory.Result.SUCCESSFUL:
        return Status.success(result.error_string)
    return Status(
        StatusCode.FAILURE, f"the driver aborted with {result.error_code}: {result.error_string}"
    )


def _timed_out(what: str, limit: float) -> Status:
    return Status(StatusCode.TIMED_OUT, f"{what} within {limit:g} s")


Fetched = tuple[Status, tuple[PlannedMovement, ...]]


class PlannerClient:
    """Programs and trajectories of one planner by id; timeout [s]: longest wait for each answer."""

    def __init__(self, node: Node, waiting: Waiting, name: str, timeout: float = 2.0) -> None:
        self._waiting = waiting
        self._timeout = timeout
        self._program = node.create_client(GetProgram, f"{name}/get_program", qos_profile=SERVICE)
        self._trajectory = node.create_client(
            GetTrajectory, f"{name}/get_trajectory", qos_profile=SERVICE
        )

    async def program(self, program_id: str) -> Fetched:
        """Fetch the steps of a planned program, with the points of its movements."""
        request = GetProgram.Request(program_id=program_id)
        response = await self._waiting.ask(self._program, request, self._timeout)
        if isinstance(response, Status):
            return response, ()
        status = status_from_msg(response.status)
        if not status.ok:
            return status, ()
        try:
            movements = [planned_movement_from_msg(movement) for movement in response.movements]
        except InvalidValueError as error:
            return Status(StatusCode.INVALID_MOTION_PLAN, f"program {program_id}: {error}"), ()
        return await self.with_points(movements)

    async def with_points(self, movements: Sequence[PlannedMovement]) -> Fetched:
        """Fetch the points of those movements that only have an id."""
        complete = []
        for movement in movements:
            if movement.trajectory_id and movement.trajectory is None:
                request = GetTrajectory.Request(trajectory_id=movement.trajectory_id)
                response = await self._waiting.ask(self._trajectory, request, self._timeout)
                status = (
                    response if isinstance(response, Status) else status_from_msg(response.status)
                )
                if not status.ok:
                    return status, ()
                try:
                    points = trajectory_from_msg(response.trajectory)
                except InvalidValueError as error:
                    sentence = f"trajectory {movement.trajectory_id}: {error}"
                    return Status(StatusCode.INVALID_MOTION_PLAN, sentence), ()
                complete.append(replace(movement, trajectory=points))
            else:
                complete.append(movement)
        return Status.success(), tuple(complete)
