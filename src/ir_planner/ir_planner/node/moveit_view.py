"""The cell as MoveIt's clients and its panel in RViz look at it: the semantic description of the
robot, and the planning scene with the machines and parts of the cell.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations
from typing import Any
from xml.etree import ElementTree as Xml

import numpy as np
from geometry_msgs.msg import Point
from shape_msgs.msg import Mesh, MeshTriangle, SolidPrimitive

from ir_description import Body, Cell
from ir_description.poses import composed
from ir_msgs_py.names import WORLD_FRAME
from ir_msgs_py.ros.conversions import pose_to_msg
from ir_values.arrays import FloatArray

TIP = "tcp"
FLOOR = "floor"
_FLOOR_EDGE = 20.0  # m of the slab that stands for a plane, which RViz does not draw
_FLOOR_THICK = 0.1  # m
PRIMITIVES = {
    SolidPrimitive.BOX: ("box", 3),
    SolidPrimitive.SPHERE: ("sphere", 1),
    SolidPrimitive.CYLINDER: ("cylinder", 2),
}
"""Solid primitives that a cell can hold, by their number: what it calls them, how many dimensions
they have."""
_NUMBERS = {word: number for number, (word, _) in PRIMITIVES.items()}


@dataclass(frozen=True, eq=False)
class MoveItShape:
    """A shape in the cell: what MoveIt calls a solid primitive, or a mesh (corners (V, 3) [m])."""

    kind: str
    pose: FloatArray
    dimensions: tuple[float, ...] = ()
    corners: FloatArray | None = None

    def agrees(self, other: MoveItShape, within: float = 1e-5) -> bool:
        """Whether the other is the same shape at the same place, within some [m]."""
        if self.kind != other.kind:
            return False
        if self.corners is not None and other.corners is not None:
            mine = _placed(self.corners, self.pose)
            theirs = _placed(other.corners, other.pose)
            from scipy.spatial import cKDTree  # only cells with meshes pay for this import

            there = np.max(cKDTree(mine).query(theirs)[0])
            back = np.max(cKDTree(theirs).query(mine)[0])
            return bool(max(there, back) <= within)
        return bool(
            np.allclose(self.dimensions, other.dimensions, rtol=0.0, atol=within)
            and np.allclose(self.pose, other.pose, rtol=0.0, atol=within)
        )


def _placed(points: FloatArray, pose: FloatArray) -> FloatArray:
    placed: FloatArray = points @ pose[:3, :3].T + pose[:3, 3]
    return placed


def pieces_of(body: Body) -> list[MoveItShape]:
    """A body in the cell as MoveIt's shapes: it has neither capsules nor planes that are drawn."""
    pose = body.pose
    radius = float(body.size[0])
    length = float(body.size[1])
    if body.kind == "capsule":
        ends = [_lifted(pose, side * 0.5 * length) for side in (-1.0, 1.0)]
        balls = [MoveItShape("sphere", end, (radius,)) for end in ends]
        return (
            [MoveItShape("cylinder", pose, (length, radius)), *balls] if length > 0.0 else balls[:1]
        )
    if body.kind == "plane":
        slab = _lifted(pose, -0.5 * _FLOOR_THICK)
        return [MoveItShape("box", slab, (_FLOOR_EDGE, _FLOOR_EDGE, _FLOOR_THICK))]
    if body.kind == "mesh":
        return [MoveItShape("mesh", pose, corners=np.asarray(body.vertices))]
    sizes = {
        "box": tuple(map(float, body.size)),
        "sphere": (radius,),
        "cylinder": (length, radius),  # height first
    }
    return [MoveItShape(body.kind, pose, sizes[body.kind])]


def _lifted(pose: FloatArray, height: float) -> FloatArray:
    up = np.eye(4)
    up[2, 3] = height
    lifted: FloatArray = composed(pose, up)
    return lifted


def objects_of(cell: Cell) -> dict[str, list[MoveItShape]]:
    """What the cell holds before its program begins, by name: machines, parts that lie, floor."""
    found: dict[str, list[MoveItShape]] = {}
    machines = {m.name: m.world_bodies() for m in cell.equipment}
    lying = {
        name: cell.part(name).lying(cell.station(station).pose)
        for name, station in cell.parts_at_start().lying.items()
        if station
    }
    for name, bodies in (*machines.items(), *lying.items()):
        pieces = [piece for body in bodies for piece in pieces_of(body)]
        if pieces:
            found[name] = pieces
    if cell.floor:
        floor = next(body for body in cell.bodies() if body.kind == "plane")
        found.setdefault(FLOOR, pieces_of(floor))
    return found


def link_pairs(cell: Cell) -> tuple[list[str], frozenset[frozenset[str]]]:
    """Links with a shape, in the robot's order, and the pairs of them that are looked at."""
    robot = cell.robot
    link_of = {capsule.name: robot.link_names[capsule.link] for capsule in robot.capsules}
    links = [name for name in robot.link_names if name in link_of.values()]
    for load in cell.loads():
        links.append(f"load_{load.name}")
        link_of |= {capsule.name: f"load_{load.name}" for capsule in load.capsules}
    pairs = {frozenset((link_of[a], link_of[b])) for a, b in cell.self_pairs()}
    return links, frozenset(pair for pair in pairs if len(pair) > 1)


