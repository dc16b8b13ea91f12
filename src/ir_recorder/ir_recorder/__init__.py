"""Recordings of the cell: written by a node, read and explained without ROS."""

from ir_recorder.analysis import Analysis, Finding, Tolerances, Verdict, analyse, findings, summary
from ir_recorder.errors import RecorderError
from ir_recorder.reading.reader import read_recording

__all__ = [
    "Analysis",
    "Finding",
    "RecorderError",
    "Tolerances",
    "Verdict",
    "analyse",
    "findings",
    "read_recording",
    "summary",
]
