"""The driver as a node, in this process: topics, the action and services as a client sees them."""

from __future__ import annotations

import socket

import numpy as np
import pytest
from action_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticArray
from pymodbus.client import ModbusTcpClient
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String, UInt64

from ir_description import load_cell, load_power_data
from ir_msgs.action import ExecuteTrajectory
from ir_msgs.msg import PlcInputs, PlcOutputs, PowerMode, PowerState
from ir_msgs.srv import EndPause, QueryModes, Recover, SetLoad, SetPlcInput, StartPause
from ir_msgs_py import names
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import StatusCode
from ir_msgs_py.stop_numbers import same_driver
from ir_msgs_py.trajectory import JointTrajectory
from ir_msgs_py.wake_on_lan import magic_packet
from ir_sim_driver.controller.mains import Mains
from ir_sim_driver.node import SimDriver, topics
from ir_sim_driver.plant import plant_to_yaml, typical_plant
from ir_sim_driver.plc.modbus import COILS
from ir_values.errors import RequestRefusedError

MAC = "02:00:00:c4:02:10"
QUICK = {
    "cell": "open",
    "backend": "ideal",
    "wake_port": 0,
    "plc.debounce": 0.005,
    "plc.startup_window": 0.0,
    "transitions.bus_power_off_enter": 0.1,
    "transitions.bus_power_off_leave": 0.1,
    "transitions.bus_power_off_minimum_stay": 0.1,
    "transitions.hibernation_enter": 0.1,
    "transitions.hibernation_leave": 0.2,
    "transitions.hibernation_minimum_stay": 0.1,
    "transitions.stand_on_brakes_minimum_stay": 0.1,
}


@pytest.fixture
def make_driver(ros_context, ros_executor):
    def make(**parameters):
        overrides = [
            Parameter(name, value=value) for name, value in {**QUICK, **parameters}.items()
        ]
        return ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))

    return make


@pytest.fixture
def cell_client(ros_context):
    with Client(context=ros_context, timeout=PATIENCE) as client:
        yield client


@pytest.fixture
def listen(ros_node):
    def listen_to(topic, message_type, latched=False):
        received = []
        durability = DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE
        ros_node.create_subscription(
            message_type, topic, received.append, QoSProfile(depth=2000, durability=durability)
        )
        return received

    return listen_to


def movement(step=0.05, duration=0.5):
    cell = load_cell("open")
    q = np.array(cell.machine_home)
    return JointTrajectory.from_seconds(
        cell.robot.joint_names, [0.0, duration], [q, q + step], np.zeros((2, 6)), np.zeros((2, 6))
    )


def stamp_ns(msg):
    return msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec


def test_joint_states_stand_on_a_gap_free_grid(make_driver, listen, wait_for):
    make_driver()
    received = listen(names.JOINT_STATES, JointState)
    wait_for(lambda: len(received) >= 500)
    stamps = np.array([stamp_ns(msg) for msg in received])
    assert (np.diff(stamps) == 2_000_000).all()
    assert (stamps % 2_000_000 == 0).all()
    assert list(received[0].name) == list(load_cell("open").robot.joint_names)


def test_power_state_is_the_derivative_of_its_energy(make_driver, listen, wait_for):
    make_driver()
    received = listen(names.POWER_STATE, PowerState)
    wait_for(lambda: len(received) >= 100)
    stamps = np.array([stamp_ns(msg) for msg in received])
    energy = np.array([msg.energy for msg in received])
    power = np.array([msg.power for msg in received])
    assert np.allclose(np.diff(energy), power[1:] * np.diff(stamps) * 1e-9, rtol=1e-6)


def test_each_driver_has_stop_numbers_of_its_own(make_driver, listen, wait_for):
    """So that a goal which follows one that has died is refused by the next."""
    make_driver()
    make_driver()
    numbers = listen(names.STOP_NUMBER, UInt64, latched=True)
    wait_for(lambda: len(numbers) == 2)
    assert not same_driver(*(message.data for message in numbers))


def test_joint_states_are_published_before_the_meter_is_read(make_driver, wait_for, monkeypatch):
    happened = []
    fill = topics.fill_joint_state
    settle = Mains.settle
    monkeypatch.setattr(
        topics, "fill_joint_state", lambda *a: (happened.append("joints"), fill(*a))[1]
    )
    monkeypatch.setattr(Mains, "settle", lambda mains: (happened.append("meter"), settle(mains))[1])
    make_driver()
    wait_for(lambda: happened.count("meter") >= 20)
    events = list(happened)
    first = events.index("meter", events.index("joints"))
    rounds = "".join(event[0] for event in events[first + 1 :]).split("m")[:-1]
    assert set(rounds) == {"jjjjj"}


