"""Programs in KUKA's language: as a KR C4 drives them in the cell, and written for it."""

from ir_planner.krl.execution import DrivenStep, Switched
from ir_planner.krl.export import DEVIATION_MAX, KrlExport
from ir_planner.krl.geometry import tool_in_flange
from ir_planner.krl.krl_costs import (
    EvaluatedProgram,
    EvaluatedStep,
    evaluate_krl,
    export_krl,
    follow_krl,
    follow_ur,
    numbers_asked,
    one_movement,
    posture_at,
    station_at,
)
from ir_planner.krl.splines import ToolMotion
from ir_planner.krl.surroundings import LOAD_NAME, is_named, whole_load

__all__ = [
    "DEVIATION_MAX",
    "LOAD_NAME",
    "DrivenStep",
    "EvaluatedProgram",
    "EvaluatedStep",
    "KrlExport",
    "Switched",
    "ToolMotion",
    "evaluate_krl",
    "export_krl",
    "follow_krl",
    "follow_ur",
    "is_named",
    "numbers_asked",
    "one_movement",
    "posture_at",
    "station_at",
    "tool_in_flange",
    "whole_load",
]
