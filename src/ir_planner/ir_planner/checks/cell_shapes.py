"""Shapes of a cell for RViz and Foxglove: its bodies, zones and stations, and the path of the last
movement.
"""

from typing import NamedTuple

import numpy as np

from ir_description import Body, Cell
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

Colour = tuple[float, float, float, float]
BODY: Colour = (0.55, 0.58, 0.62, 1.0)
PART: Colour = (0.85, 0.6, 0.2, 1.0)
ZONES: dict[str, Colour] = {
    "OPEN": (0.2, 0.7, 0.3, 0.12),
    "SEMI_CLOSED": (0.9, 0.7, 0.1, 0.14),
    "CLOSED": (0.9, 0.2, 0.2, 0.16),
}
PATH: Colour = (0.1, 0.4, 0.9, 1.0)
CLOSEST: Colour = (0.9, 0.1, 0.1, 1.0)


class Shape(NamedTuple):
    """kind "box", "cylinder", "sphere", "line", "triangles" or "text"; pose (4, 4), size (3,) m,
    points (P, 3).
    """

    namespace: str
    kind: str
    pose: FloatArray
    size: FloatArray
    colour: Colour
    points: FloatArray
    text: str = ""


_NONE = np.zeros((0, 3))


def cell_shapes(cell: Cell) -> tuple[Shape, ...]:
    """Bodies as they stand, zones, and stations with their names."""
    machines = [
        shape
        for machine in cell.equipment
        for body in machine.world_bodies()
        for shape in body_shapes(body, machine.name, BODY)
    ]
    lying = [
        shape
        for part in cell.parts
        if part.station
        for body in part.lying(cell.station(part.station).pose)
        for shape in body_shapes(body, part.name, PART)
    ]
    zones = [
        Shape("zones", "box", m.zone.pose, m.zone.size, ZONES[m.zone.kind], _NONE)
        for m in cell.equipment
        if m.enabled
    ]
    stations = [
        shape for station in cell.stations for shape in station_shapes(station.name, station.pose)
    ]
    return (*machines, *lying, *zones, *stations)


def body_shapes(body: Body, namespace: str, colour: Colour) -> tuple[Shape, ...]:
    """A body as one or three shapes; planes are not drawn."""
    size = np.asarray(body.size)
    if body.kind == "box":
        return (Shape(namespace, "box", body.pose, size, colour, _NONE),)
    if body.kind == "sphere":
        return (Shape(namespace, "sphere", body.pose, np.full(3, 2 * size[0]), colour, _NONE),)
    if body.kind in ("cylinder", "capsule"):
        width = 2 * size[0]
        round_ = Shape(
            namespace,
            "cylinder",
            body.pose,
            np.array([width, width, max(size[1], 1e-6)]),
            colour,
            _NONE,
        )
        if body.kind == "cylinder":
            return (round_,)
        ends = []
        for side in (-0.5, 0.5):
            pose = np.array(body.pose)
            pose[:3, 3] += side * size[1] * pose[:3, 2]
            ends.append(Shape(namespace, "sphere", pose, np.full(3, width), colour, _NONE))
        return (round_, *ends)
    if body.kind == "mesh":
        from scipy.spatial import ConvexHull  # only cells with meshes pay for this import

        corners = np.asarray(body.vertices)
        triangles = corners[ConvexHull(corners).simplices].reshape(-1, 3)
        return (Shape(namespace, "triangles", body.pose, np.ones(3), colour, triangles),)
    return ()


def station_shapes(name: str, pose: FloatArray) -> tuple[Shape, ...]:
    """The approach direction of a pose (4, 4) as a line, and the name."""
    tip = np.asarray(pose)[:3, 3]
    back = tip - 0.15 * np.asarray(pose)[:3, 0]
    line = Shape(
        "stations", "line", np.eye(4), np.array([0.01, 0.0, 0.0]), PATH, np.stack([back, tip])
    )
    label = np.eye(4)
    label[:3, 3] = tip
    label[2, 3] += 0.12
    return line, Shape(
        "stations", "text", label, np.full(3, 0.08), (1.0, 1.0, 1.0, 1.0), _NONE, name
    )


def movement_shapes(trajectory: JointTrajectory, scene: PlanningScene) -> tuple[Shape, ...]:
    """The path of the tcp."""
    times = np.linspace(trajectory.times[0], trajectory.times[-1], 60)
    path = scene.chain.tcp_poses(trajectory.sample(times).q)[:, :3, 3]
    return (Shape("movement", "line", np.eye(4), np.array([0.008, 0.0, 0.0]), PATH, path),)
