"""The runner with the real driver (ideal robot, short transitions): both keep the same
interfaces.
"""

from __future__ import annotations

import numpy as np
import pytest
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState

from ir_msgs.action import RunProgram
from ir_msgs.msg import PowerState
from ir_msgs_py.modes import Mode
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.plc import send_packet
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.plan_conversions import planned_movement_to_msg
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_program_runner.node import ProgramRunnerNode
from ir_sim_driver.node import SimDriver

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
    state = client.next_message("/joint_states", JointState)
    here = np.array([state.position[list(state.name).index(name)] for name in JOINT_NAMES])
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
