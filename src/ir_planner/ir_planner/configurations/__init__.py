"""Configurations that reach a pose: closed form, and the paper's coordinate descent (eqs. 1 to
6).
"""

from ir_planner.configurations.ccd_search import INTERACTION, InteractionSettings
from ir_planner.configurations.interaction_point import (
    IK_METHODS,
    STARTS_MAX,
    IkAnswer,
    configurations_at,
    searched_configurations,
)
from ir_planner.configurations.inverse_kinematics import (
    Configurations,
    configuration_log,
    free_configurations,
    joined,
    no_configuration,
)

__all__ = [
    "IK_METHODS",
    "INTERACTION",
    "STARTS_MAX",
    "Configurations",
    "IkAnswer",
    "InteractionSettings",
    "configuration_log",
    "configurations_at",
    "free_configurations",
    "joined",
    "no_configuration",
    "searched_configurations",
]
