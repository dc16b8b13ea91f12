"""Offline analysis of a recording, without ROS."""

from ir_recorder.analysis.analyse import analyse
from ir_recorder.analysis.checks import Finding, Tolerances, Verdict, findings, summary
from ir_recorder.analysis.results import Analysis, ProgramTotals, Share, StepResult

__all__ = [
    "Analysis",
    "Finding",
    "ProgramTotals",
    "Share",
    "StepResult",
    "Tolerances",
    "Verdict",
    "analyse",
    "findings",
    "summary",
]
