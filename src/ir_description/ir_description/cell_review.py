"""Looks over a cell that is valid but may not be meant: what a colleague would ask before running
it.

No kinematics here; whether stations are reachable without collision is the planner's to say.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ir_description.cell import AUTO, Cell, RobotCells, Zone
from ir_description.poses import abc_from_rotation
from ir_description.robot import PowerData
from ir_description.shapes import Body, Capsule, capsule_distance, overlapping, point_distance
from ir_values.arrays import FloatArray

OVERLAPS_MAX = 1_000
"""Zones that overlap are named up to this many pairs."""
_LARGE = 50.0  # m: a body longer than that is rather one in mm
_SUNK = 0.005  # m: a body that reaches farther below the floor is rather placed by its underside
_RIGHT = 0.5 * np.pi  # rad
_ROUNDED = 0.01  # rad: written as 3.14 or 1.57
_FAR = 10.0  # times the reach: a place farther away is rather one in mm


@dataclass(frozen=True)
class CellFinding:
    """An error will keep the program from running; a warning may be meant."""

    severity: Literal["error", "warning"]
    subject: str
    sentence: str


def check_cell(cell: Cell, power: PowerData | None = None) -> tuple[CellFinding, ...]:
    """Return what looks wrong in a cell, errors first. power: the modes; None: the robot's own."""
    findings = [
        *_base(cell),
        *_sizes(cell),
        *_angles(cell),
        *_sunk(cell),
        *_stations(cell),
        *_zones(cell),
        *_signals(cell),
        *_pauses(cell, power or cell.robot.controller),
        *_part_findings(cell),
        *_processes(cell),
    ]
    return tuple(sorted(findings, key=lambda finding: finding.severity))


def check_robot_cell(cells: RobotCells, robot: str) -> tuple[CellFinding, ...]:
    """Return the same of the cell of one of several robots: stations that concern another robot
    alone are left to that one, and feet may look as they do.
    """
    cell = cells.of_robot(robot)
    own = cells.stations_of(robot)
    others = {station.name for station in cell.stations} - set(own)
    feet = cells.feet_of_others(robot)
    return tuple(
        finding
        for finding in check_cell(cell)
        if finding.subject not in others
        and not (finding.severity == "warning" and finding.subject in feet)
    )


def _sizes(cell: Cell) -> Iterator[CellFinding]:
    """Lengths that were meant in mm."""
    for body in cell.bodies():
        longest = float(body.size.max(initial=0.0)) if body.kind != "plane" else 0.0
        if longest > _LARGE:
            sentence = (
                f"is {longest:g} m long; lengths are in m: {longest / 1000.0:g} for {longest:g} mm?"
            )
            yield CellFinding("warning", body.name, sentence)


def _angles(cell: Cell) -> Iterator[CellFinding]:
    """Angles that were meant in radians: a right angle is usual, 1.57 degrees is not."""
    for subject, angles in _angles_deg(cell):
        turns = np.round(angles / _RIGHT)
        right = (turns != 0.0) & (np.abs(angles - turns * _RIGHT) < _ROUNDED)
        if right.any() and (np.abs(angles) < 2.0 * np.pi + _ROUNDED).all():
            k = int(np.argmax(right))
            meant = f"{90.0 * turns[k]:g} for {angles[k]:.6g} rad"
            sentence = f"is turned by {angles[k]:.6g} degrees; angles are in degrees: {meant}?"
            yield CellFinding("warning", subject, sentence)


def _angles_deg(cell: Cell) -> Iterator[tuple[str, FloatArray]]:
    """A, B, C [deg] of everything that has a pose, and the joint values of the postures."""
    poses = [("base", cell.base_pose), ("tcp", cell.tcp)]
    for machine in cell.equipment:
        poses.append((machine.name, machine.pose))
        poses += [(body.name, body.pose) for body in _first_of_pose(machine.bodies)]
    for part in cell.parts:
        poses.append((part.name, part.grasp))
        poses += [(body.name, body.pose) for body in _first_of_pose(part.bodies)]
    poses += [(station.name, station.pose_in_equipment) for station in cell.stations]
    yield from ((subject, abc_from_rotation(pose[:3, :3])) for subject, pose in poses)
    for name in ("home", "park"):
        yield name, np.degrees(cell.posture(name)[cell.robot.base :])


def _first_of_pose(bodies: Iterable[Body]) -> Iterable[Body]:
    """One body of each pose: the pieces of a mesh share theirs."""
    return {body.pose.tobytes(): body for body in reversed([*bodies])}.values()


