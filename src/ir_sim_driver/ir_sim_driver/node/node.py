"""The node: topics, actions and services of the driver; parse, call, map, reply."""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from builtin_interfaces.msg import Time
from rcl_interfaces.msg import SetParametersResult
from rclpy.action import CancelResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from rclpy.time_source import USE_SIM_TIME_NAME
from std_msgs.msg import Float64
from visualization_msgs.msg import MarkerArray

from ir_msgs.action import ExecuteTrajectory
from ir_msgs.srv import EndPause, QueryModes, Recover, SetLoad, SetPlcInput, StartPause
from ir_msgs_py import names
from ir_msgs_py.names import own
from ir_msgs_py.ros.conversions import time_to_msg
from ir_msgs_py.ros.diagnostics import Diagnostics
from ir_msgs_py.ros.node_process import run_node
from ir_msgs_py.ros.serving import BoundedService
from ir_msgs_py.ros.topics import ACTION_SERVICES
from ir_msgs_py.stop_numbers import before_first_stop
from ir_sim_driver.controller import Driver, Joints, Simulation, ended_by_stop, make_simulation
from ir_sim_driver.errors import DriverError, TrajectoryRefusedError
from ir_sim_driver.node.announcements import DriverAnnouncements
from ir_sim_driver.node.bounded_goals import Admission, BoundedActionServer
from ir_sim_driver.node.controller_interface import (
    StateQueries,
    control_type,
    hear_speed_factor,
)
from ir_sim_driver.node.messages import condition_of, hardware_id
from ir_sim_driver.node.parameters import DriverParameters
from ir_sim_driver.node.presses import (
    TURN,
    CommandThread,
    OwnParticipant,
    PlcTopic,
    PolledService,
    presses_the_stop,
)
from ir_sim_driver.node.real_time import FOREIGN, OWN, SYSTEM, GridThread, ScaledClock
from ir_sim_driver.node.services import DriverServices
from ir_sim_driver.node.topics import StopTopics, Streams, TrajectoryTopic
from ir_sim_driver.node.trajectory_actions import Executions
from ir_sim_driver.node.visualization import RobotMarkers, open_transforms
from ir_sim_driver.notices import Level, Notice, shortened
from ir_sim_driver.plc import Link, OpenLink, WakeOnLan
from ir_values.errors import IrError

# Links to the PLC; a controller that nothing can wake does not hibernate.


def open_links(links: Iterable[Link], driver: Driver) -> dict[str, OpenLink]:
    """Links by name; one that can't be opened is a warning, as a port that another driver has."""
    opened: dict[str, OpenLink] = {}
    for link in links:
        if not link.wanted:
            if link.name == WakeOnLan.name:
                driver.forbid_hibernation("nothing could wake the controller (wake_on_lan: false)")
            continue
        try:
            opened[link.name] = link.open(driver.plc)
        except DriverError as error:
            driver.warn(str(error))
            if link.name == WakeOnLan.name:
                driver.forbid_hibernation(f"nothing could wake the controller ({error})")
    return opened


_NS = 1_000_000_000
# s
_MARKERS_PERIOD = 0.05
_DIAGNOSTICS_PERIOD = 1.0
_TRANSFORMS_PERIOD = 0.02
_LINES_MAX = 20  # of the log per second: who toggles a bit all day must not fill a disk
_RESULT_KEPT = 60  # s that the result of a goal can be asked for; each takes memory
_LAST_WORDS = 1.0  # s for the answers to goals when the plant has stopped
REFUSALS = (DriverError, IrError)
_LOOK = 1.0  # s between two looks whether the plant runs: each delays its thread
_SWITCH_INTERVAL = 0.0005  # s; the plant's thread must not wait 5 ms for another thread's Python


