"""The four nodes of a cell, for machines with a full ROS 2.

`ros2 launch ir_bringup cell.launch.py cell:=demo rviz:=true`. Nothing here is needed to run them:
every node starts by its own name with defaults that work, as `ir demo` shows. A second cell in the
same graph needs a
namespace and ports of its own: `namespace:=cell_2 wake_port:=9010 modbus_port:=5021`.
"""

from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

NODES = ("ir_planner", "ir_sim_driver", "ir_program_runner", "ir_recorder")
TF_IN_NAMESPACE = [
    ("/tf", "tf"),
    ("/tf_static", "tf_static"),
]  # frames of two cells are called the same
ARGUMENTS = {
    "cell": ("demo", "a cell file, or the name of a bundled cell"),
    "namespace": ("", "prefix of all names: one for each cell"),
    "parameters": ("", "parameter file of the four nodes; empty: config/cell.yaml"),
    "wake_port": (
        "",
        "UDP port of Wake-on-LAN, for driver and runner; empty: as in the parameter file",
    ),
    "modbus_port": (
        "",
        "TCP port on which a PLC can connect by Modbus; empty: as in the parameter file",
    ),
    "rviz": ("false", "show the robot, the cell and its zones"),
    "robot_state_publisher": (
        "false",
        "let robot_state_publisher publish tf instead of the driver",
    ),
}


def shared(*path: str) -> PathJoinSubstitution:
    """A file that this package installs."""
    return PathJoinSubstitution([FindPackageShare("ir_bringup"), *path])


def cell_parameters(given: dict[str, str]) -> dict[str, dict[str, object]]:
    """What the arguments say about the parameters of each node."""
    parameters: dict[str, dict[str, object]] = {node: {"cell": given["cell"]} for node in NODES}
    if given["wake_port"]:
        for node in ("ir_sim_driver", "ir_program_runner"):
            parameters[node]["wake_port"] = int(given["wake_port"])
    if given["modbus_port"]:
        parameters["ir_sim_driver"] |= {"modbus": True, "modbus_port": int(given["modbus_port"])}
    if given["robot_state_publisher"] == "true":
        parameters["ir_sim_driver"]["publish_tf"] = False
    return parameters


def views(given: dict[str, str]) -> list[Node]:
    """RViz, and the publisher of tf that is not the driver."""
    nodes = []
    if given["robot_state_publisher"] == "true":
        from ir_description import load_cell, robot_urdf

        cell = load_cell(given["cell"])
        # It ends with an exception where its parameter is empty, and publishes it as well: the
        # driver's description, which follows the load, keeps its topic.
        nodes.append(
            Node(
                package="robot_state_publisher",
                executable="robot_state_publisher",
                namespace=given["namespace"],
                parameters=[
                    {
                        "robot_description": robot_urdf(
                            cell.robot, cell.tool, cell.tcp, cell.base_pose
                        )
                    }
                ],
                remappings=[*TF_IN_NAMESPACE, ("robot_description", "~/robot_description")],
                output="screen",
            )
        )
    if given["rviz"] == "true":
        nodes.append(
            Node(
                package="rviz2",
                executable="rviz2",
                namespace=given["namespace"],
                arguments=["-d", shared("rviz", "cell.rviz")],
                remappings=TF_IN_NAMESPACE,
                output="screen",
            )
        )
    return nodes


def everything(context: LaunchContext) -> list[Node]:
    """The four nodes, and what shows them."""
    given = {name: context.launch_configurations[name] for name in ARGUMENTS}
    file = given["parameters"] or shared("config", "cell.yaml")
    nodes = [
        Node(
            package=name,
            executable=name,
            name=name,
            namespace=given["namespace"],
            parameters=[file, parameters],
            output="screen",
        )
        for name, parameters in cell_parameters(given).items()
    ]
    return [*nodes, *views(given)]


def generate_launch_description() -> LaunchDescription:
    """Return the arguments, and the nodes that follow from them."""
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=everything)])
