"""Recordings read without ROS: raw channels, columns of CDR messages, typed series on one time
axis.
"""

from ir_recorder.reading.reader import read_recording

__all__ = [
    "read_recording",
]
