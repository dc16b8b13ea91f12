"""The runner's node in this process, against a small fake driver and planner over real services."""

from __future__ import annotations

import time
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.action import ActionClient, CancelResponse
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, Header, UInt64

from ir_msgs.action import ExecuteTrajectory, RunProgram
from ir_msgs.msg import PowerState, ProgramState, Status
from ir_msgs.msg import Signal as SignalMsg
from ir_msgs.srv import GetProgram, GetTrajectory, QueryModes, SetLoad, SetPlcInput
from ir_msgs_py import status
from ir_msgs_py.modes import Mode, TransitionTimes
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.ros import client
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import recovery_to_msg, trajectory_to_msg
from ir_msgs_py.ros.plan_conversions import planned_movement_to_msg
from ir_msgs_py.ros.power_conversions import power_mode_to_msg
from ir_msgs_py.ros.rclpy_inside import PatientActionServer
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.topics import LATCHED
from ir_msgs_py.ros.waiting import Waiting
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_msgs_py.wake_on_lan import magic_packet
from ir_program_runner.machines import Machines
from ir_program_runner.node import ProgramRunnerNode

MAC = "02:00:00:00:00:01"
TRAJECTORY = JointTrajectory(JOINT_NAMES, [0, 10**7], np.zeros((2, 6)))
LONG = JointTrajectory(JOINT_NAMES, [0, 60 * 10**9], np.zeros((2, 6)))
SILENCE = 3.0  # s; a busy machine keeps the meter's node waiting for one
PATIENT = {"silence_timeout": 30.0, "response_timeout": 30.0, "cancel_timeout": 30.0}
OK = Status(code=1)
REST = {"ab": Mode.BUS_POWER_OFF, "hib": Mode.HIBERNATION, "drives_off": Mode.STAND_ON_BRAKES}


class FakeDriver(Node):
    """Keeps the driver's interfaces; modes change at once, a movement lasts as long as its
    trajectory. tick: plant time between two readings of the meter [s].
    """

    def __init__(self, context):
        super().__init__("ir_sim_driver", context=context)
        self.waiting = Waiting(self, period=0.002)
        self.mode = Mode.STAND_ON_MOTORS
        self.energy = 0.0
        self.tick = 0.01
        self.time = 1000.0
        self.log = []
        self.answer = ExecuteTrajectory.Result()
        self.meter = self.create_publisher(PowerState, "~/power_state", 100)
        self.timer = self.create_timer(0.01, self.read_meter)
        self.stops = self.create_publisher(UInt64, "~/stop_number", LATCHED)
        self.stops.publish(UInt64(data=0))
        self.latched = self.create_publisher(Bool, "~/stop_latched", LATCHED)
        self.latched.publish(Bool(data=False))
        self.recoveries = self.create_publisher(Header, "~/last_recovery", LATCHED)
        self.recoveries.publish(recovery_to_msg(0, 0))
        self.create_service(SetPlcInput, "~/set_plc_input", self.set_plc_input)
        self.create_service(SetLoad, "~/set_load", self.set_load)
        self.create_service(QueryModes, "~/query_modes", self.query_modes)
        self.server = PatientActionServer(
            self,
            ExecuteTrajectory,
            "~/execute_trajectory",
            self.execute,
            cancel_callback=lambda goal: CancelResponse.ACCEPT,
        )

    def destroy_node(self):
        self.server.destroy()
        super().destroy_node()

    def read_meter(self):
        self.energy += 4.0
        self.time += self.tick
        reading = PowerState(mode=self.mode, energy=self.energy, power=400.0)
        reading.header.stamp = Time(sec=int(self.time), nanosec=int(self.time % 1 * 1e9))
        self.meter.publish(reading)

    def set_plc_input(self, request, response):
        self.log.append(f"{request.name}={int(request.value)}")
        if request.name in REST:
            self.mode = REST[request.name]
        elif request.name == "end_rest" or (
            request.name == "end_ab" and self.mode is Mode.BUS_POWER_OFF
        ):
            self.mode = Mode.STAND_ON_MOTORS
        response.status = OK
        return response

    def set_load(self, request, response):
        self.log.append(f"load {request.load}")
        known = request.load in ("gripper", "gripper+part")
        response.status = OK if known else Status(code=-19, message="load: known are gripper, part")
        return response

    def query_modes(self, request, response):
        response.status = OK
        times = TransitionTimes(
            **{
                f"{name}_{what}": 0.0
                for name in ("bus_power_off", "hibernation")
                for what in ("enter", "leave", "minimum_stay")
            }
        )
        response.modes = [
            power_mode_to_msg(times.of(mode)) for mode in (Mode.BUS_POWER_OFF, Mode.HIBERNATION)
        ]
        return response

    async def execute(self, goal):
        duration = goal.request.trajectory.points[-1].time_from_start
        self.log.append("drive")
        self.mode = Mode.MOVING
        stopped = await self.waiting.until(
            lambda: goal.is_cancel_requested, timeout=duration.sec + duration.nanosec * 1e-9
        )
        self.mode = Mode.STAND_ON_MOTORS
        if stopped:
            self.log.append("stopped")
            goal.canceled()
            return ExecuteTrajectory.Result(error_string="canceled; stopped on the path")
        if self.answer.error_code:
            goal.abort()
        else:
            goal.succeed()
        return self.answer

    def receive(self, packet, address, port):
        self.log.append(f"packet {address}:{port}")
        if packet == magic_packet(MAC) and self.mode is Mode.HIBERNATION:
            self.mode = Mode.STAND_ON_MOTORS


