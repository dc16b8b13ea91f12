"""The node `ir_program_runner`: fetches a program, fulfils its requests, publishes progress."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rclpy.action import CancelResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.clock import Clock, ClockType, JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import serialize_message
from rclpy.timer import Timer

from ir_description import DescriptionError, load_cell
from ir_msgs.action import RunProgram
from ir_msgs.msg import ProgramState as ProgramStateMsg
from ir_msgs.msg import Signal as SignalMsg
from ir_msgs_py import names
from ir_msgs_py.announcements import Event, ProgramState
from ir_msgs_py.modes import PREFIX, Mode, TransitionTimes
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.ros.conversions import status_to_msg, time_from_msg
from ir_msgs_py.ros.diagnostics import OK, WARN, Condition, Diagnostics
from ir_msgs_py.ros.node_clients import DriverClient, PlannerClient, node_time
from ir_msgs_py.ros.node_process import run_node
from ir_msgs_py.ros.parameters import Parameters
from ir_msgs_py.ros.plan_conversions import planned_movement_from_msg
from ir_msgs_py.ros.power_conversions import program_state_to_msg, signal_from_msg, signal_to_msg
from ir_msgs_py.ros.serving import RecordedActionServer, TakenGoals
from ir_msgs_py.ros.topics import ACTION_SERVICES, BURST, COMMANDS, CommandTopic
from ir_msgs_py.ros.waiting import Waiting
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.wake_on_lan import magic_packet, send_packet
from ir_program_runner.errors import ProgramError
from ir_program_runner.fulfilment import Fulfilment, Ports
from ir_program_runner.machines import MOST_SIGNALS, Machines, MachineTime
from ir_program_runner.program import (
    MOST_STEPS,
    Program,
    ProgramResult,
    RunProgress,
    check_program,
    check_request,
    step_name,
)
from ir_program_runner.requests import Announce
from ir_program_runner.settings import LinkSettings, ProgramSettings
from ir_values.errors import InvalidValueError

# The runner's settings as ROS parameters; none changes while a program runs.


@dataclass(frozen=True)
class RunnerParameters:
    """What the node is set to; transitions count where the driver doesn't report them."""

    program: Parameters[ProgramSettings]
    transitions: Parameters[TransitionTimes]
    links: Parameters[LinkSettings]


def declare_parameters(node: Node, busy: Callable[[], bool]) -> RunnerParameters:
    """Declare all; a change while `busy` is refused.

    Raises InvalidValueError for a bad value at the start.
    """

    def refuse(names: tuple[str, ...]) -> str:
        return (
            f"a program runs: {', '.join(names)} can be changed when it has ended" if busy() else ""
        )

    return RunnerParameters(
        Parameters(node, ProgramSettings, refuse=refuse),
        Parameters(node, TransitionTimes, prefix=PREFIX, refuse=refuse),
        Parameters(node, LinkSettings, refuse=refuse),
    )


# Diagnostics: a silent driver, or a program that failed, is a warning.


class RunnerDiagnostics:
    """One publisher of the node; `publish` once a second."""

    def __init__(self, node: Node) -> None:
        self._name = node.get_name()
        self._diagnostics = Diagnostics(node)

    def publish(
        self, progress: RunProgress | None, driver: Status, mode: Mode | None, last: Status
    ) -> None:
        """`progress`: of the running program, None for none; `last`: how the one before ended."""
        level = OK
        sentence = "ready"
        values: dict[str, object] = {
            "driver": str(driver),
            "mode": "not known" if mode is None else mode.name,
        }
        if progress is not None:
            sentence = f"step {progress.index + 1} of {progress.total}: {progress.phase}"
            values["program"] = progress.program_id
        elif not last.ok:
            level = WARN
            sentence = f"the last program did not end well: {last}"
        if not driver.ok:
            level = WARN
            sentence = f"{sentence}; {driver.message}"
        self._diagnostics.publish([Condition(self._name, level, sentence, values)])