def test_the_plant_is_named_by_the_meter_and_published_with_its_figures(
    make_driver, listen, wait_for
):
    make_driver(backend="pybullet", plant="typical:9")
    readings = listen(names.POWER_STATE, PowerState)
    plants = listen(names.PLANT, String, latched=True)
    wait_for(lambda: readings and plants)
    assert readings[-1].plant == "typical:9"
    assert len(readings[-1].joint_current) == len(readings[-1].joint_temperature) == 6
    assert 0.0 < readings[-1].tool_power < readings[-1].base_power
    drawn = typical_plant(load_cell("open").robot, load_power_data(), 9)
    assert plants[-1].data == plant_to_yaml(drawn)


def test_a_trajectory_is_executed_to_its_end(make_driver, cell_client, listen, wait_for):
    make_driver(backend="pybullet")
    states = listen(names.JOINT_STATES, JointState)
    feedback = []
    trajectory = movement()
    execution = cell_client.execute(trajectory, feedback=feedback.append, timeout=PATIENCE)
    assert execution.max_tool_deviation < 0.001
    assert execution.energy > 0.0
    wait_for(
        lambda: states and np.allclose(states[-1].position, trajectory.positions[-1], atol=1e-6)
    )


def test_a_bad_trajectory_is_aborted_with_a_sentence(make_driver, cell_client):
    make_driver()
    with pytest.raises(RequestRefusedError, match=r"velocity|needs") as refusal:
        cell_client.execute(movement(step=1.0, duration=0.1), timeout=PATIENCE)
    assert refusal.value.code == ExecuteTrajectory.Result.INVALID_GOAL


def test_bus_power_off_by_bits_and_back(make_driver, cell_client, listen, wait_for):
    make_driver()
    power = listen(names.POWER_STATE, PowerState)
    outputs = listen(names.PLC_OUTPUTS, PlcOutputs, latched=True)
    answer = cell_client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="ab", value=True))
    assert answer.inputs.ab
    wait_for(lambda: power and power[-1].mode == PowerMode.BUS_POWER_OFF)
    wait_for(lambda: outputs and outputs[-1].ab)
    with pytest.raises(RequestRefusedError, match="BUS_POWER_OFF"):
        cell_client.execute(movement(), timeout=PATIENCE)
    cell_client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="ab", value=False))
    wait_for(lambda: power[-1].mode == PowerMode.STAND_ON_MOTORS)


def test_a_bit_that_is_ignored_says_so_in_the_answer(make_driver, cell_client):
    make_driver()
    assert (
        cell_client.ask(
            names.SET_PLC_INPUT, SetPlcInput.Request(name="T1", value=True)
        ).status.message
        == ""
    )
    answer = cell_client.call(names.SET_PLC_INPUT, SetPlcInput.Request(name="ab", value=True))
    assert answer.inputs.ab
    assert answer.status.code == StatusCode.INPUT_IGNORED
    assert answer.status.message == "PLC bit AB is 1 but ignored: operating mode is T1, must be EXT"


def test_levels_in_force_are_published_whoever_sets_them(
    make_driver, cell_client, listen, wait_for
):
    driver = make_driver(modbus=True, modbus_port=0)
    in_force = listen(names.PLC_INPUTS_IN_FORCE, PlcInputs, latched=True)
    wait_for(lambda: in_force)
    assert in_force[0].move_enable
    assert in_force[0].operating_mode == PlcInputs.EXT
    cell_client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="ab", value=True))
    wait_for(lambda: in_force[-1].ab)
    with ModbusTcpClient("127.0.0.1", port=driver.port_of("modbus"), timeout=PATIENCE) as plc:
        plc.write_coil(COILS.index("emergency_stop"), True)
        wait_for(lambda: in_force[-1].emergency_stop)
    assert in_force[-1].ab
    cell_client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="ab", value=False))
    wait_for(lambda: not in_force[-1].ab)
    assert len(in_force) == 4