def _sunk(cell: Cell) -> Iterator[CellFinding]:
    """Bodies whose middle was meant to be their underside."""
    for body in cell.bodies() if cell.floor else ():
        below = 0.0 if body.kind == "plane" else -float(body.bounds()[0][2])
        if below > _SUNK:
            sentence = (
                f"reaches {below:.3f} m below the floor; xyz is the middle of a body, not "
                "its underside"
            )
            yield CellFinding("warning", body.name, sentence)


def _base(cell: Cell) -> Iterator[CellFinding]:
    """Capsules of base_link never move: what they touch, they touch for good."""
    ignored = set(cell.ignored_pairs)
    bodies = cell.bodies()
    bounds = np.array([body.bounds() for body in bodies]).reshape(-1, 2, 3)
    fixed = [capsule.placed(cell.base_pose) for capsule in cell.robot.capsules if capsule.link == 0]
    reaches = np.array([_capsule_bounds(capsule) for capsule in fixed]).reshape(-1, 2, 3)
    for c, b in overlapping(reaches, bounds):
        capsule = fixed[c]
        body = bodies[b]
        if (capsule.name, body.name) in ignored:
            continue
        distance = capsule_distance(body, capsule)
        if distance <= 0.0:
            yield CellFinding(
                "error",
                body.name,
                f"stands in the robot's {capsule.name} ({distance:.3f} m); move it, or write "
                f"base_contacts: [[{capsule.name}, {body.name}]] if the robot is mounted on it",
            )


def _capsule_bounds(capsule: Capsule) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest corner (3,) [m]."""
    ends = np.stack([capsule.p0, capsule.p1])
    return ends.min(axis=0) - capsule.radius, ends.max(axis=0) + capsule.radius


def _shoulder(cell: Cell) -> FloatArray:
    """Where (3,) A1 is in the world, on a rail at 0."""
    robot = cell.robot
    shoulder = cell.base_pose @ robot.joint_origin[robot.base]
    return np.asarray(shoulder[:3, 3])


def _from_shoulder(point: FloatArray, shoulder: FloatArray, cell: Cell) -> float:
    """How far [m] a point (3,) is from A1, on a rail from where that brings it nearest."""
    rail = cell.robot.rail
    away = point - shoulder
    if rail is not None:
        along = cell.base_pose[:3, :3] @ rail.axis
        away = away - np.clip(away @ along, rail.low, rail.high) * along
    return float(np.linalg.norm(away))


def _stations(cell: Cell) -> Iterator[CellFinding]:
    """Stations whose tcp is inside a body or out of reach, or whose machine or contacts have no
    effect.
    """
    shoulder = _shoulder(cell)
    reach = _reach(cell)
    machines = {machine.name: machine for machine in cell.equipment}
    around = _bodies_around(cell)
    for station, bodies in zip(cell.stations, around, strict=True):
        point = station.pose[:3, 3]
        for body in bodies:
            depth = point_distance(body, point)
            if depth < 0.0:
                yield CellFinding(
                    "error", station.name, f"its tcp is {-depth:.3f} m inside {body.name}"
                )
        distance = _from_shoulder(point, shoulder, cell)
        if distance > reach:
            unit = "; lengths are in m, not in mm" if distance > _FAR * reach else ""
            sentence = f"its tcp is {distance:.3f} m from A1, the arm reaches {reach:.3f} m{unit}"
            yield CellFinding("error", station.name, sentence)
        machine = machines[station.equipment]
        if not machine.enabled:
            yield CellFinding(
                "warning", station.name, f"its machine {machine.name} is switched off"
            )
        if station.allowed_contacts and not _is_inside(machine.zone, point):
            yield CellFinding(
                "warning",
                station.name,
                f"its tcp is outside the zone of {machine.name}; only inside do its allowed "
                "contacts hold",
            )


def _bodies_around(cell: Cell) -> list[list[Body]]:
    """Bodies of machines whose bounds hold the tcp, for every station."""
    bodies = [body for machine in cell.equipment for body in machine.world_bodies()]
    points = np.array([station.pose[:3, 3] for station in cell.stations]).reshape(-1, 3)
    bounds = np.array([body.bounds() for body in bodies]).reshape(-1, 2, 3)
    found: list[list[Body]] = [[] for _ in cell.stations]
    for k, b in overlapping(np.stack([points, points], axis=1), bounds):
        found[k].append(bodies[b])
    return found


def _reach(cell: Cell) -> float:
    """Upper bound of the distance of the tcp from the first joint's frame."""
    offsets = np.linalg.norm(cell.robot.joint_origin[cell.robot.base + 1 :, :3, 3], axis=1)
    return float(offsets.sum() + np.linalg.norm(cell.tcp[:3, 3]))


