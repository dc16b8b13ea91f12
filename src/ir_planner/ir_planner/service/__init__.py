"""Service movements: straight lines at a station, and the withdrawal from a machine (eq. 7)."""

from ir_planner.service.candidate_shapes import service_shapes
from ir_planner.service.service_lines import ServiceLine, lines_free, service_lines, timed_service
from ir_planner.service.service_movement import ServicePlan, ServiceRequest, checked_request, plan_service
from ir_planner.service.settings import WithdrawalSettings
from ir_planner.service.withdrawal_paths import Exit, known_method, ways_out
from ir_planner.service.work_area import WorkArea

__all__ = [
    "Exit",
    "ServiceLine",
    "ServicePlan",
    "ServiceRequest",
    "WithdrawalSettings",
    "WorkArea",
    "checked_request",
    "known_method",
    "lines_free",
    "plan_service",
    "service_lines",
    "service_shapes",
    "timed_service",
    "ways_out",
]
