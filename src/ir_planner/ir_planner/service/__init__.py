"""Service movements: straight lines at a station, and the withdrawal from a machine (eq. 7)."""

from ir_planner.service.candidate_shapes import service_shapes
from ir_planner.service.exit import Exit
from ir_planner.service.exit_search import ExitSearch, ExitsFound
from ir_planner.service.modified_ga import ModifiedGa
from ir_planner.service.service_lines import (
    ServiceLine,
    line_poses,
    lines_free,
    service_lines,
    timed_service,
)
from ir_planner.service.service_movement import ServicePlan, plan_service
from ir_planner.service.withdrawals import (
    EXIT_SEARCHES,
    ExitPath,
    exit_searches,
    known_method,
    withdrawal,
)
from ir_planner.service.work_area import WorkArea
from ir_planner.service.work_configurations import ServiceRequest, checked_request

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
