"""Topics of the node: cell and markers out; timers, load and machines in; latched."""

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from geometry_msgs.msg import Point
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from visualization_msgs.msg import Marker, MarkerArray

from ir_description import Cell, cell_to_yaml
from ir_msgs.msg import CarriedLoad as CarriedLoadMsg
from ir_msgs.msg import CellState as CellStateMsg
from ir_msgs.msg import ControllerTimers as ControllerTimersMsg
from ir_msgs.msg import MachineStates as MachineStatesMsg
from ir_msgs_py import names
from ir_msgs_py.announcements import CellState
from ir_msgs_py.names import own
from ir_msgs_py.ros.conversions import pose_to_msg
from ir_msgs_py.ros.plan_conversions import machine_states_from_msg
from ir_msgs_py.ros.power_conversions import (
    carried_load_from_msg,
    cell_state_to_msg,
    controller_timers_from_msg,
)
from ir_msgs_py.ros.topics import LATCHED
from ir_planner.checks import Shape
from ir_planner.planner import Planner
from ir_values.errors import IrError

# What planner and driver announce to each other: cell out; timers, load and machines in;
# latched.

_T = TypeVar("_T")


class PlannerAnnouncements:
    """Publishes the planner's cell, and lets the planner hear what a driver publishes while there
    is one.
    """

    def __init__(self, node: Node, planner: Planner, group: CallbackGroup) -> None:
        self._node = node
        self._planner = planner
        self._cells = node.create_publisher(CellStateMsg, own(names.CELL), LATCHED)
        for kind, topic, hear in (
            (ControllerTimersMsg, names.CONTROLLER_TIMERS, self._hear_timers),
            (CarriedLoadMsg, names.CARRIED_LOAD, self._hear_load),
            (MachineStatesMsg, names.MACHINE_STATES, self._hear_machines),
        ):
            node.create_subscription(kind, topic, hear, LATCHED, callback_group=group)

    def announce(self) -> None:
        """Publish the cell as it stands."""
        message = cell_state_to_msg(cell_state(self._planner.cell, self._planner.cell_hash))
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._cells.publish(message)

    def forget_the_gone(self) -> None:
        """What a driver said counts no more when it is no longer there."""
        heard = self._planner.heard
        publishers = self._node.count_publishers
        if heard.timers is not None and not publishers(names.CONTROLLER_TIMERS):
            heard.timers = None
        if heard.load is not None and not publishers(names.CARRIED_LOAD):
            heard.load = None
        if heard.machines is not None and not publishers(names.MACHINE_STATES):
            heard.machines = None

    def _hear_timers(self, message: Any) -> None:
        heard = self._planner.heard
        heard_now = self._understood(controller_timers_from_msg, message, names.CONTROLLER_TIMERS)
        heard.timers = heard_now or heard.timers

    def _hear_load(self, message: Any) -> None:
        heard = self._planner.heard
        heard.load = (
            self._understood(carried_load_from_msg, message, names.CARRIED_LOAD) or heard.load
        )

    def _hear_machines(self, message: Any) -> None:
        heard = self._planner.heard
        states = self._understood(machine_states_from_msg, message, names.MACHINE_STATES)
        heard.machines = heard.machines if states is None else states

    def _understood(self, convert: Callable[[Any], _T], message: Any, topic: str) -> _T | None:
        try:
            return convert(message)
        except IrError as error:
            self._node.get_logger().warning(f"{topic} is ignored: {error}")
            return None


def cell_state(cell: Cell, content: str) -> CellState:
    """A cell as it is announced; content: its hash."""
    machines = cell.equipment
    return CellState(
        cell.name,
        content,
        cell_to_yaml(cell),
        tuple(machine.name for machine in machines),
        tuple(machine.pose for machine in machines),
        tuple(machine.enabled for machine in machines),
        tuple(machine.state or "" for machine in machines),
    )


# Shapes of the core as markers: the cell, and beside it what was planned last.

_MARKER = {
    "box": Marker.CUBE,
    "cylinder": Marker.CYLINDER,
    "sphere": Marker.SPHERE,
    "line": Marker.LINE_STRIP,
    "triangles": Marker.TRIANGLE_LIST,
    "text": Marker.TEXT_VIEW_FACING,
}


class ShownMarkers:
    """Everything in one message: a late listener gets the last one only."""

    def __init__(self) -> None:
        self._cell: list[Marker] = []

    def with_cell(self, shapes: Sequence[Shape]) -> MarkerArray:
        """The cell alone, from now on."""
        self._cell = [marker(shape, k) for k, shape in enumerate(shapes)]
        return self.beside_cell(())

    def beside_cell(self, shapes: Sequence[Shape]) -> MarkerArray:
        """The cell with these shapes."""
        moving = [marker(shape, k) for k, shape in enumerate(shapes)]
        return MarkerArray(markers=[Marker(action=Marker.DELETEALL), *self._cell, *moving])


def marker(shape: Shape, number: int) -> Marker:
    """A shape as RViz and Foxglove draw it."""
    drawn = Marker(
        ns=shape.namespace, id=number, type=_MARKER[shape.kind], action=Marker.ADD, text=shape.text
    )
    drawn.header.frame_id = names.WORLD_FRAME
    drawn.pose = pose_to_msg(shape.pose)
    drawn.scale.x, drawn.scale.y, drawn.scale.z = (float(value) for value in shape.size)
    drawn.color.r, drawn.color.g, drawn.color.b, drawn.color.a = shape.colour
    drawn.points = [Point(x=float(x), y=float(y), z=float(z)) for x, y, z in shape.points]
    return drawn
