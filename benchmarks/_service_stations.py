"""The safety distance that a station leaves to a benchmark."""

from __future__ import annotations

import numpy as np

from ir_description import Station
from ir_planner.scene.planning_scene import PlanningScene

S_M = 0.02  # m
SHARE_OF_BEST = 0.8  # of the station's best clearance, where that is smaller


def margin_at(scene: PlanningScene, station: Station) -> float:
    """S_m [m], or 80 % of the best clearance of the configurations at the station where that is
    smaller.
    """
    q = scene.inverse_kinematics.solve(station.pose[None]).q
    if len(q) == 0:
        return S_M
    offset = np.where(scene.allowed(station.name), -np.inf, 0.0)
    best = float(scene.collision.min_distance(q, offset).distance.max())
    return min(S_M, SHARE_OF_BEST * best) if best > 0.0 else S_M
