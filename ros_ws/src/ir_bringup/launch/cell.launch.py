"""The four nodes of a cell, for machines with a full ROS 2.

`ros2 launch ir_bringup cell.launch.py cell:=demo rviz:=true`. Nothing here is needed to run them: every node
starts by its own name with defaults that work, as `ir demo` shows.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

NODES = ("ir_planner", "ir_sim_driver", "ir_program_runner", "ir_recorder")


def shared(*path: str) -> PathJoinSubstitution:
    """A file that this package installs."""
    return PathJoinSubstitution([FindPackageShare("ir_bringup"), *path])


def generate_launch_description() -> LaunchDescription:
    """Return the nodes with one parameter file, and RViz where it is asked for."""
    namespace = LaunchConfiguration("namespace")
    cell = {"cell": LaunchConfiguration("cell")}
    arguments = [
        DeclareLaunchArgument(
            "cell", default_value="demo", description="a cell file, or the name of a bundled cell"
        ),
        DeclareLaunchArgument(
            "namespace", default_value="", description="prefix of all names: one for each cell"
        ),
        DeclareLaunchArgument(
            "parameters",
            default_value=shared("config", "cell.yaml"),
            description="parameter file of the four nodes",
        ),
        DeclareLaunchArgument(
            "rviz", default_value="false", description="show the cell, its zones and the robot"
        ),
    ]
    nodes = [
        Node(
            package=name,
            executable=name,
            name=name,
            namespace=namespace,
            parameters=[LaunchConfiguration("parameters"), cell],
            output="screen",
        )
        for name in NODES
    ]
    # The driver is the only publisher of robot_description; the publisher of /tf takes it from the topic.
    views = [
        Node(
            package="rviz2",
            executable="rviz2",
            namespace=namespace,
            arguments=["-d", shared("rviz", "cell.rviz")],
            condition=IfCondition(LaunchConfiguration("rviz")),
            output="screen",
        )
    ]
    return LaunchDescription([*arguments, *nodes, *views])
