"""A recording never moves a robot unless somebody asks for it by name."""

from __future__ import annotations

import pytest

from ir_msgs_py import names
from ir_recorder.play.playback import PlaySettings, is_command

TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"


@pytest.mark.parametrize(
    ("topic", "type_name"),
    [
        (f"/{names.COMMANDED_TRAJECTORY}", TRAJECTORY),
        (f"/cell_1/{names.PLC_INPUTS}", "ir_msgs/msg/PlcInputs"),
        (f"/{names.SPEED_SCALING}", "std_msgs/msg/Float64"),
        (f"/{names.SIGNALS}", "ir_msgs/msg/Signal"),
        ("/arm_controller/joint_trajectory", TRAJECTORY),
        ("/cmd_vel", "geometry_msgs/msg/Twist"),
    ],
)
def test_commands_are_played_only_by_their_full_name(topic: str, type_name: str) -> None:
    assert is_command(topic, type_name)
    assert not PlaySettings().plays(topic, type_name)
    assert not PlaySettings(topics=("*", f"{topic}*")).plays(topic, type_name)
    assert PlaySettings(topics=(topic,)).plays(topic, type_name)


@pytest.mark.parametrize(
    ("topic", "type_name"),
    [
        ("/joint_states", "sensor_msgs/msg/JointState"),
        (f"/{names.PLANNED_TRAJECTORY}", TRAJECTORY),
        (f"/{names.PLC_INPUTS_IN_FORCE}", "ir_msgs/msg/PlcInputs"),
        (f"/{names.POWER_STATE}", "ir_msgs/msg/PowerState"),
    ],
)
def test_reports_are_played(topic: str, type_name: str) -> None:
    assert PlaySettings().plays(topic, type_name)
