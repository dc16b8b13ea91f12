"""Recordings being written, without ROS: the file, and the session that fills it."""

from ir_recorder.recording.session import CellFiles, RecordingSession, files_of_cell
from ir_recorder.recording.writer import RecordingSummary, RecordingWriter

__all__ = ["CellFiles", "RecordingSession", "RecordingSummary", "RecordingWriter", "files_of_cell"]
