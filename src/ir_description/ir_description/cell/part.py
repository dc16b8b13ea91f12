"""A part: a load while it is held, bodies of the cell while it lies at a station."""

from __future__ import annotations

from dataclasses import dataclass

from ir_description.arrays import frozen_pose
from ir_description.poses import composed
from ir_description.robot import Load
from ir_description.shapes import Body
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class Part:
    """load and bodies stand in the part's own frame; grasp (4, 4) is that frame in the tcp when it
    is held.

    station: where it lies, "" for nowhere (held, or not there). Lying at a station means lying as
    it is held when the tcp stands at the station.
    """

    load: Load
    bodies: tuple[Body, ...]
    grasp: FloatArray
    station: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "grasp", frozen_pose(self.grasp, f"grasp of {self.load.name}"))
        if self.load.kind != "part":
            raise InvalidValueError(
                f"the load of part {self.name} is of kind {self.load.kind}, must be part"
            )
        if any(body.kind == "plane" for body in self.bodies):
            raise InvalidValueError(f"part {self.name} has a plane as body; a part is finite")

    @property
    def name(self) -> str:
        """The name of the part."""
        return self.load.name

    def held(self, tcp: FloatArray) -> Load:
        """Return the load in the frame of the last link, where the tcp (4, 4) stands."""
        return self.load.placed(composed(tcp, self.grasp))

    def lying(self, station_pose: FloatArray) -> tuple[Body, ...]:
        """Return its bodies in the world, lying where the tcp (4, 4) would hold it."""
        pose = composed(station_pose, self.grasp)
        return tuple(body.placed(pose) for body in self.bodies)
