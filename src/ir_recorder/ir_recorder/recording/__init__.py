"""Recordings being written, without ROS: the file, and the session that fills it."""

from ir_recorder.recording.cell_files import CellFiles
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingWriter

__all__ = [
    "CellFiles",
    "RecordingSession",
    "RecordingWriter",
]
