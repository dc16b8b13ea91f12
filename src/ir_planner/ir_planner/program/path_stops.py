"""Nodes at a stop that is a path of the tool: movements along it in different configurations."""

from ir_msgs_py.status import Status, StatusCode
from ir_planner.cartesian import HeadingError, PathRefusedError, choices_along, heading_status
from ir_planner.checks import FreeSpace
from ir_planner.errors import RequestError
from ir_planner.program.node import Node
from ir_planner.request import Context
from ir_planner.scene import PlanningScene
from ir_planner.service import ServiceLine

_MOST = 64  # movements along a path that take part, as many as configurations of a station


def path_nodes(arriving: Context, leaving: PlanningScene) -> tuple[list[Node], Status]:
    """Certified movements along the context's path, each from and to where nothing may be touched;
    or none and why.
    """
    name = arriving.station
    path = arriving.scene.cell.path(name)
    after = FreeSpace.of(leaving, arriving.safety_distance, arriving.work)
    try:
        found = choices_along(path, arriving, after, _MOST)
    except PathRefusedError as error:
        return [], _along(name, error.status)
    except HeadingError as error:
        return [], _along(name, heading_status(error))
    except RequestError as error:  # a path that draws nothing
        raise RequestError(error.code, f"path {name}: {error}") from error
    return [
        Node(ServiceLine(one.points[::-1], straight=False), one.movement) for one in found
    ], Status.success()


def _along(name: str, status: Status) -> Status:
    return Status(StatusCode(status.code), f"along path {name}: {status.message}")
