"""Offline analysis of a recording, without ROS."""

from ir_recorder.analysis.analyse import analyse
from ir_recorder.analysis.findings import Finding, Tolerances, findings
from ir_recorder.analysis.results import Analysis, Share, StationUse, StepResult

__all__ = ["Analysis", "Finding", "Share", "StationUse", "StepResult", "Tolerances", "analyse", "findings"]