def semantic_description(cell: Cell, group: str) -> str:
    """The SRDF text: one group from the base to the tcp, the cell's postures, and the pairs of
    links that can't touch and are not looked at.
    """
    robot = cell.robot
    root = Xml.Element("robot", name=robot.name)
    chain = Xml.SubElement(root, "group", name=group)
    Xml.SubElement(chain, "chain", base_link=robot.link_names[0], tip_link=TIP)
    for posture in ("home", "park"):
        state = Xml.SubElement(root, "group_state", name=posture, group=group)
        for name, value in zip(robot.joint_names, cell.posture(posture), strict=True):
            Xml.SubElement(state, "joint", name=name, value=repr(float(value)))
    links, checked = link_pairs(cell)
    for a, b in combinations(links, 2):
        if frozenset((a, b)) not in checked:
            Xml.SubElement(root, "disable_collisions", link1=a, link2=b, reason="Never")
    Xml.indent(root)
    return '<?xml version="1.0"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def robot_state(msgs: Any, joint_names: Iterable[str], q: FloatArray, stamp: Any) -> Any:
    """A moveit_msgs/RobotState of the joints (n,) at rest; msgs: moveit_msgs.msg."""
    state = msgs.RobotState()
    state.joint_state.header.stamp = stamp
    state.joint_state.header.frame_id = WORLD_FRAME
    state.joint_state.name = list(joint_names)
    state.joint_state.position = [float(value) for value in q]
    return state


def planning_scene(msgs: Any, cell: Cell, q: FloatArray | None, stamp: Any, wanted: int) -> Any:
    """The whole moveit_msgs/PlanningScene. wanted: bits of PlanningSceneComponents; 0: all."""
    asked = msgs.PlanningSceneComponents
    wanted = wanted or ~0
    scene = msgs.PlanningScene(name=cell.name, robot_model_name=cell.robot.name)
    if q is not None and wanted & (asked.ROBOT_STATE | asked.ROBOT_STATE_ATTACHED_OBJECTS):
        scene.robot_state = robot_state(msgs, cell.robot.joint_names, q, stamp)
    if wanted & asked.ALLOWED_COLLISION_MATRIX:
        scene.allowed_collision_matrix = _matrix(msgs, cell)
    if wanted & (asked.WORLD_OBJECT_NAMES | asked.WORLD_OBJECT_GEOMETRY):
        shapes = bool(wanted & asked.WORLD_OBJECT_GEOMETRY)
        for name, pieces in objects_of(cell).items():
            made = _object(msgs, name, pieces if shapes else [])
            made.header.stamp = stamp
            scene.world.collision_objects.append(made)
    return scene


def _matrix(msgs: Any, cell: Cell) -> Any:
    """Which links may touch, because they can't; the base, which stands, may touch every object."""
    links, checked = link_pairs(cell)
    base = cell.robot.link_names[0]
    rows = [
        msgs.AllowedCollisionEntry(
            enabled=[a == b or frozenset((a, b)) not in checked for b in links]
        )
        for a in links
    ]
    return msgs.AllowedCollisionMatrix(
        entry_names=links,
        entry_values=rows,
        default_entry_names=[base],
        default_entry_values=[True],
    )


def allowed_in(matrix: Any) -> set[frozenset[str]]:
    """Pairs of different links that a moveit_msgs/AllowedCollisionMatrix lets touch."""
    names = list(matrix.entry_names)
    return {
        frozenset((a, b))
        for a, row in zip(names, matrix.entry_values, strict=False)
        for b, allowed in zip(names, row.enabled, strict=False)
        if allowed and a != b
    }


def allowed_here(cell: Cell) -> set[frozenset[str]]:
    """Pairs of links that the published scene lets touch."""
    links, checked = link_pairs(cell)
    return {frozenset(pair) for pair in combinations(links, 2)} - checked


def _object(msgs: Any, name: str, pieces: Iterable[MoveItShape]) -> Any:
    made = msgs.CollisionObject(id=name, operation=msgs.CollisionObject.ADD)
    made.header.frame_id = WORLD_FRAME
    made.pose.orientation.w = 1.0
    for piece in pieces:
        place = pose_to_msg(piece.pose)
        if piece.corners is not None:
            made.meshes.append(_mesh(piece.corners))
            made.mesh_poses.append(place)
        else:
            kind = _NUMBERS[piece.kind]
            made.primitives.append(SolidPrimitive(type=kind, dimensions=list(piece.dimensions)))
            made.primitive_poses.append(place)
    return made


def _mesh(corners: FloatArray) -> Mesh:
    """The convex hull of corners (V, 3), its triangles turned outwards."""
    from scipy.spatial import ConvexHull  # only cells with meshes pay for this import

    hull = ConvexHull(corners)
    mesh = Mesh(vertices=[Point(x=float(x), y=float(y), z=float(z)) for x, y, z in corners])
    for rows, plane in zip(hull.simplices, hull.equations, strict=True):
        a, b, c = corners[rows]
        outwards = np.dot(np.cross(b - a, c - a), plane[:3]) > 0.0
        order = rows if outwards else rows[::-1]
        mesh.triangles.append(MeshTriangle(vertex_indices=order.astype(np.uint32)))
    return mesh
