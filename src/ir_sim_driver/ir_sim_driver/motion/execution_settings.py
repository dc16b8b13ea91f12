"""What the executor allows and refuses."""

from __future__ import annotations

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting


@dataclass(frozen=True)
class ExecutionSettings:
    """Bounds of trajectories and of their execution."""

    start_tolerance: float = setting(
        0.01,
        "How far the first point of a trajectory that starts at 0 may lie from the command, per "
        "joint.",
        unit="rad",
        minimum=1e-6,
        maximum=0.1,
    )
    path_tolerance: float = setting(
        0.05, "Default tolerance per joint while moving.", unit="rad", minimum=1e-6, maximum=1.0
    )
    goal_tolerance: float = setting(
        0.005, "Default tolerance per joint at the end.", unit="rad", minimum=1e-6, maximum=1.0
    )
    goal_time: float = setting(
        2.0,
        "How long the robot may take to come within the goal tolerance.",
        unit="s",
        minimum=0.001,
        maximum=60.0,
    )
    tube: float = setting(
        0.005,
        "Largest distance of the tool from its commanded place.",
        unit="m",
        minimum=1e-4,
        maximum=0.1,
    )
    stop_time: float = setting(
        0.3,
        "Shortest stop along the path from full speed; the limits may make it longer.",
        unit="s",
        minimum=0.05,
        maximum=5.0,
    )
    blend_time: float = setting(
        0.02,
        "A velocity that jumps by more than the acceleration limit times this is refused.",
        unit="s",
        minimum=0.001,
        maximum=0.1,
    )
    bridge_time: float = setting(
        0.25,
        "Shortest bridge from a running movement onto a trajectory that starts at 0.",
        unit="s",
        minimum=0.05,
        maximum=5.0,
    )
    max_points: int = setting(
        20_000, "Longest trajectory, in points.", minimum=1, maximum=1_000_000
    )
    max_duration: float = setting(3600.0, "Longest trajectory.", unit="s", minimum=1.0, maximum=1e5)
    max_delay: float = setting(
        10.0, "How far in the future a header stamp may lie.", unit="s", minimum=0.0, maximum=3600.0
    )
    position_slack: float = setting(
        1e-6, "By how much a position limit may be exceeded.", unit="rad", minimum=0.0, maximum=0.01
    )
    limit_slack: float = setting(
        1e-3,
        "By what share limits of velocity, acceleration and torque may be exceeded.",
        minimum=0.0,
        maximum=0.1,
    )

    def __post_init__(self) -> None:
        check_settings(self)
