"""Shapes of the core as markers: the cell, and beside it what was planned last."""

from collections.abc import Sequence

from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from ir_msgs_py import names
from ir_msgs_py.ros.conversions import pose_to_msg
from ir_planner.checks import Shape

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
