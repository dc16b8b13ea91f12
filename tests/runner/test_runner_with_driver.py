"""The runner with the real driver (ideal robot, short transitions): both keep the same
interfaces.
"""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from ir_msgs.action import RunProgram
from ir_msgs.msg import PowerState
from ir_msgs.srv import Recover, SetPlcInput
from ir_msgs_py.modes import DEEPER, Mode
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.plan_conversions import planned_movement_to_msg
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_msgs_py.wake_on_lan import send_packet
from ir_program_runner.node import ProgramRunnerNode
from ir_sim_driver.node import SimDriver
from ir_values.errors import RequestRefusedError

TRANSITIONS = {  # s: enter, leave, shortest stay
    "bus_power_off": (0.2, 0.4, 0.1),
    "hibernation": (0.2, 0.5, 0.2),
    "stand_on_brakes": (0.1, 0.2, 0.1),
}


def parameters(values):
    return [Parameter(name, value=value) for name, value in values.items()]


@pytest.fixture
def client(ros_context, ros_executor):
    times = {
        f"transitions.{mode}_{what}": seconds
        for mode, row in TRANSITIONS.items()
        for what, seconds in zip(("enter", "leave", "minimum_stay"), row, strict=True)
    }
    settings = parameters({"backend": "ideal", "wake_port": 0, **times})
    with BackgroundExecutor(ros_context) as driver_executor:
        driver = driver_executor.add_node(
            SimDriver(context=ros_context, parameter_overrides=settings)
        )

        def send(packet, address, port):
            send_packet(packet, address, driver.port_of("wake_on_lan"))

        patient = {"silence_timeout": 30.0, "response_timeout": 30.0, "cancel_timeout": 30.0}
        runner = ProgramRunnerNode(
            send, context=ros_context, parameter_overrides=parameters(patient)
        )
        ros_executor.add_node(runner)
        with Client(context=ros_context, timeout=PATIENCE) as client:
            yield client


def test_a_program_with_every_power_mode_runs_on_the_driver(client):
    here = positions(client)
    there = here + 0.1 * np.eye(6)[0]
    modes = []
    client.subscribe(
        "/ir_sim_driver/power_state", PowerState, lambda reading: modes.append(Mode(reading.mode))
    )
    program = [
        move(here, there),
        pause("BUS_POWER_OFF"),
        move(there, here),
        pause("HIBERNATION"),
        move(here, there),
        pause("STAND_ON_BRAKES"),
        move(there, here),
    ]
    goal = RunProgram.Goal(movements=[planned_movement_to_msg(step) for step in program])
    result = client.send_goal("/ir_program_runner/run_program", goal, timeout=PATIENCE)
    assert result.status.code == StatusCode.SUCCESS, result.status.message
    assert result.executed == len(program)
    assert result.energy > 0.0
    assert {Mode.MOVING, Mode.BUS_POWER_OFF, Mode.HIBERNATION, Mode.STAND_ON_BRAKES} <= set(modes)


def test_a_program_asked_for_before_a_stop_is_not_run_after_it(
    client, ros_executor, ros_node, wait_for
):
    """However late the runner takes it: its process was suspended, say."""
    here = positions(client)
    there = here + 0.1 * np.eye(6)[0]
    goal = RunProgram.Goal(movements=[planned_movement_to_msg(move(here, there))])
    asking = ActionClient(ros_node, RunProgram, "/ir_program_runner/run_program")
    wait_for(asking.server_is_ready, what="the runner is there")
    client.send_goal("/ir_program_runner/run_program", RunProgram.Goal())
    accepted = []
    suspended = threading.Event()
    goes_on = threading.Event()

    def ask_and_suspend():
        accepted.append(asking.send_goal_async(goal))
        suspended.set()
        goes_on.wait(PATIENCE)

    threading.Thread(target=lambda: ros_executor.run(ask_and_suspend)).start()
    wait_for(suspended.is_set, what="the runner's executor is held")
    press(client, True)
    press(client, False)
    wait_for(lambda: recovers(client), what="the button is released for the debounce")
    goes_on.set()
    wait_for(accepted[0].done, what="the goal is accepted")
    ended = ros_executor.run(accepted[0].result().get_result_async)
    wait_for(ended.done, what="it ends")
    assert ended.result().result.status.code == StatusCode.INVALID_ROBOT_STATE
    assert "ended the program" in ended.result().result.status.message
    again = client.send_goal("/ir_program_runner/run_program", goal, timeout=PATIENCE)
    assert again.status.code == StatusCode.SUCCESS, again.status.message


@pytest.mark.parametrize(
    "power_mode", ["STAND_ON_BRAKES", "BUS_POWER_OFF", "STAND_ON_BRAKES>BUS_POWER_OFF"]
)
def test_a_stop_in_a_rest_needs_no_more_than_its_recovery(power_mode, client, ros_node, wait_for):
    """A program that a stop ends takes its own bits back: after `recover` a new one drives."""
    modes = []
    client.subscribe(
        "/ir_sim_driver/power_state", PowerState, lambda reading: modes.append(Mode(reading.mode))
    )
    here = positions(client)
    there = here + 0.1 * np.eye(6)[0]
    steps = [replace(pause(power_mode), duration=PATIENCE), move(here, there)]
    goal = RunProgram.Goal(movements=[planned_movement_to_msg(step) for step in steps])
    asking = ActionClient(ros_node, RunProgram, "/ir_program_runner/run_program")
    wait_for(asking.server_is_ready, what="the runner is there")
    accepted = asking.send_goal_async(goal)
    rest = Mode[power_mode.split(DEEPER)[-1]]
    wait_for(lambda: rest in modes, what=f"it rests in {rest.name}")
    press(client, True)
    wait_for(accepted.done, what="the goal is accepted")
    ended = accepted.result().get_result_async()
    wait_for(ended.done, what="the stop ends it")
    assert "ended the program" in ended.result().result.status.message
    press(client, False)
    wait_for(lambda: recovers(client), what="the button is released for the debounce")
    again = RunProgram.Goal(movements=[planned_movement_to_msg(move(here, there))])
    result = client.send_goal("/ir_program_runner/run_program", again, timeout=PATIENCE)
    assert result.status.code == StatusCode.SUCCESS, result.status.message
    assert np.abs(positions(client) - there).max() < 1e-2


def positions(client):
    state = client.next_message("/joint_states", JointState)
    return np.array([state.position[list(state.name).index(name)] for name in JOINT_NAMES])


def recovers(client):
    try:
        client.ask("/ir_sim_driver/recover", Recover.Request())
    except RequestRefusedError:
        return False
    return True


def press(client, value):
    request = SetPlcInput.Request(name="emergency_stop", value=value)
    answer = client.ask("/ir_sim_driver/set_plc_input", request)
    assert answer.status.code == StatusCode.SUCCESS


def move(start, end):
    rest = np.zeros((2, 6))
    trajectory = JointTrajectory.from_seconds(JOINT_NAMES, [0.0, 0.8], [start, end], rest, rest)
    return PlannedMovement(
        kind="regional",
        trajectory=trajectory,
        trajectory_id=trajectory.trajectory_id,
        duration=trajectory.duration,
        load="gripper",
    )


def pause(mode):
    return PlannedMovement(kind="pause", duration=1.5, power_mode=mode, load="gripper")
