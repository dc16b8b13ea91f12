"""What the executor allows and refuses."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from ir_sim_driver.errors import SettingsError


@dataclass(frozen=True)
class ExecutionSettings:
    """Bounds of trajectories and of their execution.

    start_tolerance [rad]: how far the first point of a trajectory that starts at 0 may lie from the command.
    path_tolerance [rad]: default per joint between command and robot while moving.
    goal_tolerance [rad], goal_time [s]: default error per joint at the end, and how long it may take to get there.
    tube [m]: largest distance of the simulated tcp from the commanded one.
    stop_time [s]: shortest stop along the path from full speed; the limits may make it longer.
    blend_time [s]: a jump of velocity in a trajectory is refused beyond acceleration limit times this.
    bridge_time [s]: shortest bridge from a running movement onto a trajectory that starts at time 0.
    max_points: longest trajectory; max_delay [s]: how far in the future a trajectory may start.
    position_slack [rad], limit_slack: by how much position limits, and (relative) the others, may be touched.
    """

    start_tolerance: float = 0.01
    path_tolerance: float = 0.05
    goal_tolerance: float = 0.005
    goal_time: float = 2.0
    tube: float = 0.005
    stop_time: float = 0.3
    blend_time: float = 0.02
    bridge_time: float = 0.25
    max_points: int = 20_000
    max_duration: float = 3600.0
    max_delay: float = 10.0
    position_slack: float = 1e-6
    limit_slack: float = 1e-3

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0.0):
                raise SettingsError(f"{field.name} is {value:g}: it must be above 0")