class FakePlanner(Node):
    """Gives one program of two movements, and their points by id."""

    def __init__(self, context):
        super().__init__("ir_planner", context=context)
        self.create_service(GetProgram, "~/get_program", self.get_program)
        self.create_service(GetTrajectory, "~/get_trajectory", self.get_trajectory)

    def get_program(self, request, response):
        if request.program_id != "known":
            response.status = Status(code=-19, message=f'unknown program "{request.program_id}"')
            return response
        response.status = OK
        response.movements = [planned_movement_to_msg(move(), include_points=False)] * 2
        return response

    def get_trajectory(self, request, response):
        response.status = OK
        response.trajectory = trajectory_to_msg(TRAJECTORY)
        return response


@dataclass(frozen=True)
class Described:
    name: str
    initial: bool = False
    follows: str = ""
    delay: float = 0.0
    process: str = ""


class Cell:
    """Everything of one test: the node, the fakes, a client, and what was published."""

    def __init__(self, context, executor, machines=None, **overrides):
        self.executor = executor
        self.driver = executor.add_node(FakeDriver(context))
        values = {"mac": MAC, "wake_repeat": 30.0, **PATIENT, **overrides}
        parameters = [Parameter(name, value=value) for name, value in values.items()]
        self.runner = executor.add_node(
            ProgramRunnerNode(
                self.driver.receive, machines, context=context, parameter_overrides=parameters
            )
        )
        self.planner = executor.add_node(FakePlanner(context))
        self.test = executor.add_node(Node("test", context=context))
        self.client = Client(context=context, timeout=PATIENCE)
        self.states = []
        self.set_by_program = []
        kept = QoSProfile(
            history=HistoryPolicy.KEEP_ALL, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
        self.test.create_subscription(
            ProgramState, "ir_program_runner/program_state", self.states.append, kept
        )
        self.test.create_subscription(
            SignalMsg, "ir_program_runner/machine_signals", self.set_by_program.append, 100
        )
        self.machines = self.test.create_publisher(SignalMsg, "ir_program_runner/signals", 100)
        self.sender = ActionClient(self.test, RunProgram, "ir_program_runner/run_program")

    def run(self, movements=(), program_id="", feedback=None, timeout=PATIENCE):
        goal = RunProgram.Goal(
            program_id=program_id, movements=[planned_movement_to_msg(each) for each in movements]
        )
        return self.client.send_goal("ir_program_runner/run_program", goal, feedback, timeout)

    @contextmanager
    def running(self, movements, wait_for):
        """Run a program during the block, and cancel it at its end; its result is in the list
        then.
        """

        def answered(ask):
            future = self.executor.run(ask)
            wait_for(future.done)
            return future.result()

        wait_for(self.sender.server_is_ready)
        goal = RunProgram.Goal(movements=[planned_movement_to_msg(each) for each in movements])
        handle = answered(lambda: self.sender.send_goal_async(goal))
        ended = []
        yield ended
        answered(handle.cancel_goal_async)
        ended.append(answered(handle.get_result_async).result)

    def drives(self):
        return self.driver.log[-1:] == ["drive"]

    def events(self):
        return [f"{state.index} {state.event}" for state in self.states]

    def close(self):
        self.executor.run(self.sender.destroy)
        self.client.close()


@pytest.fixture
def cell(ros_context, ros_executor):
    cell = Cell(ros_context, ros_executor)
    yield cell
    cell.close()


@pytest.fixture
def impatient(ros_context, ros_executor):
    """A runner that takes a driver for gone when it is silent."""
    cell = Cell(ros_context, ros_executor, silence_timeout=SILENCE)
    yield cell
    cell.close()


def move(trajectory=TRAJECTORY, **fields):
    defaults = {
        "kind": "regional",
        "trajectory": trajectory,
        "trajectory_id": trajectory.trajectory_id,
        "duration": trajectory.duration,
        "load": "gripper",
    }
    return PlannedMovement(**{**defaults, **fields})


def pause(duration, mode=""):
    return PlannedMovement(kind="pause", duration=duration, power_mode=mode)


def test_a_program_is_fetched_by_its_id_and_run(cell, wait_for):
    phases = []
    result = cell.run(
        program_id="known", feedback=lambda at: phases.append((at.movement, at.total, at.phase))
    )
    assert result.status.code == StatusCode.SUCCESS, result.status.message
    assert result.status.source == "ir_program_runner"
    assert result.executed == 2
    assert result.energy > 0.0
    assert result.duration >= 0.02 - 1e-9  # of the plant: two movements of 10 ms
    assert cell.driver.log == ["end_ab=1", "end_hib=1", "load gripper", "drive", "drive"]
    wait_for(lambda: cell.events() == ["0 started", "0 ended", "1 started", "1 ended"])
    assert cell.states[0].program_id == "known"
    wait_for(lambda: (1, 2, "moving") in phases)


@pytest.mark.parametrize("field", ["from_station", "load", "states"])
def test_a_step_that_late_recorders_could_not_be_sent_is_refused_with_its_size(cell, field):
    text = "x" * 70_000
    result = cell.run(movements=[move(**{field: [text] if field == "states" else text})])
    assert result.status.code == StatusCode.INVALID_GOAL_CONSTRAINTS
    assert "at most 65536 are taken" in result.status.message
    assert len(result.status.message) < 300
    assert cell.driver.log == []


def test_diagnostics_say_what_runs_how_it_ended_and_whether_the_driver_is_heard(
    impatient, wait_for
):
    cell = impatient
    said = []
    cell.executor.run(
        lambda: cell.test.create_subscription(
            DiagnosticArray,
            "/diagnostics",
            lambda msg: said.extend((s.name, s.level, s.message) for s in msg.status),
            10,
        )
    )
    ready = ("ir_program_runner", DiagnosticStatus.OK, "ready")
    wait_for(lambda: ready in said)
    with cell.running([pause(600.0)], wait_for):
        wait_for(lambda: any("step 1 of 1: pause" in message for _, _, message in said))
    cell.run(program_id="not\nknown")
    wait_for(
        lambda: any(
            level == DiagnosticStatus.WARN and "unknown program" in m for _, level, m in said
        )
    )
    assert not any("\n" in message for _, _, message in said)
    cell.executor.run(cell.driver.timer.cancel)
    wait_for(
        lambda: any("nothing was heard from ir_sim_driver" in message for _, _, message in said)
    )


def test_pauses_switch_the_bits_and_wake_by_a_packet(cell):
    result = cell.run([pause(1.0, "BUS_POWER_OFF"), pause(1.0, "HIBERNATION"), move()])
    assert result.status.code == StatusCode.SUCCESS, result.status.message
    assert cell.driver.log == [
        "end_ab=1",
        "end_hib=1",
        "ab=1",
        "end_ab=1",
        "hib=1",
        "packet 127.0.0.1:9009",
        "end_hib=1",
        "load gripper",
        "drive",
    ]


def test_a_step_waits_for_the_signal_of_a_machine_and_sets_its_own(cell, wait_for):
    waiting = []

    def open_the_door(at):
        if at.phase == "waiting for door_open" and not waiting:
            waiting.append(at.movement)
            cell.machines.publish(SignalMsg(name="door_open", value=True))

    steps = [move(), move(wait_for=("door_open",), set_signals=("start=1",))]
    result = cell.run(steps, feedback=open_the_door)
    assert result.status.code == StatusCode.SUCCESS
    assert waiting == [1]
    message = wait_for(lambda: cell.set_by_program)[0]
    assert (message.name, message.value) == ("start", True)
    assert message.stamp.sec > 0


def test_a_stop_while_a_program_waits_for_a_signal_ends_it_though_somebody_has_recovered(
    cell, wait_for
):
    with cell.running([move(), move(wait_for=("door=1",)), move()], wait_for) as ended:
        wait_for(lambda: cell.states and cell.driver.log.count("drive") == 1)
        wait_for(lambda: "0 ended" in cell.events())
        cell.driver.stops.publish(UInt64(data=1))  # pressed, released and recovered from
        wait_for(lambda: "1 failed" in cell.events())
        cell.machines.publish(SignalMsg(name="door", value=True))
    assert cell.driver.log.count("drive") == 1
    assert "stop 1" in ended[0].status.message


def test_a_stop_while_a_program_is_fetched_ends_it_though_somebody_has_recovered(
    cell, wait_for, monkeypatch
):
    async def fetched(program_id):
        cell.driver.stops.publish(UInt64(data=1))
        await cell.runner._waiting.until(lambda: cell.runner._driver.stops == 1)
        return status.Status.success(), (move(), move())

    wait_for(lambda: cell.runner._driver.stops == 0)
    monkeypatch.setattr(cell.runner._planner, "program", fetched)
    result = cell.run(program_id="known")
    assert result.status.code == StatusCode.INVALID_ROBOT_STATE
    assert "stop 1 of the driver ended the program" in result.status.message
    assert cell.driver.log == []


def test_a_program_that_is_asked_for_while_a_stop_is_latched_does_not_wait_for_the_recovery(
    cell, wait_for
):
    """Of the mode nothing can be seen: the controller is on its way to a rest and back."""
    cell.driver.stops.publish(UInt64(data=3))
    cell.driver.latched.publish(Bool(data=True))
    wait_for(lambda: cell.runner._driver.stop_latched)
    result = cell.run([pause(0.2), move()])
    assert result.status.code == StatusCode.INVALID_ROBOT_STATE
    assert "stop 3 of the driver ended the program: recover" in result.status.message
    assert cell.driver.log == []
    cell.driver.recoveries.publish(recovery_to_msg(3, time.time_ns()))
    cell.driver.latched.publish(Bool(data=False))
    wait_for(lambda: not cell.runner._driver.stop_latched)
    assert cell.run([move()]).status.code == StatusCode.SUCCESS


def test_a_program_that_comes_long_after_it_was_sent_is_as_old_as_it_is(cell, wait_for):
    """A stop is recovered meanwhile; one whose recovery is not heard of counts as later too."""
    cell.driver.stops.publish(UInt64(data=1))
    ahead = time.time_ns() + 3_600_000_000_000
    for number, recovered in ((1, ahead), (1, 1), (0, 1)):
        cell.driver.recoveries.publish(recovery_to_msg(number, recovered))
        wait_for(lambda told=(number, recovered): cell.runner._driver._recovery == told)
        wait_for(lambda: cell.runner._driver.stops == 1)
        result = cell.run([move()])
        if (number, recovered) == (1, 1):
            assert result.status.code == StatusCode.SUCCESS
        else:
            assert result.status.code == StatusCode.INVALID_ROBOT_STATE
            assert "stop 1 of the driver ended the program" in result.status.message
    assert cell.driver.log.count("drive") == 1


def test_a_pause_lasts_as_long_in_a_plant_that_lags(cell):
    """A hundred readings of 2 ms of the plant, however fast they come."""
    cell.driver.tick = 0.002
    events = []
    topic = "/ir_program_runner/program_state"
    cell.executor.run(lambda: cell.test.create_subscription(ProgramState, topic, events.append, 10))
    result = cell.run([pause(0.2)])
    assert result.energy >= 100 * 4.0
    assert result.duration >= 0.2
    assert [int(event.header.stamp.sec) for event in events[:1]] == [1000]


def test_a_stop_in_a_pause_on_brakes_ends_the_program_and_asks_for_no_motors(cell, wait_for):
    with cell.running([pause(60.0, "STAND_ON_BRAKES"), move()], wait_for) as ended:
        wait_for(lambda: "drives_off=1" in cell.driver.log)
        cell.driver.stops.publish(UInt64(data=1))
        wait_for(lambda: "0 failed" in cell.events())
    assert "end_drives_off=1" in cell.driver.log
    assert not {"drives_on=1", "end_rest=1", "drive"} & set(cell.driver.log)
    assert "stop 1" in ended[0].status.message


def test_a_program_ends_when_its_driver_was_started_anew(cell, wait_for):
    with cell.running([move(), pause(60.0), move()], wait_for) as ended:
        wait_for(lambda: "1 started" in cell.events())
        cell.driver.stops.publish(UInt64(data=1_795_973_304_123_000_000))
        wait_for(lambda: "1 failed" in cell.events())
    assert cell.driver.log.count("drive") == 1
    assert "the driver was started anew" in ended[0].status.message


def test_the_soft_plc_answers_for_a_machine(ros_context, ros_executor, wait_for):
    machines = Machines([Described("door_open", follows="open_door", delay=0.05)])
    cell = Cell(ros_context, ros_executor, machines)
    heard = []
    cell.test.create_subscription(SignalMsg, "ir_program_runner/signals", heard.append, 100)
    result = cell.run([move(set_signals=("open_door",)), move(wait_for=("door_open",))])
    assert result.status.code == StatusCode.SUCCESS, result.status.message
    wait_for(lambda: [message.name for message in heard] == ["door_open"])
    cell.close()


def test_machines_work_in_the_time_of_the_plant(ros_context, ros_executor, wait_for):
    machines = Machines([Described("door_open", follows="open_door", delay=0.5)])
    cell = Cell(ros_context, ros_executor, machines)
    heard = []
    cell.test.create_subscription(SignalMsg, "ir_program_runner/signals", heard.append, 100)
    cell.driver.tick = 0.0  # a plant that a busy computer lets stand still
    with cell.running([move(set_signals=("open_door",)), move(wait_for=("door_open",))], wait_for):
        wait_for(lambda: cell.driver.log.count("drive") == 1)
        begin = cell.driver.time
        node = time.monotonic()
        wait_for(lambda: time.monotonic() > node + 0.7, what="the delay is over on the clock")
        assert not heard
        cell.driver.tick = 0.01
        wait_for(lambda: len(heard) == 1)
        assert cell.driver.time - begin > 0.45
        assert begin <= heard[0].stamp.sec + 1e-9 * heard[0].stamp.nanosec <= cell.driver.time
    cell.close()


def test_a_signal_of_another_robot_holds_when_the_own_plant_has_come_to_its_time(
    ros_context, ros_executor, wait_for
):
    cell = Cell(ros_context, ros_executor, peers=["/right/ir_program_runner"])
    topic = "/right/ir_program_runner/machine_signals"
    other = cell.test.create_publisher(SignalMsg, topic, 10)
    wait_for(lambda: other.get_subscription_count() == 1)
    cell.driver.tick = 0.0  # a plant that stands still, behind the one of the other robot
    with cell.running([move(wait_for=("zone_1",))], wait_for):
        wait_for(lambda: cell.runner._progress and cell.runner._progress.phase)
        later = int(cell.driver.time) + 1
        other.publish(SignalMsg(name="zone_1", value=True, stamp=Time(sec=later)))
        wait_for(lambda: cell.runner._ahead)
        assert "drive" not in cell.driver.log
        cell.driver.tick = 0.1
        wait_for(lambda: cell.driver.log.count("drive") == 1)
        assert cell.driver.time >= later
    cell.close()


def test_a_cancel_stops_along_the_path(cell, wait_for):
    with cell.running([move(LONG), move()], wait_for) as ended:
        wait_for(cell.drives)
    assert ended[0].status.code == StatusCode.PREEMPTED
    assert cell.driver.log[-2:] == ["drive", "stopped"]
    wait_for(lambda: cell.events() == ["0 started", "0 canceled"])
    assert cell.states[-1].note == "canceled; stopped on the path"


def test_a_cancel_in_a_pause_takes_the_bit_back(cell, wait_for):
    with cell.running([pause(600.0, "BUS_POWER_OFF")], wait_for) as ended:
        wait_for(lambda: cell.driver.log[-1:] == ["ab=1"])
    assert ended[0].status.code == StatusCode.PREEMPTED
    wait_for(lambda: cell.events() == ["0 started", "0 canceled"])
    assert cell.driver.log[-2:] == ["ab=1", "end_ab=1"]


@pytest.mark.parametrize(
    ("steps", "there", "left"),
    [
        ([move(LONG), move()], "drive", "stopped"),
        ([pause(600.0, "BUS_POWER_OFF"), move()], "ab=1", "end_ab=1"),
        ([move(wait_for=["door=1"])], "end_hib=1", "end_hib=1"),
    ],
    ids=["a movement", "a pause", "a signal that does not come"],
)
def test_a_program_whose_client_has_gone_ends_as_one_that_is_canceled(
    steps, there, left, ros_context, ros_executor, wait_for
):
    cell = Cell(ros_context, ros_executor, client_timeout=0.3)
    goal = RunProgram.Goal(movements=[planned_movement_to_msg(each) for each in steps])
    wait_for(cell.sender.server_is_ready)
    accepted = ros_executor.run(lambda: cell.sender.send_goal_async(goal))
    wait_for(accepted.done)
    wait_for(lambda: cell.driver.log[-1:] == [there])
    ros_executor.run(cell.sender.destroy)
    wait_for(lambda: cell.runner._last.code == StatusCode.PREEMPTED, what="the program ends")
    assert cell.driver.log[-1] == left
    said = cell.runner._last
    assert said.message.startswith("the program has had no client for 0.3 s: canceled in step 1")
    cell.driver.log.clear()
    assert cell.run(program_id="known").status.code == StatusCode.SUCCESS
    cell.client.close()


def test_a_program_may_outlive_its_client(ros_context, ros_executor, wait_for):
    cell = Cell(ros_context, ros_executor, client_timeout=0.0)
    goal = RunProgram.Goal(program_id="known")
    wait_for(cell.sender.server_is_ready)
    accepted = ros_executor.run(lambda: cell.sender.send_goal_async(goal))
    wait_for(accepted.done)
    ros_executor.run(cell.sender.destroy)
    wait_for(lambda: cell.events()[-1:] == ["1 ended"], what="the program runs to its end")
    cell.client.close()


def test_the_drivers_abort_ends_the_program_with_its_sentence(cell, wait_for):
    cell.driver.answer = ExecuteTrajectory.Result(
        error_code=-4, error_string="joint_a2 is 0.2 rad off its path"
    )
    result = cell.run([move(from_station="lathe"), move()])
    assert result.status.message == (
        "step 1 of 2 (regional lathe): the driver aborted with -4: joint_a2 is 0.2 rad off its path"
    )
    assert result.executed == 0
    wait_for(lambda: cell.events() == ["0 started", "0 failed"])


def test_a_driver_that_falls_silent_ends_the_program(impatient, wait_for):
    cell = impatient

    def fall_silent(at):
        if at.phase == "moving":
            cell.driver.timer.cancel()

    result = cell.run([move(LONG)], feedback=fall_silent)
    assert result.status.code == StatusCode.ROBOT_STATE_STALE
    assert f"nothing was heard from ir_sim_driver for {SILENCE:g} s" in result.status.message
    wait_for(lambda: cell.driver.log[-1] == "stopped")


def test_a_driver_that_falls_silent_in_a_pause_ends_the_program_and_the_bit_is_taken_back(
    impatient,
):
    cell = impatient

    def fall_silent(at):
        if at.phase == "pause: BUS_POWER_OFF":
            cell.driver.timer.cancel()

    result = cell.run([pause(60.0, "BUS_POWER_OFF")], feedback=fall_silent)
    assert result.status.code == StatusCode.ROBOT_STATE_STALE
    assert cell.driver.log[-2:] == ["ab=1", "end_ab=1"]


def test_a_driver_that_hibernates_during_a_movement_ends_the_program(cell):
    def hibernate(at):
        if at.phase == "moving":
            cell.driver.mode = Mode.HIBERNATION

    result = cell.run([move(LONG)], feedback=hibernate)
    assert result.status.code == StatusCode.INVALID_ROBOT_STATE
    assert "ir_sim_driver went into hibernation during the movement" in result.status.message


def test_a_program_does_not_start_while_the_robot_sleeps(ros_context, ros_executor, wait_for):
    cell = Cell(ros_context, ros_executor, ready_timeout=0.1)
    cell.driver.mode = Mode.BUS_POWER_OFF
    wait_for(lambda: cell.runner._driver.mode is Mode.BUS_POWER_OFF)
    result = cell.run([move()])
    assert result.status.code == StatusCode.INVALID_ROBOT_STATE
    assert result.status.message.startswith("the power mode is BUS_POWER_OFF: a program starts in")
    assert cell.driver.log == []
    cell.close()


def test_one_program_at_a_time(cell, wait_for):
    with cell.running([move(LONG)], wait_for):
        wait_for(cell.drives)
        result = cell.run([move()])
        assert result.status.message == "program is running: one program at a time"
        assert cell.drives()
    assert cell.run([move()]).status.code == StatusCode.SUCCESS


def test_parameters_do_not_change_while_a_program_runs(cell, wait_for):
    def changed():
        parameter = Parameter("ready_timeout", value=1.0)
        return cell.executor.run(lambda: cell.runner.set_parameters([parameter])[0])

    with cell.running([move(LONG)], wait_for):
        wait_for(cell.drives)
        assert changed().reason == "a program runs: ready_timeout can be changed when it has ended"
    assert changed().successful


@pytest.mark.parametrize(
    ("request_fields", "code", "sentence"),
    [
        ({}, -16, "give either program_id or movements"),
        ({"program_id": "other"}, -19, 'unknown program "other"'),
        (
            {"movements": [pause(1.0)], "program_id": "known"},
            -16,
            "give either program_id or movements",
        ),
        (
            {"movements": [move(set_signals=("x=7",))]},
            -2,
            'signal "x=7" has level "7": known are 0, 1',
        ),
        ({"movements": [move(load="anvil")]}, -19, "load: known are gripper, part"),
    ],
)
def test_a_bad_request_is_answered_by_a_sentence_and_the_node_lives(
    cell, request_fields, code, sentence
):
    result = cell.run(**request_fields)
    assert result.status.code == code
    assert sentence in result.status.message
    assert "drive" not in cell.driver.log
    assert cell.run([move()]).status.code == StatusCode.SUCCESS


def test_a_planner_that_is_gone_is_named(ros_context, ros_executor):
    cell = Cell(ros_context, ros_executor, planner="ir_planner_2", response_timeout=0.1)
    result = cell.run(program_id="known")
    assert result.status.code == StatusCode.TIMED_OUT
    assert result.status.message == "no node offers /ir_planner_2/get_program within 0.1 s"
    cell.close()


def test_a_bad_kind_of_movement_is_answered_by_a_sentence(cell):
    goal = RunProgram.Goal(movements=[planned_movement_to_msg(move())])
    goal.movements[0].kind = "jump"
    result = cell.client.send_goal("ir_program_runner/run_program", goal)
    assert result.status.code == -2
    assert result.status.message.startswith('kind of movement is "jump": known are service_exit')


def test_a_packet_that_cannot_be_sent_is_named(ros_context, ros_executor):
    def unplugged(packet, address, port):
        raise OSError("Network is unreachable")

    cell = Cell(ros_context, ros_executor)
    cell.runner._send = unplugged
    result = cell.run([pause(1.0, "HIBERNATION")])
    assert (
        "no Wake-on-LAN packet could be sent to 127.0.0.1 port 9009: Network is unreachable"
        in result.status.message
    )
    cell.close()


def test_a_bad_signal_is_ignored_and_the_node_lives(cell):
    cell.machines.publish(SignalMsg(name="", value=True))
    cell.machines.publish(SignalMsg(name="a\nb", value=True))
    assert cell.run([move()]).status.code == StatusCode.SUCCESS


def test_a_cancel_after_the_end_and_twice_is_harmless(cell, monkeypatch):
    monkeypatch.setattr(client, "_CANCEL_GRACE", 60.0)  # s: a busy machine
    for _ in range(2):
        with pytest.raises(Exception, match="the goal was canceled"):
            cell.run([move(LONG)], timeout=0.1)
    assert cell.run([move()]).status.code == StatusCode.SUCCESS


class SimulatedTime:
    """Publishes /clock twenty times faster than real time, by which the driver's meter goes."""

    def __init__(self, cell):
        self.now = 1000.0
        self.driver = cell.driver
        self.driver.tick = 0.0
        self.publisher = cell.test.create_publisher(Clock, "/clock", 10)
        cell.executor.run(lambda: cell.test.create_timer(0.005, self.tick))

    def tick(self):
        self.now += 0.1
        self.driver.time = self.now
        self.publisher.publish(
            Clock(clock=Time(sec=int(self.now), nanosec=int(self.now % 1 * 1e9)))
        )


@pytest.fixture
def simulated(ros_context, ros_executor):
    cell = Cell(ros_context, ros_executor, use_sim_time=True)
    yield cell, SimulatedTime(cell)
    cell.close()


def test_pauses_follow_the_clock_of_a_simulation(simulated):
    cell, clock = simulated
    started = clock.now
    result = cell.run([pause(30.0, "BUS_POWER_OFF")])
    assert result.status.code == StatusCode.SUCCESS, result.status.message
    assert 30.0 <= result.duration < 35.0
    assert 30.0 <= clock.now - started < 300.0  # 30 s of real time are 600 s of this clock at most


def test_a_clock_that_jumps_back_ends_the_program(simulated):
    cell, clock = simulated

    def jump(at):
        if at.phase == "pause: BUS_POWER_OFF" and clock.now > 1001.0:
            cell.executor.run(lambda: setattr(clock, "now", 500.0))

    result = cell.run([pause(600.0, "BUS_POWER_OFF")], feedback=jump)
    assert "step 1 of 1 (pause BUS_POWER_OFF): the clock jumped back by" in result.status.message
    assert float(result.status.message.split()[-2]) > 500.0
    assert cell.driver.log[-2:] == ["ab=1", "end_ab=1"]


def test_a_goal_that_has_ended_is_not_kept_with_its_result(cell):
    cell.run(program_id="x" * 1000)
    (kept,) = cell.runner._server._goal_handles.values()
    assert kept.request.program_id == ""
