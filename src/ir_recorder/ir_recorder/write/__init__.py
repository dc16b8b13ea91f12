"""Recordings being written, without ROS: the file, and the session that fills it."""

from ir_recorder.write.cell_files import files_of_cell
from ir_recorder.write.session import CellFiles, RecordingSession
from ir_recorder.write.writer import RecordingSummary, RecordingWriter

__all__ = ["CellFiles", "RecordingSession", "RecordingSummary", "RecordingWriter", "files_of_cell"]