_KEPT = QoSProfile(depth=5 * MOST_STEPS, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The longest program is kept for a recorder that comes late; a runner that works for weeks stays
small.
"""
_MOST_STATE = 65_536  # bytes that a step announces; a planned one has two thousand
_SIGNALS = COMMANDS[0]  # a driver that starts later hears them too
_FEEDBACK_PERIOD = 0.2  # s: a person reads no faster
_CLIENT_PERIOD = 0.2  # s between two looks whether the program's client is there
_MACHINES_PERIOD = 0.02  # s: cycle of the soft PLC, as a small real one has


def _machines_of(links: LinkSettings) -> Machines:
    return Machines.of(load_cell(links.cell), links.seed) if links.cell else Machines()


def _check_announced(movements: Sequence[PlannedMovement]) -> None:
    """Raise ProgramError for a step too large to be kept for recorders that come late."""
    for index, movement in enumerate(movements):
        state = ProgramState(
            stamp_ns=0,
            program_id="",
            index=index,
            total=len(movements),
            event=Event.STARTED,
            movement=movement,
        )
        size = len(serialize_message(program_state_to_msg(state)))
        if size > _MOST_STATE:
            where = step_name(index, len(movements), movement)
            sentence = f"{where} has {size} bytes without its points: at most {_MOST_STATE}"
            raise ProgramError(f"{sentence} are taken", StatusCode.INVALID_GOAL_CONSTRAINTS)


class ProgramRunnerNode(Node):
    """Runs one program at a time.

    send: sends a packet to an address and UDP port. machines: the soft PLC; None = the one of the
    parameter `cell`.
    """

    def __init__(
        self,
        send: Callable[[bytes, str, int], None] = send_packet,
        machines: Machines | None = None,
        **node_arguments: Any,
    ) -> None:
        super().__init__(names.PROGRAM_RUNNER, **node_arguments)
        self._progress: RunProgress | None = None
        self._settings = declare_parameters(self, lambda: self._progress is not None)
        links = self._settings.links.value
        self._send = send
        self._machines = _machines_of(links) if machines is None else machines
        self._waiting = Waiting(self)
        self._planner = PlannerClient(self, self._waiting, links.planner, links.response_timeout)
        self._known_stop: int | None = None
        self._known_stops = TakenGoals[tuple[int | None, int]]()
        self._driver = self._link_to_driver(links)
        self._machine_time = MachineTime(self._plant_time, lambda: node_time(self))
        self._jump = ""
        back = JumpThreshold(
            min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False
        )
        self._jumps = self.get_clock().create_jump_callback(back, post_callback=self._clock_jumped)
        self._signals = self.create_publisher(SignalMsg, "~/signals", _SIGNALS)
        self._machine_signals = self.create_publisher(SignalMsg, "~/machine_signals", _SIGNALS)
        self._program_state = self.create_publisher(ProgramStateMsg, "~/program_state", _KEPT)
        self._ahead: list[SignalMsg] = []
        CommandTopic(self, SignalMsg, "~/signals", self._hear_signals, of=lambda msg: msg.name)
        for peer in filter(None, links.peers):
            topic = f"{peer}/machine_signals"
            CommandTopic(self, SignalMsg, topic, self._hear_peer, of=lambda msg: msg.name)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(_MACHINES_PERIOD, self._let_machines_answer, clock=steady)
        self._last = Status.success()
        self._diagnostics = RunnerDiagnostics(self)
        self.create_timer(1.0, self._diagnose, clock=steady)
        self._server = RecordedActionServer(
            self,
            RunProgram,
            "~/run_program",
            self._run,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
            came=self._note_stop,
            **ACTION_SERVICES,
        )
        self.get_logger().info("ready to run programs")

    def _link_to_driver(self, links: LinkSettings) -> DriverClient:
        return DriverClient(
            self,
            self._waiting,
            links.driver,
            response_timeout=links.response_timeout,
            silence_timeout=links.silence_timeout,
            cancel_timeout=links.cancel_timeout,
            stop_heard=self._look_for_goals,
        )

    def _look_for_goals(self) -> None:
        """Goals that wait when a stop is heard were sent before it: take them as such."""
        if self._known_stop != self._driver.stops and self._server.take_waiting(BURST):
            self._known_stop = self._driver.stops

    def _note_stop(self, goal_id: bytes, sent: int) -> None:
        """A goal is taken: note the last stop that its sender can have known, and when it was sent
        [ns].
        """
        self._known_stops.note(goal_id, (self._known_stop, sent))

    def destroy_node(self) -> None:
        """Let go of the action server before the node."""
        self._server.destroy()
        self._jumps.unregister()
        super().destroy_node()

    async def _run(self, goal: ServerGoalHandle) -> RunProgram.Result:
        """A program from its goal to its result; refused while another one runs."""
        if self._progress is not None:
            running = f"program {self._progress.program_id}".strip()
            sentence = f"{running} is running: one program at a time"
            return self._end(
                goal, ProgramResult(Status(StatusCode.INVALID_ROBOT_STATE, sentence), 0), 0.0, 0.0
            )
        self._progress = progress = RunProgress(
            goal.request.program_id, (), self._driver.plant_time
        )
        goal_id = bytes(goal.goal_id.uuid)
        after_stop, sent = self._known_stops.pop(goal_id, (self._driver.stops, 0))
        watch = self._watch_client(goal_id, progress)
        try:
            status, movements = await self._fetch(goal.request)
            # a driver or a /clock that has just been started gets the time to be discovered
            patience = self._settings.links.value.response_timeout
            await self._waiting.until(self._driver_is_known, patience)
            after_stop = self._driver.stops if after_stop is None else after_stop
            if self._driver.recovered_after(sent):  # lost on its way, and sent again since
                after_stop = (self._driver.stops or 1) - 1
            progress.started = self._driver.plant_time
            self._jump = ""
            energy = self._driver.energy
            result = ProgramResult(status, 0)
            if status.ok:
                progress.movements = movements
                timers = self._driver.timers
                times = self._settings.transitions.value if timers is None else timers.transitions
                program = Program(movements, self._settings.program.value, times)
                result = await self._run_steps(goal, program, after_stop)
        finally:
            self._progress = None
            self.destroy_timer(watch)
        if progress.abandoned and result.status.code == StatusCode.PREEMPTED:
            sentence = f"{progress.abandoned}: {result.status.message}"
            result = ProgramResult(Status(StatusCode.PREEMPTED, sentence), result.executed)
        duration = self._driver.plant_time - progress.started
        return self._end(goal, result, duration, self._driver.energy - energy)

    def _watch_client(self, goal_id: bytes, progress: RunProgress) -> Timer:
        """A timer that abandons the program when its client has gone."""
        timeout = self._settings.links.value.client_timeout
        gone = self._server.watch(goal_id, timeout)

        def look() -> None:
            if not progress.abandoned and gone():
                progress.abandoned = f"the program has had no client for {timeout:g} s"
                self._waiting.look()

        steady = Clock(clock_type=ClockType.STEADY_TIME)
        return self.create_timer(_CLIENT_PERIOD, look, clock=steady)

    def _driver_is_known(self) -> bool:
        """Whether the meter, the last stop and its recovery have been heard, and time passes."""
        stop = (self._driver.stops, self._driver.stop_latched)
        known = None not in stop and self._driver.recovery_known
        return not self._driver.silent and known and node_time(self) > 0.0

    async def _run_steps(
        self, goal: ServerGoalHandle, program: Program, after_stop: int | None
    ) -> ProgramResult:
        feedback = self.create_timer(_FEEDBACK_PERIOD, lambda: self._publish_feedback(goal))
        try:
            return await Fulfilment(self._ports(goal), after_stop).run(program)
        finally:
            self.destroy_timer(feedback)

    async def _fetch(self, request: RunProgram.Goal) -> tuple[Status, tuple[PlannedMovement, ...]]:
        """Get the steps with all points, and check them as a whole."""
        try:
            check_request(request.program_id, len(request.movements))
            given = [planned_movement_from_msg(movement) for movement in request.movements]
            fetch = (
                self._planner.program(request.program_id)
                if request.program_id
                else self._planner.with_points(given)
            )
            status, movements = await fetch
            if status.ok:
                check_program(movements)
                _check_announced(movements)
        except InvalidValueError as error:
            return Status(StatusCode.INVALID_MOTION_PLAN, str(error)), ()
        except ProgramError as error:
            return Status(error.code, str(error)), ()
        return status, movements

    def _ports(self, goal: ServerGoalHandle) -> Ports:
        return Ports(
            driver=self._driver,
            machines=self._machines,
            until=self._waiting.until,
            fault=lambda: self._jump,
            canceled=lambda: self._is_canceled(goal),
            begin=self._begin,
            done=self._done,
            announce=self._announce,
            announce_phase=lambda text: self._announce_phase(goal, text),
            set_signal=self._set_signal,
            send_wake_packet=self._send_wake_packet,
        )

    def _is_canceled(self, goal: ServerGoalHandle) -> bool:
        """Whether its client has canceled the program, or has gone."""
        abandoned = self._progress is not None and self._progress.abandoned
        return bool(goal.is_cancel_requested or abandoned)

    def _plant_time(self) -> float | None:
        """Time of the plant [s], None where no driver is heard: machines answer without one."""
        heard = self._driver.stamp_ns and not self._driver.silent
        return self._driver.plant_time if heard else None

    def _clock_jumped(self, jump: TimeJump) -> None:
        self._jump = f"the clock jumped back by {-jump.delta.nanoseconds * 1e-9:.3f} s"
        self._waiting.look()

    def _send_wake_packet(self) -> Status:
        links = self._settings.links.value
        try:
            self._send(magic_packet(links.mac), links.wake_address, links.wake_port)
        except OSError as error:
            where = f"{links.wake_address} port {links.wake_port}"
            return Status(
                StatusCode.FAILURE, f"no Wake-on-LAN packet could be sent to {where}: {error}"
            )
        return Status.success()

    def _set_signal(self, signal: Signal) -> None:
        self._machines.set(signal, self._machine_time())
        self._machine_signals.publish(signal_to_msg(self._stamped(signal)))

    def _hear_signals(self, messages: Sequence[SignalMsg]) -> None:
        for msg in messages:
            self._hear_signal(msg)

    def _hear_signal(self, msg: SignalMsg) -> None:
        try:
            self._machines.hear(signal_from_msg(msg), self._machine_time())
        except InvalidValueError as error:
            self.get_logger().warning(f"a signal is ignored: {error}", throttle_duration_sec=1.0)
        self._waiting.look()

    def _hear_peer(self, messages: Sequence[SignalMsg]) -> None:
        """Another robot's signals hold from their own time on, in the time of this robot's driver:
        on a busy machine a simulated robot lags behind, and would else pass before the other left.
        """
        self._ahead += messages
        self._take_peers()

    def _take_peers(self) -> None:
        if not self._ahead:
            return
        now = self._driver.stamp_ns
        due = [msg for msg in self._ahead if time_from_msg(msg.stamp) <= now]
        self._ahead = [msg for msg in self._ahead if time_from_msg(msg.stamp) > now]
        if len(self._ahead) > MOST_SIGNALS:
            self.get_logger().warning("signals of other robots from the future are ignored")
            self._ahead = self._ahead[:MOST_SIGNALS]
        self._hear_signals(due)

    def _let_machines_answer(self) -> None:
        self._look_for_goals()
        self._take_peers()
        for signal in self._machines.take_answers(self._machine_time()):
            self._signals.publish(signal_to_msg(self._stamped(signal)))

    def _diagnose(self) -> None:
        self._diagnostics.publish(
            self._progress, self._driver.state(), self._driver.mode, self._last
        )

    def _stamped(self, signal: Signal) -> Signal:
        """With the time at which it holds, in the driver's stamps where one is heard."""
        stamp = 0 if self._driver.silent else self._driver.stamp_ns
        return Signal(signal.name, signal.value, stamp or self.get_clock().now().nanoseconds)

    def _begin(self, index: int) -> None:
        assert self._progress is not None
        self._progress.begin(index)

    def _done(self) -> None:
        assert self._progress is not None
        self._progress.step_done_ns = self._driver.stamp_ns

    def _announce(self, step: Announce) -> None:
        progress = self._progress
        assert progress is not None
        if step.event is Event.STARTED:
            progress.step_started = self._driver.plant_time
        stamp = progress.step_done_ns if step.event is Event.ENDED else self._driver.stamp_ns
        state = ProgramState(
            stamp_ns=stamp or self.get_clock().now().nanoseconds,
            program_id=progress.program_id,
            index=step.index,
            total=progress.total,
            event=step.event,
            movement=progress.movements[step.index],
            note=step.note,
        )
        self._program_state.publish(program_state_to_msg(state))

    def _announce_phase(self, goal: ServerGoalHandle, text: str) -> None:
        assert self._progress is not None
        self._progress.phase = text
        self._publish_feedback(goal)

    def _publish_feedback(self, goal: ServerGoalHandle) -> None:
        progress = self._progress
        if progress is not None and goal.is_active:
            goal.publish_feedback(
                RunProgram.Feedback(
                    movement=progress.index,
                    total=progress.total,
                    phase=progress.phase,
                    remaining=progress.remaining(self._driver.plant_time),
                )
            )

    def _end(
        self, goal: ServerGoalHandle, result: ProgramResult, duration: float, energy: float
    ) -> RunProgram.Result:
        if result.status.ok:
            goal.succeed()
        elif result.status.code == StatusCode.PREEMPTED and goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
            self.get_logger().error(str(result.status))
        self._last = status = Status(result.status.code, result.status.message, self.get_name())
        return RunProgram.Result(
            status=status_to_msg(status), executed=result.executed, duration=duration, energy=energy
        )


def main(arguments: list[str] | None = None) -> int:
    """Run the node until it is ended."""
    refusals = (DescriptionError, ValueError)
    about = (
        "Runs planned programs: movements, pauses in their power modes, signals of the machines."
    )
    return run_node(
        names.PROGRAM_RUNNER, ProgramRunnerNode, arguments, refusals=refusals, about=about
    )


if __name__ == "__main__":
    sys.exit(main())
