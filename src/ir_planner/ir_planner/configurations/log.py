"""What became of every random start of a search for configurations, as it travels with an
answer.
"""

import numpy as np

from ir_msgs_py.search_log import ConfigurationLog, Track
from ir_planner.configurations.inverse_kinematics import Configurations
from ir_planner.scene import PlanningScene

_TRACKS = 64  # starts whose positions are kept: more than a picture shows


def configuration_log(
    station: str, found: Configurations, scene: PlanningScene
) -> ConfigurationLog:
    """The starts of a search at a station: where the tool was from sweep to sweep, and what ended
    them.
    """
    tracks = tuple(
        Track(outcome, scene.chain.tcp_poses(np.ascontiguousarray(q))[:, :3, 3])
        for q, outcome in zip(found.tracks[:_TRACKS], found.outcome, strict=False)
    )
    return ConfigurationLog(
        station=station,
        starts=len(found.outcome),
        accepted=sum(outcome == "" for outcome in found.outcome),
        distinct=len(found.q),
        rejected=tuple(sorted(found.rejected.items(), key=lambda item: (-item[1], item[0]))),
        tracks=tracks,
    )
