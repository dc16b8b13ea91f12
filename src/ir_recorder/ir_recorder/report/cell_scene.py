"""Cell in 3D: triangles and poses of robot, loads and machines, doors as they stood."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ir_description import Body, Cell, Equipment
from ir_description.cell import machine_in
from ir_recorder.reading.recording import TextEvent
from ir_recorder.report.series import Json, indices, quantised
from ir_recorder.report.shapes import Mesh, body_mesh, capsule_mesh, robot_parts
from ir_values.arrays import FloatArray

# The cell as it stands, for the picture in 3D: triangles and poses of robot, loads, machines and
# parts.


def cell_scene(cell: Cell) -> dict[str, Json]:
    """What motion.js draws of a cell, whatever the robot does."""
    return {
        "base": matrix(cell.base_pose),
        "tcp": matrix(cell.tcp),
        "jointOrigins": [matrix(pose) for pose in cell.robot.joint_origin],
        "slides": cell.robot.base,
        "jointAxes": [[round(float(x), 9) for x in axis] for axis in cell.robot.joint_axis],
        "shapes": [*_robot_shapes(cell), *_load_shapes(cell)],
        "bodies": _bodies(cell),
        "labels": _labels(cell),
        "zones": _zones(cell),
        "floor": cell.floor,
    }


def part_meshes(cell: Cell, name: str) -> list[dict[str, Json]]:
    """The surface of a part that lies, in the frame of its station."""
    meshes = []
    for body in cell.part(name).lying(np.eye(4)):
        mesh = body_mesh(body)
        if mesh is not None:
            meshes.append({"pose": matrix(body.pose), **_mesh(mesh)})
    return meshes


def _robot_shapes(cell: Cell) -> list[dict[str, Json]]:
    """The robot twice: as its collision capsules, and as a robot looks."""
    capsules = [
        (c.link, "base" if c.link == 0 else "link", "capsules", c.name, capsule_mesh(c))
        for c in cell.robot.capsules
    ]
    looks = [(part.link, part.kind, "robot", "", part.mesh) for part in robot_parts(cell.robot)]
    return [
        {"link": link, "kind": kind, "look": look, "owner": "", "name": name, **_mesh(mesh)}
        for link, kind, look, name, mesh in (*looks, *capsules)
    ]


def _load_shapes(cell: Cell) -> list[dict[str, Json]]:
    """Tool and parts as they are held; each is drawn while its name is in the load."""
    shapes = []
    loads = list(cell.loads())
    loads += [
        load for part in cell.parts for load in cell.loads(part.name) if load.name == part.name
    ]
    for load in loads:
        for capsule in load.capsules:
            kind = "tool" if load.kind == "tool" else "part"
            mesh = _mesh(capsule_mesh(capsule))
            shapes.append(
                {
                    "link": capsule.link,
                    "kind": kind,
                    "look": "",
                    "owner": load.name,
                    "name": capsule.name,
                    **mesh,
                }
            )
    return shapes


def _bodies(cell: Cell) -> list[dict[str, Json]]:
    bodies = []
    for machine in cell.equipment:
        for body in machine.world_bodies():
            shape = body_shape(body, machine.name)
            if shape is not None:
                bodies.append(shape)
    return bodies


def body_shape(body: Body, owner: str) -> dict[str, Json] | None:
    """A body of a machine as motion.js draws it; None for a plane."""
    mesh = body_mesh(body)
    return (
        None
        if mesh is None
        else {"name": body.name, "owner": owner, "pose": matrix(body.pose), **_mesh(mesh)}
    )


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
            "pose": matrix(machine.zone.pose),
            "size": [round(float(edge), 4) for edge in machine.zone.size],
        }
        for machine in cell.equipment
        if machine.enabled
    ]


def _mesh(mesh: Mesh) -> dict[str, Json]:
    return {
        "points": quantised(mesh.points, 5e-4),
        "normals": quantised(mesh.normals, 1.0 / 32767),
        "triangles": indices(mesh.triangles),
    }


def matrix(pose: FloatArray) -> list[float]:
    """A pose (4, 4) column by column, as WebGL wants it."""
    return [round(float(x), 6) for x in np.asarray(pose).T.ravel()]


# Bodies of machines over a recording: doors are where their states have them, and while one
# changes what it sweeps is drawn as well.

ALWAYS = -1e9  # s: what is heard first was so before


def door_bodies(cell: Cell, events: Sequence[TextEvent]) -> list[dict[str, Json]]:
    """All bodies of the cell; those of machines whose states are in `events` ("shut>open" while
    they change) with `shown`: from which time [s] on they are there or not; `sweep`: it is what a
    door sweeps.
    """
    shapes = []
    for machine in cell.equipment:
        heard = [event for event in events if event.name == machine.name]
        for body, changes in _over_time(machine, list(_standing(machine, heard))):
            shape = body_shape(body, machine.name)
            if shape is not None:
                sweep = body.name not in {own.name for own in machine.bodies}
                shapes.append({**shape, "shown": changes, "sweep": sweep})
    return shapes


def _standing(machine: Equipment, heard: Sequence[TextEvent]) -> Iterator[tuple[float, Equipment]]:
    """The machine from the beginning, and whenever another of its states was heard."""
    known = {state.name for state in machine.states}
    last = ""
    for event in heard:
        states = event.text.split(">")
        if event.text != last and known.issuperset(states) and len(states) <= 2:
            yield (event.time if last else ALWAYS), machine_in(machine, states)
            last = event.text
    if not last:
        yield ALWAYS, machine


def _over_time(
    machine: Equipment, standing: Sequence[tuple[float, Equipment]]
) -> Iterator[tuple[Body, list[Json]]]:
    """Every body that is ever there, with the times at which it comes or goes."""
    present = [(time, {body.name: body for body in now.world_bodies()}) for time, now in standing]
    bodies = {name: body for _, there in present for name, body in there.items()}
    for name, body in bodies.items():
        changes: list[Json] = []
        before: bool | None = None
        for time, now in present:
            there = name in now
            if there != before:
                changes.append([round(time, 3), there])
            before = there
        yield body, changes
