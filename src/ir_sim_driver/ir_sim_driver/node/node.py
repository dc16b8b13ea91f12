"""The node: topics, the action and services of the driver; parse, call, map, reply."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Pose, Quaternion, Vector3
from rclpy.action import ActionServer, CancelResponse
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA, Float64, String
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import Marker, MarkerArray

from ir_description import DescriptionError, robot_urdf
from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import ControllerState, PowerState
from ir_msgs.msg import PlcInputs as PlcInputsMsg
from ir_msgs.msg import PlcOutputs as PlcOutputsMsg
from ir_msgs.srv import EndPause, QueryModes, Recover, SetLoad, SetPlcInput, StartPause
from ir_msgs_py import names
from ir_msgs_py.errors import MsgsError
from ir_msgs_py.ros.conversions import (
    plc_inputs_from_msg,
    plc_inputs_to_msg,
    plc_outputs_to_msg,
    point_to_msg,
    power_state_to_msg,
    time_to_msg,
)
from ir_msgs_py.ros.running import run_node
from ir_sim_driver.controller.assembly import make_simulation
from ir_sim_driver.controller.diagnostics import Entry, report
from ir_sim_driver.controller.driver import Driver, Frame
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import DriverError
from ir_sim_driver.motion.execution_settings import ExecutionSettings
from ir_sim_driver.motion.goal import ErrorCode, Outcome
from ir_sim_driver.node.messages import (
    fill_controller_state,
    fill_joint_state,
    fill_points,
    goal_from_action,
    goal_from_trajectory,
)
from ir_sim_driver.node.parameters import DriverParameters, NodeSettings
from ir_sim_driver.node.real_time import GridThread, ScaledClock
from ir_sim_driver.node.services import Services
from ir_sim_driver.node.shapes import Shape, shapes_of
from ir_sim_driver.notices import Level
from ir_sim_driver.plc.inputs import TOPIC
from ir_sim_driver.plc.plc_link import PlcLink
from ir_sim_driver.plc.wake_on_lan import WakeListener

try:  # where a ROS installation has it
    from control_msgs.action import FollowJointTrajectory
except ImportError:
    FollowJointTrajectory = None

if TYPE_CHECKING:
    from ir_sim_driver.plc.modbus import ModbusServer

_NS = 1_000_000_000
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
# Deep: a subscriber that gets no processor for seconds must not lose what it has not acknowledged yet. What
# is acknowledged leaves the history, so depth costs nothing while everybody keeps up.
_STREAM = QoSProfile(depth=2000)
_ROBOT = ColorRGBA(r=1.0, g=0.45, b=0.1, a=1.0)
_LOAD = ColorRGBA(r=0.35, g=0.4, b=0.45, a=1.0)
_SWITCH_INTERVAL = 0.0005  # s; the plant's thread must not wait 5 ms for another thread's Python


class SimDriver(Node):
    """Node around a Driver. simulation: another core than the one the parameters describe.

    Raises DriverError, DescriptionError or MsgsError when a parameter makes no sense.
    """

    def __init__(self, simulation: Simulation | None = None, **node_options: Any) -> None:
        super().__init__(names.SIM_DRIVER, **node_options)
        self._configuration = DriverParameters(self, self._change_refusal, self._execution_changed)
        options = self._configuration.node
        self._simulation = simulation or make_simulation(
            options.cell, options.load, options.backend, self._configuration.simulation
        )
        self._joint_names = list(self._simulation.robot.joint_names)
        steps = round(1.0 / (options.joint_state_rate * self._simulation.settings.dt))
        self._driver = Driver(self._simulation, steps)
        self._goals: dict[bytes, int] = {}
        self._canceled: set[bytes] = set()
        self._frame: Frame | None = None
        self._open_topics()
        self._open_requests()
        self._listener = self._listen(options.wake_host, options.wake_port, options.mac)
        self._modbus = self._serve_modbus(options) if options.modbus else None
        own_time = options.real_time_factor != 1.0
        clock = self.get_clock()
        start = clock.now().nanoseconds
        self._clock_publisher = self.create_publisher(Clock, "/clock", 10) if own_time else None
        self._plant = GridThread(
            _NS // options.joint_state_rate,
            ScaledClock(options.real_time_factor, start or _NS)
            if own_time
            else lambda: clock.now().nanoseconds,
            self._tick,
            self._clock_jumped,
            self._plant_failed,
            max_lag=float("inf") if own_time else 5.0,
        )
        self._plant.start()

    @property
    def wake_port(self) -> int:
        """UDP port that Wake-on-LAN packets are heard on; 0 when the listener could not open it."""
        return 0 if self._listener is None else self._listener.port

    @property
    def modbus_port(self) -> int:
        """TCP port of the Modbus server; 0 without one."""
        return 0 if self._modbus is None else self._modbus.port

    def destroy_node(self) -> None:
        """Stop the plant, then the rest."""
        self._plant.close()
        if self._listener is not None:
            self._listener.close()
        if self._modbus is not None:
            self._modbus.close()
        self._driver.close()
        for action in self._actions:
            action.destroy()
        super().destroy_node()

    def _open_topics(self) -> None:
        self._joint_states = self.create_publisher(JointState, names.JOINT_STATES, _STREAM)
        self._power_states = self.create_publisher(PowerState, names.POWER_STATE, _STREAM)
        self._controller_states = self.create_publisher(ControllerState, names.CONTROLLER_STATE, _STREAM)
        self._outputs = self.create_publisher(PlcOutputsMsg, names.PLC_OUTPUTS, _LATCHED)
        self._in_force = self.create_publisher(PlcInputsMsg, names.PLC_INPUTS_IN_FORCE, _LATCHED)
        self._markers = self.create_publisher(MarkerArray, names.ROBOT_MARKERS, 1)
        self._diagnostics = self.create_publisher(DiagnosticArray, names.DIAGNOSTICS, 10)
        self._description = self.create_publisher(String, names.ROBOT_DESCRIPTION, _LATCHED)
        self._joint_state = JointState(name=self._joint_names)
        self._joint_state.header.frame_id = names.BASE_FRAME
        self.create_subscription(JointTrajectory, names.COMMANDED_TRAJECTORY, self._on_trajectory, 10)
        self.create_subscription(PlcInputsMsg, names.PLC_INPUTS, self._on_plc_inputs, _LATCHED)
        self.create_subscription(Float64, names.SPEED_SCALING, self._on_speed_scaling, 10)
        self.create_timer(0.05, self._publish_markers)
        self.create_timer(1.0, self._publish_diagnostics)
        self._publish_description()

    def _open_requests(self) -> None:
        self._actions = [self._serve_action(ExecuteTrajectory, names.EXECUTE_TRAJECTORY)]
        if FollowJointTrajectory is not None:
            self._actions.append(self._serve_action(FollowJointTrajectory, names.FOLLOW_JOINT_TRAJECTORY))
        answers = Services(
            self._driver, self.get_name(), self._configuration.node.mac, self._publish_description
        )
        self.create_service(SetPlcInput, names.SET_PLC_INPUT, answers.set_plc_input)
        self.create_service(StartPause, names.START_PAUSE, answers.start_pause)
        self.create_service(EndPause, names.END_PAUSE, answers.end_pause)
        self.create_service(QueryModes, names.QUERY_MODES, answers.query_modes)
        self.create_service(Recover, names.RECOVER, answers.recover)
        self.create_service(SetLoad, names.SET_LOAD, answers.set_load)

    def _listen(self, host: str, port: int, mac: str) -> WakeListener | None:
        try:
            return WakeListener(host, port, mac, self._wake)
        except OSError as error:
            self.get_logger().warning(f"no Wake-on-LAN: UDP {host}:{port} can't be opened ({error})")
            return None

    def _serve_modbus(self, options: NodeSettings) -> ModbusServer | None:
        try:
            from ir_sim_driver.plc.modbus import (
                ModbusServer,  # only where it is wanted: pymodbus may be missing
            )

            link = PlcLink(self._driver, options.modbus_watchdog)
            return ModbusServer(options.modbus_host, options.modbus_port, link)
        except (ImportError, OSError) as error:
            self.get_logger().warning(f"no Modbus: {error}")
            return None

    # the plant's thread

    def _tick(self, stamp_ns: int) -> None:
        frame = self._frame = self._driver.tick(stamp_ns)
        if self._clock_publisher is not None:
            self._clock_publisher.publish(Clock(clock=time_to_msg(stamp_ns)))
        if frame.q is not None and frame.qd is not None and frame.torque is not None:
            fill_joint_state(self._joint_state, stamp_ns, frame.q, frame.qd, frame.torque)
            self._joint_states.publish(self._joint_state)
        if frame.power is not None:
            self._power_states.publish(power_state_to_msg(frame.power))
        if frame.following is not None:
            state = ControllerState()
            fill_controller_state(state, self._joint_names, stamp_ns, frame.following)
            self._controller_states.publish(state)
        if frame.outputs is not None:
            msg = plc_outputs_to_msg(frame.outputs)
            msg.header.stamp = time_to_msg(stamp_ns)
            self._outputs.publish(msg)
        if frame.inputs is not None:
            self._in_force.publish(plc_inputs_to_msg(frame.inputs))

    def _clock_jumped(self, sentence: str) -> None:
        with self._driver.locked() as simulation:
            simulation.notices.add(Level.WARN, sentence)
            simulation.abort(f"{sentence}; stopped on the path")

    def _plant_failed(self, error: Exception) -> None:
        if self.context.ok():
            self.get_logger().fatal(f"the plant has stopped: {error!r}")

    # topics in

    def _on_trajectory(self, msg: JointTrajectory) -> None:
        limit = self._simulation.settings.execution.max_points
        self._driver.submit(lambda: goal_from_trajectory(msg, limit), lambda goal_id: None, self._topic_ended)

    def _topic_ended(self, outcome: Outcome) -> None:
        if outcome.code is not ErrorCode.SUCCESSFUL:
            sentence = f"trajectory of the topic: {outcome.sentence} ({outcome.code.name})"
            with self._driver.locked() as simulation:
                simulation.notices.add(Level.WARN, sentence)

    def _on_plc_inputs(self, msg: PlcInputsMsg) -> None:
        with self._driver.locked() as simulation:
            plc, refusal = simulation.plc, simulation.plc.refusal(TOPIC)
            try:
                inputs = plc_inputs_from_msg(msg)
                if not refusal:
                    plc.set_all(inputs)
                elif inputs.emergency_stop:
                    plc.set_bit("emergency_stop", True)
            except MsgsError as error:
                refusal = str(error)
            if refusal:
                simulation.notices.add(Level.WARN, f"plc_inputs ignored: {refusal}")

    def _on_speed_scaling(self, msg: Float64) -> None:
        with self._driver.locked() as simulation:
            simulation.set_speed_scaling(float(msg.data))

    def _wake(self) -> None:
        with self._driver.locked() as simulation:
            simulation.wake()

    # the action

    def _serve_action(self, action_type: Any, name: str) -> ActionServer:
        async def execute(handle: Any) -> Any:
            return await self._execute(handle, action_type)

        return ActionServer(self, action_type, name, execute, cancel_callback=self._cancel)

    async def _execute(self, handle: Any, action_type: Any) -> Any:
        result = action_type.Result()
        done = Future(executor=self.executor)
        key = bytes(handle.goal_id.uuid)
        limit = self._simulation.settings.execution.max_points
        request = handle.request

        def started(goal_id: int) -> None:
            self._goals[key] = goal_id
            if key in self._canceled:
                self._simulation.cancel(goal_id)

        def ended(outcome: Outcome) -> None:
            done.set_result(outcome)
            if self.executor is not None:
                self.executor.wake()

        self._driver.submit(lambda: goal_from_action(request, limit), started, ended)
        feedback = self.create_timer(0.05, lambda: self._publish_feedback(handle, key, action_type))
        outcome: Outcome = await done
        self.destroy_timer(feedback)
        self._goals.pop(key, None)
        self._canceled.discard(key)
        result.error_code, result.error_string = int(outcome.code), outcome.sentence
        if action_type is ExecuteTrajectory:
            result.max_tool_deviation, result.energy = outcome.max_tool_deviation, outcome.energy
        if outcome.canceled or (handle.is_cancel_requested and outcome.code is ErrorCode.SUCCESSFUL):
            handle.canceled()
        elif outcome.code is ErrorCode.SUCCESSFUL:
            handle.succeed()
        else:
            handle.abort()
        return result

    def _cancel(self, handle: Any) -> CancelResponse:
        key = bytes(handle.goal_id.uuid)
        self._canceled.add(key)  # for a goal that is still being checked
        goal_id = self._goals.get(key)
        if goal_id is not None:
            with self._driver.locked() as simulation:
                simulation.cancel(goal_id)
        return CancelResponse.ACCEPT

    def _publish_feedback(self, handle: Any, key: bytes, action_type: Any) -> None:
        with self._driver.locked() as simulation:
            if simulation.executor.goal_id is None or simulation.executor.goal_id != self._goals.get(key):
                return
            backend = simulation.backend
            following = simulation.executor.following(backend.q, backend.qd)
        feedback = action_type.Feedback(joint_names=self._joint_names)
        feedback.header.stamp = self.get_clock().now().to_msg()
        fill_points(feedback.desired, feedback.actual, feedback.error, following)
        handle.publish_feedback(feedback)

    # slow topics out

    def _publish_description(self) -> None:
        cell, load = self._simulation.cell, self._simulation.load
        self._description.publish(String(data=robot_urdf(cell.robot, load.loads, cell.tcp)))

    def _publish_markers(self) -> None:
        frame = self._frame
        if frame is None or frame.q is None or not self._markers.get_subscription_count():
            return
        robot, load = self._simulation.robot, self._simulation.load
        poses = self._simulation.tool.chain.link_poses(frame.q[None])[0]
        of_load = [capsule for item in load.loads for capsule in item.capsules]
        markers = MarkerArray()
        for capsules, name, colour in ((robot.capsules, "robot", _ROBOT), (of_load, "load", _LOAD)):
            for k, shape in enumerate(shapes_of(capsules, poses)):
                markers.markers += _markers_of(shape, name, k, colour, frame.stamp_ns)
        self._markers.publish(markers)

    def _publish_diagnostics(self) -> None:
        with self._driver.locked() as simulation:
            notices = simulation.notices.take()
            entries = report(simulation, self._plant.worst_lag)
        for level, sentence in notices:
            # a line of its own for each severity: rclpy lets a line log with one severity only
            if level is Level.OK:
                self.get_logger().info(sentence)
            elif level is Level.WARN:
                self.get_logger().warning(sentence)
            else:
                self.get_logger().error(sentence)
        msg = DiagnosticArray(status=[_diagnostic(entry) for entry in entries])
        msg.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(msg)

    # parameters

    def _change_refusal(self) -> str:
        with self._driver.locked() as simulation:
            return "the robot moves: change it when it stands" if simulation.executor.active else ""

    def _execution_changed(self, settings: ExecutionSettings) -> None:
        with self._driver.locked() as simulation:
            simulation.set_execution(settings)


def _markers_of(shape: Shape, name: str, k: int, colour: ColorRGBA, stamp_ns: int) -> list[Marker]:
    """A cylinder with round ends."""
    d = 2.0 * shape.radius
    body = Marker(type=Marker.CYLINDER, scale=Vector3(x=d, y=d, z=shape.length), id=2 * k)
    x, y, z, w = shape.quaternion.tolist()
    body.pose = Pose(position=point_to_msg(shape.centre), orientation=Quaternion(x=x, y=y, z=z, w=w))
    balls = Marker(type=Marker.SPHERE_LIST, scale=Vector3(x=d, y=d, z=d), id=2 * k + 1)
    balls.points = [point_to_msg(end) for end in shape.ends]
    for marker in (body, balls):
        marker.header.frame_id = names.WORLD_FRAME
        marker.header.stamp = time_to_msg(stamp_ns)
        marker.ns, marker.action, marker.color = name, Marker.ADD, colour
    return [body, balls]


def _diagnostic(entry: Entry) -> DiagnosticStatus:
    return DiagnosticStatus(
        name=entry.name,
        level=bytes([entry.level]),
        message=entry.sentence,
        hardware_id="KR210 R2700 extra, simulated",
        values=[KeyValue(key=key, value=str(value)) for key, value in entry.values.items()],
    )


def main() -> int:
    """Spin the driver until it is told to stop."""
    sys.setswitchinterval(_SWITCH_INTERVAL)
    return run_node(names.SIM_DRIVER, SimDriver, refusals=(DriverError, DescriptionError, MsgsError))
