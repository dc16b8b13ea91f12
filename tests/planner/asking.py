"""How tests ask for a regional movement: with the registered searches, or with others."""

from __future__ import annotations

from collections.abc import Mapping

from ir_msgs_py.options import PlanOptions
from ir_planner.regional import MovementPlan
from ir_planner.regional.regional import plan_to_configurations
from ir_planner.request import Context, Journal, Work
from ir_planner.scene import PlanningScene
from ir_planner.search import SEARCHES, Search
from ir_values.arrays import FloatArray


def planned(
    start: FloatArray,
    goals: FloatArray,
    scene: PlanningScene,
    options: PlanOptions,
    work: Work,
    searches: Mapping[str, Search] = SEARCHES,
) -> MovementPlan:
    return plan_to_configurations(
        start, goals, Context(scene, options, Journal(work, options.seed)), searches
    )
