"""The problem of a withdrawal: from a configuration at a station to outside its machine's forbidden
zone.
"""

from collections import Counter
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple, Protocol

import numpy as np

from ir_description import Body, Station
from ir_description.cell import Zone
from ir_kernels import CollisionModel
from ir_planner.checks import FreeSpace
from ir_planner.request import Context, Work
from ir_planner.scene import PlanningScene, tcp_inside
from ir_values.arrays import BoolArray, FloatArray, IntArray

# A service movement begins in the machine's forbidden zone. Outside means that every capsule from
# link 3 to the tool is farther than S_m from the zone. D of eq. (7) is the sum of the metric
# distances between the moving bodies (robot, tool, part) and the bodies of this machine; pairs of
# the robot with itself never grow, so they don't take part.

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
        """The work area of a station, computed anew; `of` remembers."""
        machine = scene.cell.machine(station.equipment)
        if not machine.enabled:
            return WorkArea(scene, station, None, None, None)
        capsules = [
            *scene.cell.robot.capsules,
            *(capsule for load in scene.loads for capsule in load.capsules),
        ]
        bodies = machine.world_bodies()
        zone = machine.zone
        first = FIRST_LINK + scene.cell.robot.base
        inner = [capsule for capsule in capsules if capsule.link >= first]
        box = Body("zone", "box", zone.pose, zone.size)
        return WorkArea(
            scene,
            station,
            zone,
            CollisionModel(scene.chain, capsules, bodies, ()) if bodies else None,
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


# per step of a path where contacts are asked for; the proof of the movement is exact
_EDGE_SAMPLES = 12


@dataclass(frozen=True, eq=False)
class Exit:
    """From `interaction` (n,) out of the area; free space inside (with allowed contacts) and
    outside (without), S_m [m].
    """

    interaction: FloatArray
    area: WorkArea
    inside: FreeSpace
    outside: FreeSpace
    safety_distance: float

    @staticmethod
    def of(interaction: FloatArray, context: Context) -> "Exit":
        """The problem of leaving the context's station from `interaction` (n,)."""
        scene = context.scene
        margin = context.safety_distance
        work = context.work
        return Exit(
            interaction,
            WorkArea.of(scene, scene.station(context.station)),
            FreeSpace.of(scene, margin, work, context.station, cone=context.cone),
            FreeSpace.of(scene, margin, work, cone=context.cone),
            margin,
        )

    @cached_property
    def least_distance(self) -> float:
        """How far [m] the tcp must go: by the approach distance where the interaction configuration
        is outside the zone already, as above a pallet; else leaving the zone is what counts.
        """
        outside = self.area.left(self.interaction[None], self.safety_distance)[0]
        return float(self.area.station.approach_distance) if outside else 0.0

    def is_out(self, q: FloatArray, zone_distance: FloatArray | None = None) -> BoolArray:
        """Which configurations (N, n) have left the zone and are free without allowed contacts.

        zone_distance (N,) m, where that is known.
        """
        zone = self.area.zone_distance(q) if zone_distance is None else zone_distance
        out = np.asarray(zone > self.safety_distance)
        if self.least_distance > 0.0:
            chain = self.inside.scene.chain
            moved = chain.tcp_poses(q)[:, :3, 3] - chain.tcp_poses(self.interaction[None])[:, :3, 3]
            out &= np.linalg.norm(moved, axis=1) >= self.least_distance
        out[out] = self.outside.states_free(q[out])
        return out

    def contacts_end(self, path: FloatArray) -> bool:
        """Whether a path (M, n) keeps S_m where its tcp is outside the zone: allowed contacts end
        there.

        Asked at samples, so that what the proof of the movement would refuse is seldom timed.
        """
        scene = self.inside.scene
        station = self.area.station.name
        if not scene.allowed(station).any():
            return True
        share = np.linspace(0.0, 1.0, _EDGE_SAMPLES)[:, None, None]
        q = (path[:-1] + share * np.diff(path, axis=0)).reshape(-1, path.shape[1])
        beyond = ~tcp_inside(q, scene, station, self.safety_distance)
        return bool(self.outside.states_free(q[beyond]).all())


class WalkRecord(NamedTuple):
    """Configurations (N, n) that were kept, the interaction configuration first, each with the
    index of its parent (N,); `dropped` (M, n): those that came too near something. distance: the
    total metric distance D [m] at the interaction configuration and the largest one.
    """

    kept: FloatArray
    parents: IntArray
    dropped: FloatArray
    generations: int
    candidates: int
    distance: tuple[float, float]


@dataclass(frozen=True, eq=False)
class ExitsFound:
    """Free paths (M_k, n) from the interaction configuration to outside the zone; `note`: what was
    done.

    farthest (n,): the configuration farthest out; rejected: dropped candidates by reason, and
    obstructed: those of them for which two bodies came too near, which a refusal names. walk:
    every step of a search that goes on from configurations it has reached.
    """

    paths: list[FloatArray]
    farthest: FloatArray
    note: str = ""
    rejected: Counter[str] = field(default_factory=Counter)
    walk: WalkRecord | None = None
    obstructed: Counter[str] = field(default_factory=Counter)


class ExitSearch(Protocol):
    """Looks for paths out of a station. Its settings are its fields."""

    @property
    def title(self) -> str:
        """The name of its stage in answers."""

    def find(
        self, problem: Exit, wanted: int, seed: np.random.SeedSequence, work: Work
    ) -> ExitsFound:
        """Up to `wanted` paths whose every step `problem.inside` certifies.

        The same problem and seed give the same paths. Ends early when `work.exhausted`.
        """
