"""Where a service movement begins: the machine's forbidden zone, and its bodies, which D of eq. (7)
counts.

Outside means that every capsule from link 3 to the tool is farther than S_m from the zone. D is the
sum of the metric distances between what moves (robot, tool, part) and the bodies of THIS machine;
pairs of the robot with itself never grow, so they don't take part.
"""

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ir_description import Body, Station, Zone
from ir_kernels import CollisionModel
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_planner.scene import PlanningScene

FIRST_LINK = 3  # of the links that must leave the zone: those before it never enter


@dataclass(frozen=True, eq=False)
class WorkArea:
    """Distances to one machine and to its zone; a machine that is switched off has neither."""

    scene: PlanningScene
    station: Station
    zone: Zone | None
    _machine: CollisionModel | None = field(repr=False)
    _box: CollisionModel | None = field(repr=False)

    @staticmethod
    def of(scene: PlanningScene, station: Station) -> "WorkArea":
        """The work area of the machine that a station belongs to."""
        return _work_area(scene, station.name)

    @staticmethod
    def built(scene: PlanningScene, station: Station) -> "WorkArea":
        """The same, built anew."""
        machine = scene.cell.machine(station.equipment)
        if not machine.enabled:
            return WorkArea(scene, station, None, None, None)
        capsules = [
            *scene.cell.robot.capsules,
            *(capsule for load in scene.loads for capsule in load.capsules),
        ]
        bodies = machine.world_bodies()
        zone = machine.zone
        inner = [capsule for capsule in capsules if capsule.link >= FIRST_LINK]
        box = Body("zone", "box", zone.pose, zone.size)
        return WorkArea(
            scene,
            station,
            zone,
            CollisionModel(scene.chain, [c for c in capsules if c.link > 0], bodies, ())
            if bodies
            else None,
            CollisionModel(scene.chain, inner, [box], ()) if inner else None,
        )

    @property
    def pairs(self) -> int:
        """How many pairs D sums over."""
        return 0 if self._machine is None else len(self._machine.pairs)

    def total_distance(self, q: FloatArray) -> FloatArray:
        """D (N,) [m] at q (N, n): the sum of all metric distances to the machine's bodies."""
        if self._machine is None or len(q) == 0:
            return np.zeros(len(q))
        return np.asarray(self._machine.distances(q).sum(axis=1))

    def zone_distance(self, q: FloatArray) -> FloatArray:
        """Distance (N,) [m] from the zone of the nearest capsule of link 3 to tool; negative:
        inside.
        """
        if self._box is None:
            return np.full(len(q), np.inf)
        return np.asarray(self._box.min_distance(q).distance)

    def left(self, q: FloatArray, safety_distance: float) -> BoolArray:
        """Which configurations (N, n) are outside the zone."""
        return np.asarray(self.zone_distance(q) > safety_distance)


@lru_cache(maxsize=32)  # scenes never change, and requests come back to the same stations
def _work_area(scene: PlanningScene, station: str) -> WorkArea:
    return WorkArea.built(scene, scene.station(station))
