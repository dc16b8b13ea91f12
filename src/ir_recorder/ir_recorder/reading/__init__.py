"""Recordings read without ROS: raw channels, columns of CDR messages, typed series on one time
axis.
"""

from ir_recorder.reading.cdr import Columns
from ir_recorder.reading.mcap_file import RawChannel, RawRecording, read_raw
from ir_recorder.reading.reader import read_recording
from ir_recorder.reading.recording import Recording

__all__ = ["Columns", "RawChannel", "RawRecording", "Recording", "read_raw", "read_recording"]
