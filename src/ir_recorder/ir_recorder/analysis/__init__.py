"""Offline analysis of a recording, without ROS."""

from ir_recorder.analysis.analyse import analyse
from ir_recorder.analysis.checks import Finding, Tolerances, Verdict, findings, summary
from ir_recorder.analysis.results import (
    Analysis,
    ProgramTotals,
    Share,
    StationUse,
    StepResult,
    Unshortened,
)

__all__ = [
    "Analysis",
    "Finding",
    "ProgramTotals",
    "Share",
    "StationUse",
    "StepResult",
    "Tolerances",
    "Unshortened",
    "Verdict",
    "analyse",
    "findings",
    "summary",
]
