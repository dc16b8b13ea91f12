"""What a request asks for and what its answer says about itself: bounds, goals, counted work, the journal."""

from ir_planner.request.bounds import DURATION_MAX, bounded, checked_options, chosen, safety_distance
from ir_planner.request.goals import POSTURES, Goal, one_goal, parse_goal, within_limits
from ir_planner.request.journal import Journal
from ir_planner.request.work import Budget, Clock

__all__ = [
    "DURATION_MAX",
    "POSTURES",
    "Budget",
    "Clock",
    "Goal",
    "Journal",
    "bounded",
    "checked_options",
    "chosen",
    "one_goal",
    "parse_goal",
    "safety_distance",
    "within_limits",
]
