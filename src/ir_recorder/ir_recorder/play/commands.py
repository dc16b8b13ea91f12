"""Topics that move a robot or a machine: playback leaves them out unless one is asked for by
name.
"""

from __future__ import annotations

from ir_msgs_py import names

COMMANDS = (names.COMMANDED_TRAJECTORY, names.PLC_INPUTS, names.SPEED_SCALING, names.SIGNALS)
TYPES = (  # commands of any controller, whatever their topic is called
    "trajectory_msgs/msg/JointTrajectory",
    "trajectory_msgs/msg/MultiDOFJointTrajectory",
    "control_msgs/msg/JointJog",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/msg/TwistStamped",
    "std_msgs/msg/Float64MultiArray",
    "ir_msgs/msg/PlcInputs",
    "ir_msgs/msg/Signal",
)
SHOWN = (
    names.PLANNED_TRAJECTORY,
    names.PLC_INPUTS_IN_FORCE,
    names.MACHINE_SIGNALS,
)  # nodes only report here


def is_command(topic: str, type_name: str = "") -> bool:
    """Whether messages of this topic may move something, by its name in any namespace or by its
    type.
    """
    if any(_ends(topic, name) for name in COMMANDS):
        return True
    return type_name in TYPES and not any(_ends(topic, name) for name in SHOWN)


def _ends(topic: str, name: str) -> bool:
    return topic == f"/{name}" or topic.endswith(f"/{name}")
