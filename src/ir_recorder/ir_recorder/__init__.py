"""Recordings of the cell: written by a node, read and explained without ROS."""

from ir_recorder.analysis import Analysis, Finding, Tolerances, Verdict, analyse, findings, summary
from ir_recorder.errors import ReadError, RecorderError, SchemaError, WriteError
from ir_recorder.reading.reader import read_recording
from ir_recorder.reading.recording import Recording

__all__ = [
    "Analysis",
    "Finding",
    "ReadError",
    "RecorderError",
    "Recording",
    "SchemaError",
    "Tolerances",
    "Verdict",
    "WriteError",
    "analyse",
    "findings",
    "read_recording",
    "summary",
]
