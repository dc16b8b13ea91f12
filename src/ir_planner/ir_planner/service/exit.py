"""The problem of a withdrawal: from a configuration at a station to outside its machine's forbidden
zone.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_planner.checks import FreeSpace
from ir_planner.request import Context
from ir_planner.scene import tcp_inside
from ir_planner.service.work_area import WorkArea

_EDGE_SAMPLES = (
    12  # per step of a path where contacts are asked for; the proof of the movement is exact
)


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
            FreeSpace.of(scene, margin, work, context.station),
            FreeSpace.of(scene, margin, work),
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
