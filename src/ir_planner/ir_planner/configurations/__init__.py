"""Configurations that reach a pose: closed form, and the paper's coordinate descent (eqs. 1 to
6).
"""

from ir_planner.configurations.answer import IK_METHODS, IkAnswer, configurations_at
from ir_planner.configurations.interaction_point import STARTS_MAX, searched_configurations
from ir_planner.configurations.inverse_kinematics import (
    Configurations,
    free_configurations,
    no_configuration,
    ranked_solutions,
)
from ir_planner.configurations.log import configuration_log
from ir_planner.configurations.settings import INTERACTION, InteractionSettings

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
    "no_configuration",
    "ranked_solutions",
    "searched_configurations",
]
