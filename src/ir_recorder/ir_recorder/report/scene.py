"""The cell and its motion for the picture in 3D: triangles, poses, and the joint values 50 times a second."""

from __future__ import annotations

import numpy as np

from ir_description import Cell, PartPlaces
from ir_msgs_py.arrays import FloatArray
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.clearance import places_after
from ir_recorder.report.robot_shapes import robot_parts
from ir_recorder.report.series import Json, floats, indices, quantised
from ir_recorder.report.shapes import Mesh, body_mesh, capsule_mesh

RATE = 50.0  # Hz: between two frames the fastest axis turns 4 degrees, and the page stays small
MOST_FRAMES = 60_000  # 20 minutes; a longer recording gets fewer frames a second
ANGLE_STEP = 2e-4  # rad: int16 spans 6.5 rad; at 3 m from an axis it is 0.6 mm
POWER_STEP = 1.0  # W: colours show no less, and int16 holds 32 kW


def scene(analysis: Analysis) -> dict[str, Json] | None:
    """What motion.js draws; None where cell or joint states are missing."""
    cell, joints = analysis.cell, analysis.recording.joints
    if cell is None or joints is None or joints.position.shape[1] != cell.robot.n or len(joints.time) < 2:
        return None
    time = _frames(joints.time)
    nearest = np.clip(np.searchsorted(joints.time, time, side="right") - 1, 0, len(joints.time) - 1)
    q = joints.position[nearest]
    return {
        "start": float(time[0]),
        "step": float(time[1] - time[0]),
        "frames": len(time),
        "angleStep": ANGLE_STEP,
        "angles": quantised(q, ANGLE_STEP),
        "power": quantised(_power(analysis, time), POWER_STEP),
        "base": _matrix(cell.base_pose),
        "tcp": _matrix(cell.tcp),
        "jointOrigins": [_matrix(pose) for pose in cell.robot.joint_origin],
        "jointAxes": [[round(float(x), 9) for x in axis] for axis in cell.robot.joint_axis],
        "shapes": [*_robot_shapes(cell), *_load_shapes(cell)],
        "bodies": _bodies(cell),
        "labels": _labels(cell),
        "zones": _zones(cell),
        "parts": _part_places(analysis, cell),
        "loads": [[round(t, 3), load] for t, load in _load_changes(analysis)],
        "nearest": _nearest(analysis),
        "floor": cell.floor,
    }


def _frames(time: FloatArray) -> FloatArray:
    span = float(time[-1] - time[0])
    count = int(np.clip(span * RATE, 2, MOST_FRAMES))
    return np.linspace(time[0], time[-1], count)


def _power(analysis: Analysis, time: FloatArray) -> FloatArray:
    power = analysis.recording.power
    if power is None or not len(power.time):
        return np.zeros(len(time))
    return np.interp(time, power.time, power.power)


def _robot_shapes(cell: Cell) -> list[dict[str, Json]]:
    """The robot twice: as its collision capsules, and as a robot looks."""
    capsules = [
        (c.link, "base" if c.link == 0 else "link", "capsules", capsule_mesh(c)) for c in cell.robot.capsules
    ]
    looks = [(part.link, part.kind, "robot", part.mesh) for part in robot_parts(cell.robot)]
    return [
        {"link": link, "kind": kind, "look": look, "owner": "", **_mesh(mesh)}
        for link, kind, look, mesh in (*looks, *capsules)
    ]


def _load_shapes(cell: Cell) -> list[dict[str, Json]]:
    """Tool and parts as they are held; each is drawn while its name is in the load."""
    shapes = []
    loads = list(cell.loads())
    loads += [load for part in cell.parts for load in cell.loads(part.name) if load.name == part.name]
    for load in loads:
        for capsule in load.capsules:
            kind = "tool" if load.kind == "tool" else "part"
            mesh = _mesh(capsule_mesh(capsule))
            shapes.append({"link": capsule.link, "kind": kind, "look": "", "owner": load.name, **mesh})
    return shapes