def test_inputs_belong_to_their_owner_but_the_emergency_stop_to_everybody(
    make_driver, cell_client, listen, ros_node, wait_for
):
    make_driver(**{"plc.owner": "service"})
    in_force = listen(names.PLC_INPUTS_IN_FORCE, PlcInputs, latched=True)
    heard = listen(names.DIAGNOSTICS, DiagnosticArray)
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    publisher = ros_node.create_publisher(PlcInputs, names.PLC_INPUTS, latched)
    publisher.publish(PlcInputs(ab=True))
    wait_for(lambda: any("plc.owner" in s.message for msg in heard for s in msg.status))
    cell_client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="drives_on", value=True))
    wait_for(lambda: in_force and in_force[-1].drives_on)
    publisher.publish(PlcInputs(ab=True, emergency_stop=True))
    wait_for(lambda: in_force[-1].emergency_stop)
    assert not any(msg.ab for msg in in_force)


def test_inputs_of_another_owner_are_refused_to_the_service(make_driver, cell_client):
    make_driver(**{"plc.owner": "modbus"})
    with pytest.raises(RequestRefusedError, match=r"belong to 'modbus' \(parameter plc.owner\)"):
        cell_client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="ab", value=True))


def stamp_of(message) -> float:
    """When a message was sent [s]."""
    return message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec


def test_only_wake_on_lan_ends_hibernation(make_driver, cell_client, listen, wait_for, ros_node):
    driver = make_driver()
    states = listen(names.JOINT_STATES, JointState)
    power = listen(names.POWER_STATE, PowerState)
    publisher = ros_node.create_publisher(
        PlcInputs,
        names.PLC_INPUTS,
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    )
    publisher.publish(PlcInputs(hib=True))
    wait_for(lambda: power and power[-1].mode == PowerMode.HIBERNATION)
    asleep_from = len(power)
    asleep = next(stamp_of(state) for state in power if state.mode == PowerMode.HIBERNATION)
    with pytest.raises(RequestRefusedError, match="Wake-on-LAN"):
        cell_client.ask(names.QUERY_MODES, QueryModes.Request())
    with pytest.raises(RequestRefusedError, match="HIBERNATION"):
        cell_client.execute(movement(), timeout=PATIENCE)
    wait_for(lambda: len(power) > asleep_from + 20)
    # what was sent before may arrive late; the stamp says when it was sent, the meter looks every
    # 10 ms
    assert max(stamp_of(state) for state in states) <= asleep + 0.01
    silent = len(states)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.sendto(
            magic_packet("02:00:00:c4:02:11"), ("127.0.0.1", driver.port_of("wake_on_lan"))
        )
        sender.sendto(magic_packet(MAC), ("127.0.0.1", driver.port_of("wake_on_lan")))
    wait_for(lambda: power[-1].mode == PowerMode.STAND_ON_MOTORS)
    wait_for(lambda: len(states) > silent + 10)


def test_a_pause_is_entered_and_ended(make_driver, cell_client, listen, wait_for):
    make_driver(**{"transitions.hibernation_enter": 60.0})
    power = listen(names.POWER_STATE, PowerState)
    modes = cell_client.ask(names.QUERY_MODES, QueryModes.Request()).modes
    assert [mode.mode for mode in modes] == [0, 2, 3, 4]
    answer = cell_client.ask(names.START_PAUSE, StartPause.Request(pause=2.0))
    wait_for(lambda: power and power[-1].mode == answer.mode.mode)
    cell_client.ask(names.END_PAUSE, EndPause.Request())
    wait_for(lambda: power[-1].mode == PowerMode.STAND_ON_MOTORS)


def test_loads_and_their_refusals(make_driver, cell_client):
    make_driver()
    assert cell_client.ask(names.SET_LOAD, SetLoad.Request(load="none")).total_mass == 0.0
    for request in (
        SetLoad.Request(load="anvil"),
        SetLoad.Request(load="custom", mass=-1.0),
        SetLoad.Request(load="custom", mass=float("nan")),
        SetLoad.Request(load="custom", mass=10_000.0),
    ):
        with pytest.raises(RequestRefusedError):
            cell_client.ask(names.SET_LOAD, request)
    assert (
        cell_client.ask(names.SET_LOAD, SetLoad.Request(load="custom", mass=50.0)).total_mass
        == 50.0
    )