def _is_inside(zone: Zone, point: FloatArray) -> bool:
    local = zone.pose[:3, :3].T @ (point - zone.pose[:3, 3])
    return bool((np.abs(local) <= zone.size / 2.0).all())


def _zones(cell: Cell) -> Iterator[CellFinding]:
    """Where zones overlap, one machine obstructs the withdrawal from the other, if there are
    stations.
    """
    machines = [machine for machine in cell.equipment if machine.enabled]
    visited = {station.equipment for station in cell.stations}
    zones = [machine.zone for machine in machines]
    bounds = np.array([_zone_bounds(zone) for zone in zones]).reshape(-1, 2, 3)
    pairs = (
        (i, j)
        for i, j in overlapping(bounds, bounds)
        if i < j
        and not visited.isdisjoint((machines[i].name, machines[j].name))
        and _boxes_overlap(zones[i], zones[j])
    )
    for i, j in itertools.islice(pairs, OVERLAPS_MAX):
        yield CellFinding(
            "warning", machines[i].name, f"its zone overlaps that of {machines[j].name}"
        )


def _zone_bounds(zone: Zone) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest corner (3,) [m] in the world."""
    reach = np.abs(zone.pose[:3, :3]) @ zone.size / 2.0
    return zone.pose[:3, 3] - reach, zone.pose[:3, 3] + reach


def _boxes_overlap(first: Zone, second: Zone) -> bool:
    """Separating axes of two boxes: their faces' normals and the cross products of their edges."""
    A = first.pose[:3, :3]
    B = second.pose[:3, :3]
    between = second.pose[:3, 3] - first.pose[:3, 3]
    half = (first.size + second.size) / 2.0
    if float(np.linalg.norm(between)) > float(np.linalg.norm(half)):
        return False
    crosses = np.cross(A.T[:, None], B.T[None]).reshape(-1, 3)
    for axis in (*A.T, *B.T, *(c for c in crosses if np.linalg.norm(c) > 1e-9)):
        reach = (np.abs(A.T @ axis) @ first.size + np.abs(B.T @ axis) @ second.size) / 2.0
        if abs(float(axis @ between)) >= float(reach) - 1e-9:
            return False
    return True


def _signals(cell: Cell) -> Iterator[CellFinding]:
    answered = {signal.name: signal for signal in cell.signals}
    set_somewhere = {
        (signal.name, signal.value) for step in cell.program for signal in step.set_signals
    }
    for k, step in enumerate(cell.program, start=1):
        for signal in step.wait_for:
            source = answered[signal.name]
            if source.initial == signal.value or (signal.name, signal.value) in set_somewhere:
                continue
            if (source.follows, signal.value) in set_somewhere:
                continue
            yield CellFinding(
                "warning",
                signal.name,
                f"step {k} waits for {signal.text}, which nothing in the cell brings about",
            )


def _pauses(cell: Cell, power: PowerData) -> Iterator[CellFinding]:
    for k, step in enumerate(cell.program, start=1):
        if step.kind != "PAUSE" or step.power_mode == AUTO:
            continue
        if step.power_mode not in [mode.name for mode in power.modes]:
            sentence = (
                f"asks for {step.power_mode}, which the controller {power.name} does not have"
            )
            yield CellFinding("error", f"step {k}", sentence)
            continue
        mode = power.mode(step.power_mode)
        if step.dwell < mode.time_min_pause:
            yield CellFinding(
                "warning",
                f"step {k}",
                f"the pause is {step.dwell:g} s, {mode.name} needs at least "
                f"{mode.time_min_pause:g} s",
            )


def _part_findings(cell: Cell) -> Iterator[CellFinding]:
    """A part that is still held at the end."""
    state = cell.parts_at_start()
    for step in cell.program:
        state = state.after(step)
    if state.held:
        yield CellFinding("warning", state.held, "is still held when the program ends")


def _processes(cell: Cell) -> Iterator[CellFinding]:
    for machine in cell.equipment if cell.route is None else ():
        if machine.process > 0.0:
            sentence = f"has a process of {machine.process:g} s, but the cell has no route"
            yield CellFinding("warning", machine.name, sentence)
