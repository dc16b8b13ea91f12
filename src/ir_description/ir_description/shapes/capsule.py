"""A capsule: all points within a radius of a segment. The collision shape of links, tools and held
parts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ir_description.arrays import frozen, in_range, transformed
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import InvalidValueError


@dataclass(frozen=True, eq=False)
class Capsule:
    """Segment p0 (3,) to p1 (3,) [m] in the frame of `link` (0 = base_link), radius [m].

    p0 = p1 is a sphere.
    """

    name: str
    link: int
    p0: FloatArray
    p1: FloatArray
    radius: float

    def __post_init__(self) -> None:
        if self.link < 0:
            raise InvalidValueError(
                f"link of capsule {self.name} is {self.link}, must be at least 0"
            )
        object.__setattr__(self, "p0", frozen(self.p0, (3,), "p0"))
        object.__setattr__(self, "p1", frozen(self.p1, (3,), "p1"))
        object.__setattr__(
            self, "radius", in_range(self.radius, 0.0, 100.0, "m", "radius", open_low=True)
        )

    def placed(self, pose: FloatArray) -> Capsule:
        """Return the capsule re-expressed by a pose (4, 4) of its frame in another frame of the
        same link.
        """
        return replace(self, p0=transformed(pose, self.p0), p1=transformed(pose, self.p1))