def test_emergency_stop_aborts_and_recover_does_not_resume(
    make_driver, cell_client, listen, wait_for
):
    make_driver(backend="pybullet")
    states = listen(names.JOINT_STATES, JointState)
    power = listen(names.POWER_STATE, PowerState)
    button = cell_client.node.create_client(SetPlcInput, names.SET_PLC_INPUT)
    wait_for(lambda: states and power and button.service_is_ready())
    pressed = []

    def watch(feedback):
        if not pressed:
            pressed.append(feedback)
            button.call_async(SetPlcInput.Request(name="emergency_stop", value=True))

    with pytest.raises(RequestRefusedError, match="emergency stop"):
        cell_client.execute(movement(-0.3, 60.0), feedback=watch, timeout=PATIENCE)
    wait_for(lambda: power[-1].mode == PowerMode.EMERGENCY_STOP)
    with pytest.raises(RequestRefusedError, match="release"):
        cell_client.ask(names.RECOVER, Recover.Request())
    cell_client.ask(names.SET_PLC_INPUT, SetPlcInput.Request(name="emergency_stop", value=False))
    latched = stamp_of(power[-1])  # joint states may come later than the meter
    wait_for(lambda: stamp_of(states[-1]) > latched and np.abs(states[-1].velocity).max() == 0.0)
    stopped = np.array(states[-1].position)
    wait_for(lambda: cell_client.call(names.RECOVER, Recover.Request()).status.code == 1)
    wait_for(lambda: power[-1].mode == PowerMode.STAND_ON_MOTORS)
    recovered = stamp_of(power[-1])
    wait_for(lambda: stamp_of(states[-1]) > recovered)
    assert np.allclose(states[-1].position, stopped, atol=1e-4)  # the loops take the load over


def test_a_plc_reaches_the_node_by_modbus(make_driver, listen, wait_for):
    driver = make_driver(modbus=True, modbus_port=0)
    power = listen(names.POWER_STATE, PowerState)
    with ModbusTcpClient("127.0.0.1", port=driver.port_of("modbus"), timeout=PATIENCE) as plc:
        plc.write_coil(COILS.index("ab"), True)
        wait_for(lambda: power and power[-1].mode == PowerMode.BUS_POWER_OFF)
        assert plc.read_input_registers(0, count=1).registers == [PowerMode.BUS_POWER_OFF]


def test_faster_than_real_time_the_driver_is_the_clock(make_driver, listen, wait_for):
    make_driver(real_time_factor=4.0)
    clock = listen("/clock", Clock)
    states = listen(names.JOINT_STATES, JointState)

    def ticks_among_states():
        ticks = [msg.clock.sec * 1_000_000_000 + msg.clock.nanosec for msg in list(clock)]
        return [tick for tick in ticks if stamp_ns(states[0]) <= tick <= stamp_ns(states[-1])]

    wait_for(lambda: len(states) > 500 and len(ticks_among_states()) > 20, what="both are heard")
    stamps = np.array([stamp_ns(msg) for msg in states])
    gaps = np.diff(
        stamps
    )  # 2,000 messages in a second: a loaded machine may lose some, none leaves the grid
    assert (gaps > 0).all()
    assert (gaps % 2_000_000 == 0).all()
    assert all((tick - stamps[0]) % 2_000_000 == 0 for tick in ticks_among_states())


def test_a_movement_whose_client_has_gone_is_stopped_on_its_path(
    make_driver, ros_node, ros_executor, wait_for, listen
):
    driver = make_driver(client_timeout=0.3)
    diagnostics = listen(names.DIAGNOSTICS, DiagnosticArray)
    client = ros_executor.run(
        lambda: ActionClient(ros_node, ExecuteTrajectory, names.EXECUTE_TRAJECTORY)
    )
    wait_for(client.server_is_ready)
    goal = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(movement(step=-0.4, duration=200.0)))
    power = listen(names.POWER_STATE, PowerState)
    accepted = ros_executor.run(lambda: client.send_goal_async(goal))
    wait_for(accepted.done)
    wait_for(lambda: any(msg.mode == PowerMode.MOVING for msg in power), what="the movement begins")
    ros_executor.run(client.destroy)
    wait_for(lambda: not driver._driver.moving, what="the movement stops")

    def said():
        return any("no client" in status.message for msg in diagnostics for status in msg.status)

    wait_for(said)


def test_the_result_of_a_goal_that_is_not_known_is_no_success(
    make_driver, ros_node, ros_executor, wait_for
):
    """As when somebody asks for it so late that it is not kept any more."""
    make_driver()
    kind = ExecuteTrajectory.Impl.GetResultService
    client = ros_executor.run(
        lambda: ros_node.create_client(kind, f"{names.EXECUTE_TRAJECTORY}/_action/get_result")
    )
    wait_for(client.service_is_ready)
    answer = ros_executor.run(lambda: client.call_async(kind.Request()))
    wait_for(answer.done)
    assert answer.result().status == GoalStatus.STATUS_UNKNOWN
    assert answer.result().result.error_code == ExecuteTrajectory.Result.INVALID_GOAL
    assert "no such goal" in answer.result().result.error_string