def _bodies(cell: Cell) -> list[dict[str, Json]]:
    bodies = []
    for machine in cell.equipment:
        for body in machine.world_bodies():
            mesh = body_mesh(body)
            if mesh is not None:
                pose = _matrix(body.pose)
                bodies.append({"name": body.name, "owner": machine.name, "pose": pose, **_mesh(mesh)})
    return bodies


def _labels(cell: Cell) -> list[dict[str, Json]]:
    """Where the name of each machine stands: above the middle of its bodies."""
    labels: list[dict[str, Json]] = []
    for machine in cell.equipment:
        bounds = [body.bounds() for body in machine.world_bodies() if body.kind != "plane"]
        if bounds:
            low = np.min([b[0] for b in bounds], axis=0)
            high = np.max([b[1] for b in bounds], axis=0)
            point = [*(low[:2] + high[:2]) / 2.0, high[2] + 0.08]
            labels.append({"name": machine.name, "point": [round(float(x), 3) for x in point]})
    return labels


def _zones(cell: Cell) -> list[dict[str, Json]]:
    return [
        {
            "name": machine.name,
            "kind": machine.zone.kind,
            "pose": _matrix(machine.zone.pose),
            "size": [round(float(edge), 4) for edge in machine.zone.size],
        }
        for machine in cell.equipment
        if machine.enabled
    ]


def _part_places(analysis: Analysis, cell: Cell) -> list[dict[str, Json]]:
    """For each part its meshes, and from when on it lies where (no pose: it is held or nowhere)."""
    changes: list[tuple[float, PartPlaces]] = [(-1e9, cell.parts_at_start())]
    for result in analysis.steps:
        places = places_after(cell, changes[-1][1], result.step) if result.step.outcome == "ended" else None
        if places is not None and places is not changes[-1][1]:
            changes.append((result.step.end, places))
    parts: list[dict[str, Json]] = []
    for part in cell.parts:
        lies: list[Json] = []
        for time, places in changes:
            station = places.lying.get(part.name, "")
            lies.append([round(time, 3), _matrix(cell.station(station).pose) if station else None])
        meshes = []
        for body in part.lying(np.eye(4)):
            mesh = body_mesh(body)
            if mesh is not None:
                meshes.append({"pose": _matrix(body.pose), **_mesh(mesh)})
        parts.append({"name": part.name, "lies": lies, "meshes": meshes})
    return parts


def _load_changes(analysis: Analysis) -> list[tuple[float, str]]:
    changes: list[tuple[float, str]] = []
    for time, load in analysis.loads.observations:
        if not changes or changes[-1][1] != load:
            changes.append((time, load))
    if not changes and analysis.cell is not None and analysis.cell.tool is not None:
        changes.append((-1e9, analysis.cell.tool.name))
    return changes


def _nearest(analysis: Analysis) -> list[dict[str, Json]]:
    """The closest pair along each movement, for the line between the two bodies."""
    return [
        {
            "time": floats(near.time),
            "distance": floats(near.distance),
            "a": quantised(near.point_a, 5e-4),
            "b": quantised(near.point_b, 5e-4),
            "pairs": sorted(set(near.pairs)),
            "pair": indices([sorted(set(near.pairs)).index(pair) for pair in near.pairs]),
        }
        for near in (result.clearance for result in analysis.steps)
        if near is not None
    ]


def _mesh(mesh: Mesh) -> dict[str, Json]:
    return {
        "points": quantised(mesh.points, 5e-4),
        "normals": quantised(mesh.normals, 1.0 / 32767),
        "triangles": indices(mesh.triangles),
    }


def _matrix(pose: FloatArray) -> list[float]:
    """Column-major, as WebGL wants it."""
    return [round(float(x), 6) for x in np.asarray(pose).T.ravel()]
