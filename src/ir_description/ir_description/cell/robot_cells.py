"""Several robots in one cell: a cell for each of them, with what the others' feet take away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_description.cell.cell import Cell, NameRegister
from ir_description.cell.equipment import Equipment, Station
from ir_description.cell.zones import zone_around
from ir_description.shapes import standing_capsule
from ir_values.errors import UnknownNameError

ROBOT_COUNT = (2, 6)
"""Fewest and most robots of a cell."""


@dataclass(frozen=True, eq=False)
class RobotCells:
    """The cell of each of `robots`, in their order: machines, parts and signals are shared, the
    feet of the other robots are among the machines.
    """

    name: str
    robots: tuple[str, ...]
    cells: tuple[Cell, ...]
    description: str = ""

    @staticmethod
    def of(name: str, cells: Sequence[tuple[str, Cell]], description: str = "") -> RobotCells:
        """The cells of robots by name, each of which knows no other yet."""
        register = NameRegister("robot")
        for robot, _ in cells:
            register.add(robot)
        feet = [_foot(robot, cell) for robot, cell in cells]
        own = [
            replace(
                cell,
                name=f"{name}.{robot}",
                equipment=(*cell.equipment, *(foot for foot in feet if foot.name != robot)),
            )
            for robot, cell in cells
        ]
        return RobotCells(name, tuple(robot for robot, _ in cells), tuple(own), description)

    @property
    def by_name(self) -> dict[str, Cell]:
        """The cell of each robot."""
        return dict(zip(self.robots, self.cells, strict=True))

    def of_robot(self, name: str) -> Cell:
        """The cell as one of the robots sees it. Raises UnknownNameError for none of them."""
        if name not in self.robots:
            raise UnknownNameError("robot", name, self.robots)
        return self.cells[self.robots.index(name)]

    def stations_of(self, name: str) -> tuple[str, ...]:
        """Names of the stations that concern a robot: those of its program, and of those that no
        program visits the ones to which no other robot's foot is nearer.
        """
        visited = {
            robot: {step.target for step in cell.program if step.kind == "STATION"}
            for robot, cell in self.by_name.items()
        }
        anybody = set[str]().union(*visited.values())
        return tuple(
            station.name
            for station in self.of_robot(name).stations
            if station.name in visited[name]
            or (station.name not in anybody and self._nearest(station) == name)
        )

    def _nearest(self, station: Station) -> str:
        """The robot whose foot is nearest to a station."""
        feet = np.array([cell.base_pose[:3, 3] for cell in self.cells])
        far = np.linalg.norm(feet - station.pose[:3, 3], axis=1)
        return self.robots[int(np.argmin(far))]

    def feet_of_others(self, name: str) -> tuple[str, ...]:
        """Names of the bodies of other robots' feet in a robot's cell."""
        machines = self.of_robot(name).equipment
        return tuple(
            body.name for each in machines if each.name in self.robots for body in each.bodies
        )


def _foot(name: str, cell: Cell) -> Equipment:
    """What never moves of a robot, as equipment of its name."""
    bodies = tuple(
        standing_capsule(f"{name}.{capsule.name}", capsule)
        for capsule in cell.robot.capsules
        if capsule.link == 0
    )
    return Equipment(
        name=name,
        pose=cell.base_pose,
        zone_in_equipment=zone_around("OPEN", bodies),
        bodies=bodies,
    )
