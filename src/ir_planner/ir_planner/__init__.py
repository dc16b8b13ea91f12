"""Planning core: movements and programs of an industrial robot among machines, with joules, seconds
and clearance.

    planner = Planner("demo")
    plan = planner.plan_regional(goal="lathe_work", objective="energy")
    print(plan)

Two further topics have faces of their own, for those who have KUKA programs: `ir_planner.krl` and
`ir_planner.before_after`. The other rooms are the planner's own. A name is imported when it is
first used: who needs errors and settings alone doesn't wait for the planner.
"""

from typing import TYPE_CHECKING

from ir_values.faces import on_first_use

if TYPE_CHECKING:
    from ir_msgs_py.options import PlanOptions
    from ir_planner.cartesian import CartesianPlan
    from ir_planner.checks import Evaluation, StateCheck
    from ir_planner.configurations import IkAnswer
    from ir_planner.errors import (
        CancelledError,
        PlannerError,
        RequestError,
        TimingError,
    )
    from ir_planner.flexible import SteadyPlan
    from ir_planner.planner import Planner
    from ir_planner.program import ProgramPlan, Standby
    from ir_planner.regional import EscapePlan, MovementPlan
    from ir_planner.request import Goal, parse_goal
    from ir_planner.service import ServicePlan
    from ir_planner.settings import PlannerSettings
    from ir_planner.store import StoredProgram
    from ir_planner.trajectories import OptimizationPlan, Reference
    from ir_planner.what_if_table import what_if
else:
    __getattr__, __dir__ = on_first_use(
        globals(),
        {
            "ir_msgs_py.options": ("PlanOptions",),
            "ir_planner.cartesian": ("CartesianPlan",),
            "ir_planner.checks": ("Evaluation", "StateCheck"),
            "ir_planner.configurations": ("IkAnswer",),
            "ir_planner.errors": (
                "CancelledError",
                "PlannerError",
                "RequestError",
                "TimingError",
            ),
            "ir_planner.flexible": ("SteadyPlan",),
            "ir_planner.planner": ("Planner",),
            "ir_planner.program": ("ProgramPlan", "Standby"),
            "ir_planner.regional": ("EscapePlan", "MovementPlan"),
            "ir_planner.request": ("Goal", "parse_goal"),
            "ir_planner.service": ("ServicePlan",),
            "ir_planner.settings": ("PlannerSettings",),
            "ir_planner.store": ("StoredProgram",),
            "ir_planner.trajectories": ("OptimizationPlan", "Reference"),
            "ir_planner.what_if_table": ("what_if",),
        },
    )

__all__ = [
    "CancelledError",
    "CartesianPlan",
    "EscapePlan",
    "Evaluation",
    "Goal",
    "IkAnswer",
    "MovementPlan",
    "OptimizationPlan",
    "PlanOptions",
    "Planner",
    "PlannerError",
    "PlannerSettings",
    "ProgramPlan",
    "Reference",
    "RequestError",
    "ServicePlan",
    "Standby",
    "StateCheck",
    "SteadyPlan",
    "StoredProgram",
    "TimingError",
    "parse_goal",
    "what_if",
]