class SimDriver(Node):
    """Node around a Driver. simulation: another core than the one the parameters describe.

    Raises DriverError, DescriptionError or IrError when a parameter makes no sense.
    """

    def __init__(self, simulation: Simulation | None = None, **node_options: Any) -> None:
        super().__init__(names.SIM_DRIVER, **node_options)
        configuration = DriverParameters(
            self, self._change_refusal, lambda settings: self._driver.set_execution(settings)
        )
        self._configuration = configuration
        self.add_on_set_parameters_callback(self._keep_time)
        options = configuration.node
        simulation = simulation or make_simulation(
            options.cell,
            options.load,
            options.backend,
            replace(configuration.simulation, before_first_stop=before_first_stop()),
            plant=options.plant,
        )
        steps = round(1.0 / (options.joint_state_rate * simulation.settings.dt))
        self._driver = Driver(simulation, steps, configuration.wake_hint)
        self._hardware = hardware_id(simulation.robot)
        self._joints: Joints | None = None
        self._last_words = 0.0
        self._open_topics()
        self._open_requests()
        self._links = open_links(self._configuration.links, self._driver)
        self._plant = self._start_plant(options.joint_state_rate, options.real_time_factor)

    def port_of(self, link: str) -> int:
        """Port that a link listens on; 0 when it is not open."""
        return self._links[link].port if link in self._links else 0

    def destroy_node(self) -> None:
        """Stop the plant, then the rest. Raises DriverError when the plant had ended before."""
        for thread in self._threads:
            thread.close()
        for each in (self._inputs, self._recoveries, self._presses, self._requests):
            each.close()
        self._plant.close()
        for link in self._links.values():
            link.close()
        self._announcements.close()
        self._driver.close()
        for action in self._actions:
            action.destroy()
        super().destroy_node()
        if self._driver.failure:
            raise DriverError(self._driver.failure)

    def _open_topics(self) -> None:
        self._streams = Streams(self, self._driver.joint_names)
        self._stop_topics = StopTopics(self, self._driver)
        self._markers = self.create_publisher(MarkerArray, own(names.ROBOT_MARKERS), 1)
        self._robot = RobotMarkers((), ())
        self._diagnostics = Diagnostics(self)
        # the last stop of before which no goal waits any more
        self._drained = self._driver.stop_number
        self._trajectory_topic = TrajectoryTopic(self, self._driver, self._admit)
        self.create_subscription(
            Float64,
            own(names.SPEED_SCALING),
            lambda msg: self._driver.set_speed_scaling(float(msg.data)),
            10,
        )
        hear_speed_factor(self, self._driver)
        self._markers_timer = self.create_timer(_MARKERS_PERIOD, self._publish_markers)
        self.create_timer(_DIAGNOSTICS_PERIOD, self._publish_diagnostics)
        self._transforms = open_transforms(self, self._driver, self._configuration.node.publish_tf)
        if self._transforms is not None:
            self.create_timer(_TRANSFORMS_PERIOD, self._publish_transforms)
        self._announcements = DriverAnnouncements(
            self, self._driver, self.now_msg, self._load_changed
        )

    def _open_requests(self) -> None:
        """Actions and services. Presses of the stop and PLC inputs have participants and threads of
        their own: they don't wait for other requests.
        """
        self._actions = [self._serve_action(ExecuteTrajectory, own(names.EXECUTE_TRAJECTORY))]
        follow = control_type("action", "FollowJointTrajectory")
        if follow is not None:
            self._actions.append(self._serve_action(follow, own(names.FOLLOW_JOINT_TRAJECTORY)))
        StateQueries(self._driver).offer(self)
        answers = DriverServices(self._driver, self.get_name(), self._announcements.look)
        self._answers = answers
        self._presses = OwnParticipant(self, "presses")
        self._requests = OwnParticipant(self, "requests")
        self._inputs = PolledService(
            self._requests.node,
            SetPlcInput,
            own(names.SET_PLC_INPUT),
            answers.set_plc_input,
            self,
            urgent=presses_the_stop,
        )
        self._recoveries = PolledService(self, Recover, own(names.RECOVER), self._recover, self)
        self._threads = (
            CommandThread(
                "presses", PlcTopic(self, self._driver, self._presses).poll, self._tell_stop
            ),
            CommandThread(
                "requests",
                self._inputs.poll,
                lambda: self._recoveries.poll() if self._refuse_waiting() else 0,
            ),
        )
        for thread in self._threads:
            thread.start()
        BoundedService(self, StartPause, own(names.START_PAUSE), answers.start_pause)
        BoundedService(self, EndPause, own(names.END_PAUSE), answers.end_pause)
        BoundedService(self, QueryModes, own(names.QUERY_MODES), answers.query_modes)
        BoundedService(self, SetLoad, own(names.SET_LOAD), answers.set_load)

    def _serve_action(self, action_type: Any, name: str) -> BoundedActionServer:
        executions = Executions(
            self._driver, self, action_type, self._configuration.node.client_timeout
        )

        def cancel(handle: Any) -> CancelResponse:
            executions.cancel(handle)
            return CancelResponse.ACCEPT

        server = BoundedActionServer(
            self,
            action_type,
            name,
            executions.execute,
            admit=self._admit,
            cancel_callback=cancel,
            result_timeout=_RESULT_KEPT,
            **ACTION_SERVICES,
        )
        executions.admission_of = server.admission_of
        executions.watch = server.watch
        return server

    def _tell_stop(self) -> int:
        """Tell of a press, by whichever way it came, while the plant's thread has no stamp to
        take.
        """
        self._stop_topics.tell()
        return 0

    def _refuse_waiting(self) -> bool:
        """After a stop, take goals that wait for a busy executor, so that they are refused and none
        is left for after the recovery, whatever recovers. Whether none waits.
        """
        number = self._driver.stop_number
        if self._drained == number:
            return True
        over = not self._driver.stopped
        takers: list[BoundedActionServer | TrajectoryTopic] = [
            *self._actions,
            self._trajectory_topic,
        ]
        none_waits = all(taker.take_waiting(TURN) for taker in takers)
        if none_waits and over:
            self._drained = number
        return none_waits

    def _recover(self, request: Any, response: Any, came_ns: int, client: str) -> Any:
        """Recover, and take no goal that came before that."""
        response = self._answers.recover(request, response, came_ns)
        self._refuse_waiting()
        return response

    def _admit(self, points: int, size: int, sent: int) -> Admission:
        """Ask the driver for a goal of so many points and bytes that was sent then [ns]."""
        number = self._driver.stop_number
        if self._drained != number and not self._driver.stopped:
            return Admission(refusal=ended_by_stop(number))  # it may have waited since before
        try:
            return Admission(self._driver.admit(points, size, sent))
        except TrajectoryRefusedError as error:
            return Admission(refusal=str(error))

    # what executions borrow

    def future(self) -> Future:
        """A future of the node's executor."""
        return Future(executor=self.executor)

    def wake(self) -> None:
        """Let the executor look at its futures."""
        if self.executor is not None:
            self.executor.wake()

    def every(self, seconds: float, callback: Callable[[], None]) -> Callable[[], None]:
        """Call back again and again until the returned function is called."""
        # rclpy's group of the node would keep a reference to every timer that it ever had
        timer = self.create_timer(
            seconds, callback, callback_group=MutuallyExclusiveCallbackGroup()
        )
        return lambda: self.destroy_timer(timer)

    def now_msg(self) -> Time:
        """Time of the plant, which may lag; before its first tick, of the clock."""
        stamp = self._driver.stamp_ns
        return time_to_msg(stamp) if stamp else self.get_clock().now().to_msg()

    # the plant's thread

    def _start_plant(self, rate: int, factor: float) -> GridThread:
        clock = self.get_clock()
        start = clock.now().nanoseconds
        own_time = factor != 1.0
        if own_time:
            self._streams.give_time(rate, factor)
        plant = GridThread(
            _NS // rate,
            ScaledClock(factor, start or _NS) if own_time else lambda: clock.now().nanoseconds,
            lambda: OWN if own_time else FOREIGN if clock.ros_time_is_active else SYSTEM,
            self._tick,
            self._driver.abort,
            self._plant_failed,
        )
        plant.start()
        return plant

    def _tick(self, stamp_ns: int) -> None:
        frame = self._driver.tick(stamp_ns, self._publish_joints)
        self._stop_topics.tell()
        self._streams.publish(frame)
        self._announcements.watch(frame.load)

    def _publish_joints(self, joints: Joints) -> None:
        self._joints = joints
        self._streams.publish_joints(joints)

    def _plant_failed(self, error: Exception) -> None:
        self._driver.fail(f"the plant has stopped: {error!r}")
        self._last_words = time.monotonic() + _LAST_WORDS
        if self.context.ok():
            self.get_logger().fatal(self._driver.failure)
            self._publish_diagnostics()

    def goes_on(self) -> bool:
        """Whether the plant runs, or has stopped so recently that goals are still being
        answered.
        """
        return not self._driver.failure or time.monotonic() < self._last_words

    # slow topics out

    def _load_changed(self) -> None:
        self._robot = RobotMarkers(*self._driver.capsules(), self._robot.loads)
        if self._transforms is not None:
            self._transforms.publish_fixed(self.now_msg())

    def _publish_transforms(self) -> None:
        joints = self._joints
        if self._transforms is not None and joints is not None and joints.q is not None:
            self._transforms.publish_moving(joints.q, joints.stamp_ns)

    def _publish_markers(self) -> None:
        joints = self._joints
        if not self._markers.get_subscription_count():
            # until somebody listens: every wake delays the plant's thread
            self._markers_timer.cancel()
            return
        if joints is None or joints.q is None:
            return
        poses = self._driver.link_poses(joints.q)
        self._markers.publish(self._robot.at(poses, time_to_msg(joints.stamp_ns)))

    def _publish_diagnostics(self) -> None:
        if self._markers_timer.is_canceled() and self._markers.get_subscription_count():
            self._markers_timer.reset()
        snapshot = self._driver.snapshot(self._plant.worst_lag, self._plant.lag)
        for notice in shortened(snapshot.notices, _LINES_MAX):
            self._log(notice)
        conditions = (condition_of(entry, self._hardware) for entry in snapshot.entries)
        self._diagnostics.publish(conditions, self.now_msg())

    def _log(self, notice: Notice) -> None:
        # a line of its own for each severity: rclpy lets a line log with one severity only
        if notice.level is Level.OK:
            self.get_logger().info(notice.sentence)
        elif notice.level is Level.WARN:
            self.get_logger().warning(notice.sentence)
        else:
            self.get_logger().error(notice.sentence)

    def _keep_time(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse another clock while the robot moves."""
        turned = any(parameter.name == USE_SIM_TIME_NAME for parameter in parameters)
        reason = self._change_refusal() if turned else ""
        return SetParametersResult(successful=not reason, reason=reason)

    def _change_refusal(self) -> str:
        return "the robot moves: change it when it stands" if self._driver.moving else ""


def main() -> int:
    """Spin the driver until it is interrupted."""
    sys.setswitchinterval(_SWITCH_INTERVAL)

    def make() -> SimDriver:
        node = SimDriver()
        gc.collect()
        # what is there now stays: a full collection of it would hold the plant up for 40 ms
        gc.freeze()
        return node

    about = (
        "Simulates a KR210 with its drives, power modes, PLC bits and mains meter; executes "
        "trajectories."
    )
    return run_node(
        names.SIM_DRIVER,
        make,
        goes_on=SimDriver.goes_on,
        look=_LOOK,
        refusals=REFUSALS,
        about=about,
    )
