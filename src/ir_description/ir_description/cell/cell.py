"""A cell: one robot with its tool, the equipment around it, the parts, and the program.

A Cell is a value: changing a machine's place or state gives another cell, checked like the first.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Protocol, TypeVar

import numpy as np

from ir_description.arrays import frozen, frozen_pose
from ir_description.cell.checks import (
    check_contacts,
    check_names,
    check_payload,
    check_program,
    check_single_places,
)
from ir_description.cell.equipment import (
    AllowedContact,
    Equipment,
    Station,
    Zone,
    station_at,
    zone_around,
)
from ir_description.cell.part import Part
from ir_description.cell.program import CellSignal, PartPlaces, ProgramStep
from ir_description.cell.tool_path import CellPath
from ir_description.errors import UnknownNameError
from ir_description.poses import composed, inverse
from ir_description.robot import Load, RobotModel
from ir_description.shapes import Body, Capsule, floor_body
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import CartesianPath
from ir_msgs_py.errors import InvalidValueError


class _Named(Protocol):
    @property
    def name(self) -> str: ...


_T = TypeVar("_T", bound=_Named)


@dataclass(frozen=True, eq=False)
class Task:
    """A movement to plan: start and goal configuration (n,) [rad]."""

    name: str
    start: FloatArray
    goal: FloatArray


@dataclass(frozen=True, eq=False)
class Cell:
    """base_pose (4, 4) of base_link in the world; tcp (4, 4) in the last link.

    park and machine_home (n,) [rad] are the two named postures. base_contacts: pairs of a capsule
    of base_link and a body that touch for good (a pedestal); `ignored_pairs` adds the floor.
    """

    name: str
    robot: RobotModel
    base_pose: FloatArray
    tool: Load | None
    tcp: FloatArray
    parts: tuple[Part, ...]
    equipment: tuple[Equipment, ...]
    stations: tuple[Station, ...]
    signals: tuple[CellSignal, ...]
    park: FloatArray
    machine_home: FloatArray
    program: tuple[ProgramStep, ...]
    tasks: tuple[Task, ...] = ()
    paths: tuple[CellPath, ...] = ()
    floor: bool = True
    base_contacts: tuple[tuple[str, str], ...] = ()
    description: str = field(default="")

    def __post_init__(self) -> None:
        n = self.robot.n
        object.__setattr__(self, "base_pose", frozen_pose(self.base_pose, "base_pose"))
        object.__setattr__(self, "tcp", frozen_pose(self.tcp, "tcp"))
        for name in ("park", "machine_home"):
            posture = frozen(getattr(self, name), (n,), name)
            object.__setattr__(self, name, posture)
            check_posture(self.robot, posture, name)
        for task in self.tasks:
            check_posture(
                self.robot, frozen(task.start, (n,), "start"), f"start of task {task.name}"
            )
            check_posture(self.robot, frozen(task.goal, (n,), "goal"), f"goal of task {task.name}")
        check_names(self)
        check_single_places(self.parts)
        check_payload(self)
        check_contacts(self)
        check_program(self)

    def station(self, name: str) -> Station:
        """Return the station of that name."""
        return _named(self.stations, "station", name)

    def part(self, name: str) -> Part:
        """Return the part of that name."""
        return _named(self.parts, "part", name)

    def machine(self, name: str) -> Equipment:
        """Return the equipment of that name."""
        return _named(self.equipment, "equipment", name)

    def task(self, name: str) -> Task:
        """Return the task of that name."""
        return _named(self.tasks, "task", name)

    def path(self, name: str) -> CartesianPath:
        """Return the path of the tool of that name."""
        return self.own_path(name).path

    def own_path(self, name: str) -> CellPath:
        """Return the same with what it allows to touch."""
        return _named(self.paths, "path", name)

    def contacts_at(self, stop: str) -> tuple[AllowedContact, ...]:
        """Return the pairs that may touch at the station or along the path of that name."""
        return self._stop(stop).allowed_contacts

    def zone_at(self, stop: str) -> Zone | None:
        """Return the zone of its machine, in which they may; None for a path that belongs to
        none.
        """
        machine = self._stop(stop).equipment
        return self.machine(machine).zone if machine else None

    def _stop(self, name: str) -> Station | CellPath:
        stops: tuple[Station | CellPath, ...] = (*self.stations, *self.paths)
        return _named(stops, "station", name)

    def posture(self, name: str) -> FloatArray:
        """Return the joint values (n,) [rad] of "home" or "park"."""
        if name not in ("home", "park"):
            raise UnknownNameError("posture", name, ("home", "park"))
        return self.machine_home if name == "home" else self.park

    def bodies(self, parts: PartPlaces | None = None) -> tuple[Body, ...]:
        """Return all bodies in the world: the floor, the enabled equipment as it stands, the parts
        that lie.

        `parts` says where the parts are; None: where they are before the program starts.
        """
        parts = parts or self.parts_at_start()
        floor = (floor_body(),) if self.floor else ()
        machines = tuple(body for machine in self.equipment for body in machine.world_bodies())
        lying = tuple(
            body
            for name, station in parts.lying.items()
            if station
            for body in self.part(name).lying(self.station(station).pose)
        )
        return (*floor, *machines, *lying)

    def loads(self, held: str = "") -> tuple[Load, ...]:
        """Return the tool and the held part ("" for none) in the frame of the last link."""
        tool = (self.tool,) if self.tool is not None else ()
        return (*tool, self.part(held).held(self.tcp)) if held else tool

    def capsules(self, held: str = "") -> tuple[Capsule, ...]:
        """Return the capsules of the robot, its tool and the held part."""
        return (*self.robot.capsules, *(c for load in self.loads(held) for c in load.capsules))

    def self_pairs(self, held: str = "") -> tuple[tuple[str, str], ...]:
        """Return the pairs of capsules that can touch: every load against the robot, and the
        robot's own.
        """
        loads = tuple(
            (capsule.name, other)
            for load in self.loads(held)
            for capsule in load.capsules
            for other in self.robot.load_self_capsules
        )
        return (*loads, *self.robot.self_pairs)

    @property
    def ignored_pairs(self) -> tuple[tuple[str, str], ...]:
        """Pairs of a capsule of base_link and a body that touch for good, the floor among them."""
        base = tuple((c.name, "floor") for c in self.robot.capsules if c.link == 0 and self.floor)
        return (*base, *self.base_contacts)

    def parts_at_start(self) -> PartPlaces:
        """Return where the parts are before the program's first step."""
        return PartPlaces("", {part.name: part.station for part in self.parts})

    def with_equipment(
        self,
        name: str,
        pose: FloatArray | None = None,
        enabled: bool | None = None,
        state: str | None = None,
    ) -> Cell:
        """Return the cell with a machine moved, switched on or off, or in another state; stations
        follow.
        """
        old = self.machine(name)
        new = replace(
            old,
            pose=old.pose if pose is None else pose,
            enabled=old.enabled if enabled is None else enabled,
            state=old.state if state is None else state,
        )
        return replace(
            self,
            equipment=tuple(new if machine is old else machine for machine in self.equipment),
            stations=tuple(_moved(station, new) for station in self.stations),
            paths=tuple(_moved_path(path, old, new) for path in self.paths),
        )

    def with_station(self, name: str, pose_in_equipment: FloatArray) -> Cell:
        """Return the cell with a station elsewhere at its machine, whose default zone follows."""
        old = self.station(name)
        machine = self.machine(old.equipment)
        moved = station_at(
            machine,
            name,
            pose_in_equipment,
            old.allowed_contacts,
            old.approach_distance,
            old.search,
        )
        stations = tuple(moved if station is old else station for station in self.stations)
        mine = [
            tuple(s for s in each if s.equipment == machine.name)
            for each in (self.stations, stations)
        ]
        equipment = self.equipment
        if machine.has_default_zone(mine[0]):
            zone = zone_around(machine.zone_in_equipment.kind, machine.bodies, mine[1])
            new = replace(machine, zone_in_equipment=zone)
            equipment = tuple(new if each is machine else each for each in equipment)
        return replace(self, stations=stations, equipment=equipment)


def check_posture(robot: RobotModel, posture: FloatArray, name: str) -> None:
    """Refuse joint values (n,) [rad] beyond the robot's limits."""
    for i, value in enumerate(posture):
        low = robot.position_min[i]
        high = robot.position_max[i]
        if not low <= value <= high:
            raise InvalidValueError(
                f"{name}: {robot.joint_names[i]} is {np.degrees(value):g} deg, must be in "
                f"[{np.degrees(low):g}, {np.degrees(high):g}] deg"
            )


def _moved(station: Station, machine: Equipment) -> Station:
    if station.equipment != machine.name:
        return station
    return station_at(
        machine,
        station.name,
        station.pose_in_equipment,
        station.allowed_contacts,
        station.approach_distance,
        station.search,
    )


def _moved_path(path: CellPath, old: Equipment, new: Equipment) -> CellPath:
    if path.equipment != new.name or np.array_equal(old.pose, new.pose):
        return path
    return path.moved(composed(new.pose, inverse(old.pose)))


def _named(items: Iterable[_T], what: str, name: str) -> _T:
    items = tuple(items)
    for item in items:
        if item.name == name:
            return item
    raise UnknownNameError(what, name, (item.name for item in items))
