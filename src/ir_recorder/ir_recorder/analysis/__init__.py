"""Offline analysis of a recording, without ROS."""

from ir_recorder.analysis.analyse import analyse
from ir_recorder.analysis.finding import Finding, Verdict, summary
from ir_recorder.analysis.findings import findings
from ir_recorder.analysis.results import (
    Analysis,
    ProgramTotals,
    Share,
    StationUse,
    StepResult,
    Unshortened,
)
from ir_recorder.analysis.tolerances import Tolerances

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
