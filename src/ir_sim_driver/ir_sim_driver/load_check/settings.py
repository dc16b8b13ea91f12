"""Settings of the load check, and of a load that is not what it is declared to be."""

from __future__ import annotations

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting


@dataclass(frozen=True)
class LoadCheckSettings:
    """What the robot really carries, and when a difference from what was declared is noticed."""

    mass_error: float = setting(
        0.0,
        "By what share the load that the simulated robot carries is heavier than it was declared.",
        minimum=-0.9,
        maximum=1.0,
        read_only=True,
    )
    parameters: str = setting(
        "data_sheet",
        "What is known of the robot: 'data_sheet', or the path of a file that a fit wrote.",
        read_only=True,
    )
    threshold: float = setting(
        3.0,
        "Standard deviations of the estimated mass from which on it is noticed.",
        minimum=1.0,
        maximum=10.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)
