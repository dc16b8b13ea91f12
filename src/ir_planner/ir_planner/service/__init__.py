"""Service movements: straight lines at a station, and the withdrawal from a machine (eq. 7)."""

from ir_planner.service.exit import Exit, ExitSearch, ExitsFound, WorkArea
from ir_planner.service.exit_paths import (
    EXIT_SEARCHES,
    ExitPath,
    exit_searches,
    known_method,
    withdrawal,
)
from ir_planner.service.service_lines import (
    ServiceLine,
    line_poses,
    lines_free,
    service_lines,
    timed_service,
)
from ir_planner.service.service_movement import (
    ServicePlan,
    ServiceRequest,
    checked_request,
    plan_service,
    service_shapes,
)
from ir_planner.service.stochastic_withdrawal import ModifiedGa

__all__ = [
    "EXIT_SEARCHES",
    "Exit",
    "ExitPath",
    "ExitSearch",
    "ExitsFound",
    "ModifiedGa",
    "ServiceLine",
    "ServicePlan",
    "ServiceRequest",
    "WorkArea",
    "checked_request",
    "exit_searches",
    "known_method",
    "line_poses",
    "lines_free",
    "plan_service",
    "service_lines",
    "service_shapes",
    "timed_service",
    "withdrawal",
]
