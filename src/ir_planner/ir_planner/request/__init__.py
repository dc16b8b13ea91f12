"""Requests and the record of their answers: bounds, goals, counted work, the journal."""

from ir_planner.request.bounds import (
    DURATION_MAX,
    POSITION_MAX,
    bounded,
    checked_options,
    chosen,
    examinable,
    leaning_freely_only,
    safety_distance,
)
from ir_planner.request.context import (
    Clock,
    Context,
    Journal,
    Work,
    cone_of,
    noted,
    one_tilt,
    upright_options,
)
from ir_planner.request.goals import (
    POSTURES,
    Goal,
    joint_values,
    joints_of,
    one_goal,
    parse_goal,
    within_limits,
)

__all__ = [
    "DURATION_MAX",
    "POSITION_MAX",
    "POSTURES",
    "Clock",
    "Context",
    "Goal",
    "Journal",
    "Work",
    "bounded",
    "checked_options",
    "chosen",
    "cone_of",
    "examinable",
    "joint_values",
    "joints_of",
    "leaning_freely_only",
    "noted",
    "one_goal",
    "one_tilt",
    "parse_goal",
    "safety_distance",
    "upright_options",
    "within_limits",
]
