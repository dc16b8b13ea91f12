"""Configurations that reach a pose: closed form, and the paper's coordinate descent (eqs. 1 to 6)."""

from ir_planner.configurations.interaction_point import STARTS_MAX, searched_configurations
from ir_planner.configurations.inverse_kinematics import (
    free_configurations,
    no_configuration,
    ranked_solutions,
)
from ir_planner.configurations.settings import InteractionSettings

__all__ = [
    "STARTS_MAX",
    "InteractionSettings",
    "free_configurations",
    "no_configuration",
    "ranked_solutions",
    "searched_configurations",
]
