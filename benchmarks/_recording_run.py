"""A cell's run as a recording, made without a robot: movements and rests at 500 Hz with their mains
meter.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState

from ir_description import cell_to_yaml, load_cell, robot_urdf
from ir_msgs.msg import ControllerState, PlannedMovement, PowerState, ProgramState
from ir_recorder.format.qos import QosOffer
from ir_recorder.recording import CellFiles, RecordingSession, RecordingWriter

# ns
START = 1_700_000_000_000_000_000
TICK = 2_000_000
STEP_SECONDS = 4.0
# ticks between two readings of the meter, and of the controller
METER = 5
STATES = 10
TOPICS = {
    "/joint_states": ("sensor_msgs/msg/JointState", False),
    "/ir_sim_driver/power_state": ("ir_msgs/msg/PowerState", False),
    "/ir_sim_driver/controller_state": ("ir_msgs/msg/ControllerState", False),
    "/ir_program_runner/program_state": ("ir_msgs/msg/ProgramState", True),
}


def write_run(path: Path, seconds: float) -> int:
    """Write a program of movements that lasts so long; returns the number of messages."""
    cell = load_cell("demo")
    session = RecordingSession(RecordingWriter(path), {}, START)
    urdf = robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose)
    session.attach_cell(CellFiles(cell_to_yaml(cell), urdf), START)
    for topic, (kind, latched) in TOPICS.items():
        session.open_topic(topic, kind, [QosOffer(transient_local=latched)])
    count = max(int(seconds / STEP_SECONDS), 1)
    home = np.array(cell.machine_home)
    ends = (home, home + np.array([0.4, 0.1, -0.1, 0.3, 0.2, -0.4]))
    for index in range(count):
        _step(
            session,
            index,
            count,
            ends[index % 2],
            ends[(index + 1) % 2],
            list(cell.robot.joint_names),
        )
    return session.finish().messages


def _step(
    session: RecordingSession, index: int, count: int, start: Any, end: Any, joints: list[str]
) -> None:
    ticks = round(STEP_SECONDS * 1e9 / TICK)
    begun = START + index * ticks * TICK
    x = np.arange(ticks) / ticks
    q = start + (end - start) * (10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5)[:, None]
    qd = (end - start) * ((30.0 * x**2 - 60.0 * x**3 + 30.0 * x**4) / STEP_SECONDS)[:, None]
    effort = np.random.default_rng(index).normal(0.0, 100.0, q.shape)  # noise, as of a real robot
    movement = PlannedMovement(
        kind="regional", from_station="home", to_station="home", load="gripper"
    )
    movement.trajectory_id = f"{index:016x}"
    movement.duration = STEP_SECONDS
    state = ProgramState(
        program_id="run", index=index, total=count, event="started", movement=movement
    )
    _put(session, "/ir_program_runner/program_state", state, begun)
    for k in range(ticks):
        now = begun + k * TICK
        message = JointState(name=joints, position=q[k], velocity=qd[k], effort=effort[k])
        _put(session, "/joint_states", message, now)
        if k % METER == 0:
            power = PowerState(
                mode=1, target_mode=1, power=900.0, base_power=735.0, bus_voltage=560.0
            )
            power.energy = 900.0 * (now - START) * 1e-9
            power.joint_power = effort[k] * qd[k]
            power.joint_torque = effort[k]
            _put(session, "/ir_sim_driver/power_state", power, now)
        if k % STATES == 0:
            follows = ControllerState(
                joint_names=joints, trajectory_id=f"{index:016x}", speed_scaling=1.0
            )
            follows.path_time = k * TICK * 1e-9
            _put(session, "/ir_sim_driver/controller_state", follows, now)
    state.event = "ended"
    _put(session, "/ir_program_runner/program_state", state, begun + ticks * TICK)


def _put(session: RecordingSession, topic: str, message: Any, time: int) -> None:
    message.header.stamp = Time(sec=time // 1_000_000_000, nanosec=time % 1_000_000_000)
    session.message(topic, serialize_message(message), time)
