"""Cells that nobody tuned for: bundled ones mirrored, turned about the vertical axis and jittered,
by seed.

Mirrored: everything at y of the base goes to -y, and A1, A4 and A6 of the tasks change their signs.
Turned: all machines about the robot's vertical axis, and A1 of the tasks with them. Jittered: every
machine by some centimetres and degrees, while the tasks stay; those whose ends come too near are
left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from _regional_tasks import scene_of_cell

from ir_description import Cell, Equipment, Station, cell_to_yaml, load_cell
from ir_description.cell import Task
from ir_description.poses import composed
from ir_values.arrays import FloatArray

TURN = np.radians(40.0)  # at most
# standard deviations: m, rad about the vertical axis
SHIFT = 0.03
TILT = np.radians(2.0)
CLEARANCE = 0.01  # m that the ends of a task must keep
TASKS = 0.5  # share of the tasks that must be left; else another jitter is drawn
_MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])
_MIRRORED_JOINTS = np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0])


def variant_files(cells: Sequence[str], count: int, seed: int, folder: Path) -> list[str]:
    """Write `count` variants of each cell (a name or a file) and return their files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name in cells:
        cell = load_cell(name)
        for k in range(count):
            file = folder / f"{cell.name}_{seed}_{k}.yaml"
            file.write_text(cell_to_yaml(variant(cell, seed, k)))
            files.append(str(file))
    return files


def variant(cell: Cell, seed: int, number: int) -> Cell:
    """One variant; the same seed and number give the same cell."""
    rng = np.random.default_rng([seed, number, *cell.name.encode()])
    changed = mirrored(cell) if rng.random() < 0.5 else cell
    changed = turned(changed, rng.uniform(-TURN, TURN))
    while True:
        found = _with_free_tasks(jittered(changed, rng))
        if len(found.tasks) >= TASKS * len(cell.tasks):
            return replace(found, name=f"{cell.name}_{seed}_{number}")


def mirrored(cell: Cell) -> Cell:
    """The cell in a mirror: y of the robot's base changes its sign."""
    base = np.asarray(cell.base_pose)

    def reflected(pose: FloatArray) -> FloatArray:
        return np.asarray(base @ _MIRROR @ np.linalg.inv(base) @ pose @ _MIRROR)

    def own(pose: FloatArray) -> FloatArray:
        return np.asarray(_MIRROR @ pose @ _MIRROR)

    def machine(old: Equipment) -> Equipment:
        bodies = tuple(
            replace(body, pose=own(body.pose), vertices=body.vertices * np.diag(_MIRROR)[:3])
            for body in old.bodies
        )
        zone = replace(old.zone_in_equipment, pose=own(old.zone_in_equipment.pose))
        return replace(old, pose=reflected(old.pose), bodies=bodies, zone_in_equipment=zone)

    def station(old: Station) -> Station:
        return replace(old, pose=reflected(old.pose), pose_in_equipment=own(old.pose_in_equipment))

    tasks = tuple(
        Task(task.name, task.start * _MIRRORED_JOINTS, task.goal * _MIRRORED_JOINTS)
        for task in cell.tasks
    )
    machines = tuple(map(machine, cell.equipment))
    stations = tuple(map(station, cell.stations))
    return replace(cell, equipment=machines, stations=stations, tasks=tasks)


def turned(cell: Cell, angle: float) -> Cell:
    """All machines turned by an angle [rad] about the z axis of the robot's base, and A1 with
    them.
    """
    base = np.asarray(cell.base_pose)
    turn = base @ _about_z(angle) @ np.linalg.inv(base)
    sign = float(np.sign((cell.robot.joint_origin[0][:3, :3] @ cell.robot.joint_axis[0])[2]))
    change = np.zeros(cell.robot.n)
    change[0] = sign * angle
    tasks = tuple(Task(task.name, task.start + change, task.goal + change) for task in cell.tasks)
    moved = cell
    for machine in cell.equipment:
        moved = moved.with_equipment(machine.name, composed(turn, machine.pose))
    return replace(moved, tasks=tasks)


def jittered(cell: Cell, rng: np.random.Generator) -> Cell:
    """Every machine moved a little on the floor and turned about its own vertical axis."""
    moved = cell
    for machine in cell.equipment:
        shift = np.eye(4)
        shift[:2, 3] = rng.normal(0.0, SHIFT, 2)
        pose = shift @ composed(machine.pose, _about_z(rng.normal(0.0, TILT)))
        moved = moved.with_equipment(machine.name, pose)
    return moved


def _with_free_tasks(cell: Cell) -> Cell:
    """The cell with those of its tasks whose ends keep CLEARANCE."""
    scene = scene_of_cell(cell)
    free = tuple(
        task
        for task in cell.tasks
        if scene.collision.min_distance(np.stack([task.start, task.goal])).distance.min()
        > CLEARANCE
    )
    return replace(cell, tasks=free)


def _about_z(angle: float) -> FloatArray:
    pose = np.eye(4)
    pose[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return pose
