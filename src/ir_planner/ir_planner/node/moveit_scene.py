"""Planning scenes of MoveIt as machines of a cell: each collision object becomes one, or the scene
is refused as a whole with a sentence. What a cell can't hold is never left out.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from shape_msgs.msg import SolidPrimitive

from ir_description import Body, Cell, Equipment
from ir_description.cell import zone_around
from ir_description.files.worlds import mesh_bodies
from ir_description.poses import composed, inverse
from ir_msgs_py.names import WORLD_FRAME
from ir_msgs_py.ros.conversions import pose_from_msg
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_planner.node.inputs import foot_frame
from ir_planner.node.moveit_view import (
    PRIMITIVES,
    MoveItShape,
    allowed_here,
    allowed_in,
    objects_of,
)
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError, PoseError, shown

OBJECTS_MAX = 1000
TRIANGLES_MAX = 200_000
"""Of one mesh."""
_ADD, _REMOVE, _APPEND, _MOVE = range(4)
_OTHERS = {SolidPrimitive.CONE: "a cone", SolidPrimitive.PRISM: "a prism"}
_CODE = StatusCode.INVALID_OBJECT_NAME


def refusal(what: str, must: str, code: StatusCode = StatusCode.INVALID_GOAL_CONSTRAINTS) -> Any:
    """What to raise for a part of a request that is not understood."""
    return RequestError(code, f"{what}: {must}")


def frame_pose(frame: str, cell: Cell, what: str) -> FloatArray:
    """Pose (4, 4) in the cell of a frame that a request names; "" is the planning frame."""
    foot = foot_frame(cell)
    frames = {"": np.eye(4), WORLD_FRAME: np.eye(4), foot: cell.base_pose}
    if frame not in frames:
        raise refusal(
            f"frame {shown(frame)} of {what}",
            f"poses are taken in {WORLD_FRAME} (the planning frame) and {foot}",
            StatusCode.FRAME_TRANSFORM_FAILURE,
        )
    return frames[frame]


def pose_in(msg: Any, what: str) -> FloatArray:
    """Pose (4, 4) of a geometry_msgs/Pose; a quaternion of zeros is no turn, as in MoveIt."""
    q = msg.orientation
    if (q.x, q.y, q.z, q.w) == (0.0, 0.0, 0.0, 0.0):
        pose = np.eye(4)
        pose[:3, 3] = msg.position.x, msg.position.y, msg.position.z
        if not np.isfinite(pose).all():
            raise refusal(f"position of {what}", "its numbers must be finite")
        return pose
    try:
        return pose_from_msg(msg)
    except PoseError as error:
        raise RequestError(StatusCode(error.code), f"{what}: {error}") from error


@dataclass(frozen=True, eq=False)
class Applied:
    """The cell with a scene in it, the names of its objects, and what to say of it."""

    cell: Cell
    objects: frozenset[str]
    notes: tuple[str, ...]


def applied(scene: Any, cell: Cell, objects: Collection[str]) -> Applied:
    """The cell after a moveit_msgs/PlanningScene; objects: names of earlier ones. What a scene that
    is no diff repeats of the published one is no change. Raises RequestError.
    """
    check_scene(scene, cell)
    published = {name: it for name, it in objects_of(cell).items() if name not in objects}
    here = {machine.name: machine for machine in cell.equipment}
    ours = {name: here.pop(name) for name in sorted(objects) if name in here}
    if not scene.is_diff:
        ours.clear()
    given = scene.world.collision_objects
    if len(given) > OBJECTS_MAX:
        raise refusal(f"{len(given)} collision objects", f"at most {OBJECTS_MAX} are taken")
    notes = list[str]()
    if not scene.is_diff and len(scene.robot_state.joint_state.name):
        notes.append("the robot is where its joint_states say")
    for each in given:
        name = str(each.id)
        repeats = name in published and not scene.is_diff and _repeats(each, published[name], cell)
        if not repeats:
            _apply(each, cell, {*here, *published}, ours, notes)
    machines = (*here.values(), *ours.values())
    try:
        return Applied(replace(cell, equipment=machines), frozenset(ours), tuple(notes))
    except InvalidValueError as error:
        raise RequestError(_CODE, str(error)) from error


def check_scene(scene: Any, cell: Cell) -> None:
    """Refuse what a scene holds beside collision objects."""
    if scene.robot_model_name not in ("", cell.robot.name):
        raise refusal(
            f"robot model {shown(scene.robot_model_name)}", f"the cell's is {cell.robot.name}"
        )
    matrix = scene.allowed_collision_matrix
    state = scene.robot_state
    entries = (*matrix.entry_names, *matrix.default_entry_names)
    joints = state.joint_state.name or state.joint_state.position
    if not scene.is_diff:  # whole scenes repeat what was published
        entries = () if allowed_in(matrix) == allowed_here(cell) else entries
        joints = ()
    held = {
        "fixed_frame_transforms": [
            each for each in scene.fixed_frame_transforms if not _is_planning_frame(each)
        ],
        "allowed_collision_matrix": entries,
        "octomap": scene.world.octomap.octomap.data,
        "robot_state.joint_state": joints,
        "robot_state.multi_dof_joint_state": state.multi_dof_joint_state.joint_names,
        "robot_state.attached_collision_objects": state.attached_collision_objects,
        "link_padding": [each for each in scene.link_padding if each.padding != 0.0],
        "link_scale": [each for each in scene.link_scale if each.scale != 1.0],
    }
    remedies = {
        "allowed_collision_matrix": "contacts are allowed at the stations of the cell file",
        "robot_state.joint_state": "the robot is where its joint_states say",
        "robot_state.attached_collision_objects": "parts are attached by the cell's program",
        "link_padding": "the parameter safety_distance keeps the robot away from everything",
    }
    for name, value in held.items():
        if len(value):
            raise refusal(f"{name} of the scene", remedies.get(name, "it can't be taken"))


def _is_planning_frame(msg: Any) -> bool:
    """Whether a geometry_msgs/TransformStamped says that the planning frame is itself."""
    if msg.header.frame_id != WORLD_FRAME or msg.child_frame_id not in ("", WORLD_FRAME):
        return False
    at = msg.transform.translation
    q = msg.transform.rotation
    return (at.x, at.y, at.z) == (0.0, 0.0, 0.0) and (q.x, q.y, q.z) == (0.0, 0.0, 0.0)


def _repeats(msg: Any, published: Sequence[MoveItShape], cell: Cell) -> bool:
    """Whether a collision object is one that was published, as it was."""
    operation = msg.operation[0] if isinstance(msg.operation, bytes) else int(msg.operation)
    if operation != _ADD or msg.planes or msg.subframe_names:
        return False
    what = f"collision object {shown(str(msg.id))}"
    at = composed(frame_pose(msg.header.frame_id, cell, what), pose_in(msg.pose, what))
    kinds = {number: word for number, (word, _) in PRIMITIVES.items()}
    given = [
        MoveItShape(
            kinds.get(int(shape.type), ""), composed(at, pose_in(place, what)), shape.dimensions
        )
        for shape, place in zip(msg.primitives, msg.primitive_poses, strict=False)
    ]
    for mesh, place in zip(msg.meshes, msg.mesh_poses, strict=False):
        corners = np.array([(v.x, v.y, v.z) for v in mesh.vertices], float).reshape(-1, 3)
        if not len(corners):
            return False
        given.append(MoveItShape("mesh", composed(at, pose_in(place, what)), corners=corners))
    left = list(published)
    for piece in given:
        same = next((one for one in left if one.agrees(piece)), None)
        if same is None:
            return False
        left.remove(same)
    return not left


def _apply(
    msg: Any, cell: Cell, machines: Collection[str], ours: dict[str, Equipment], notes: list[str]
) -> None:
    """Change our machines by one collision object: removed, moved, extended or made."""
    name = str(msg.id)
    what = f"collision object {shown(name)}"
    operation = msg.operation[0] if isinstance(msg.operation, bytes) else int(msg.operation)
    if operation == _REMOVE and not name:
        ours.clear()
        return
    _check_target(name, operation, machines, ours)
    if operation == _REMOVE:
        del ours[name]
        return
    if msg.subframe_names:
        raise refusal(what, "it has subframes, which can't be taken")
    at = composed(frame_pose(msg.header.frame_id, cell, what), pose_in(msg.pose, what))
    if operation == _MOVE:
        if msg.primitives or msg.meshes or msg.planes:
            raise refusal(what, "MOVE takes a pose alone, no shapes")
        ours[name] = replace(ours[name], pose=at)
        return
    before = ours[name].bodies if operation == _APPEND else ()
    moved = np.eye(4)
    if before:  # what is appended stands where its own header and pose say
        moved = composed(inverse(ours[name].pose), at)
        at = ours[name].pose
    bodies = (*before, *(body.placed(moved) for body in _bodies(msg, name, len(before), notes)))
    if not bodies:
        raise refusal(what, "it has no shape", _CODE)
    ours[name] = machine_of(name, at, bodies)


def _check_target(
    name: str, operation: int, machines: Collection[str], ours: Collection[str]
) -> None:
    """Refuse an operation that is unknown, or on an object that no scene has added."""
    what = f"collision object {shown(name)}"
    if operation not in (_ADD, _REMOVE, _APPEND, _MOVE):
        raise refusal(what, f"operation {operation} is unknown: 0 to 3 are", _CODE)
    if name in machines:
        remedy = "set_equipment moves machines, or switches them off"
        raise refusal(what, f"a machine or part of the cell has this name; {remedy}", _CODE)
    if operation != _ADD and name not in ours:
        raise refusal(what, f"no scene has added it: there are {', '.join(ours) or 'none'}", _CODE)


def machine_of(name: str, pose: FloatArray, bodies: Sequence[Body]) -> Equipment:
    """A machine without stations: an open zone around its bodies."""
    try:
        return Equipment(name, pose, tuple(bodies), zone_around("OPEN", bodies))
    except InvalidValueError as error:
        raise RequestError(_CODE, str(error)) from error


def _bodies(msg: Any, name: str, taken: int, notes: list[str]) -> list[Body]:
    what = f"collision object {shown(name)}"
    if msg.planes:
        raise refusal(what, "planes can't be taken; the floor is the cell's, a wall is a box")
    for shapes, poses in (("primitives", "primitive_poses"), ("meshes", "mesh_poses")):
        count = len(getattr(msg, shapes))
        places = len(getattr(msg, poses))
        if count != places:
            raise refusal(what, f"it has {count} {shapes} and {places} {poses}")
    total = taken + len(msg.primitives) + len(msg.meshes)
    labels = [name if total == 1 else f"{name}_{k}" for k in range(taken, total)]
    bodies = list[Body]()
    try:
        for primitive, place in zip(msg.primitives, msg.primitive_poses, strict=True):
            bodies.append(_primitive(primitive, pose_in(place, what), labels.pop(0), what))
        for mesh, place in zip(msg.meshes, msg.mesh_poses, strict=True):
            triangles = _triangles(mesh, what)
            made, note = mesh_bodies(labels.pop(0), triangles, pose_in(place, what))
            bodies += made
            notes += [note] if note else []
    except InvalidValueError as error:
        raise RequestError(_CODE, f"{what}: {error}") from error
    return bodies


def _primitive(msg: Any, pose: FloatArray, name: str, what: str) -> Body:
    kind = int(msg.type)
    if kind not in PRIMITIVES:
        shape = _OTHERS.get(kind, f"shape {kind}")
        raise refusal(what, f"{shape} can't be taken; boxes, spheres, cylinders and meshes can")
    word, count = PRIMITIVES[kind]
    given = [float(value) for value in msg.dimensions]
    if len(given) != count:
        raise refusal(what, f"a {word} has {count} dimensions, it has {len(given)}")
    if kind == SolidPrimitive.CYLINDER:  # height and radius there, radius and length here
        given.reverse()
    size = np.zeros(3)
    size[:count] = given
    return Body(name, word, pose, size)  # type: ignore[arg-type]


def _triangles(msg: Any, what: str) -> FloatArray:
    if not 1 <= len(msg.triangles) <= TRIANGLES_MAX:
        raise refusal(
            what, f"its mesh has {len(msg.triangles)} triangles, must be 1 to {TRIANGLES_MAX}"
        )
    corners = np.array([(each.x, each.y, each.z) for each in msg.vertices], float).reshape(-1, 3)
    rows = np.array([list(each.vertex_indices) for each in msg.triangles], int)
    if not np.isfinite(corners).all() or rows.max() >= len(corners):
        raise refusal(what, f"its mesh names vertices that it lacks, of {len(corners)} finite ones")
    triangles: FloatArray = corners[rows]
    return triangles
