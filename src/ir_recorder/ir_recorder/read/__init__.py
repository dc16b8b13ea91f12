"""Recordings read without ROS: raw channels, columns of CDR messages, typed series on one time
axis.
"""

from ir_recorder.read.cdr import Columns
from ir_recorder.read.raw import RawChannel, RawRecording, read_raw
from ir_recorder.read.reader import read_recording
from ir_recorder.read.recording import Recording

__all__ = ["Columns", "RawChannel", "RawRecording", "Recording", "read_raw", "read_recording"]
