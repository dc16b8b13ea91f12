"""A program followed without a robot: values, control structures, and the commands that come
out.
"""

from ir_krl.run.commands import (
    Blend,
    Command,
    Motion,
    Payload,
    SetOutput,
    Speeds,
    SplineBlock,
    Target,
    TimeBlock,
    Wait,
    WaitFor,
)
from ir_krl.run.control import Note
from ir_krl.run.memory import SignalRange
from ir_krl.run.program import Followed, follow
from ir_krl.run.values import FRAME_NAMES

__all__ = [
    "FRAME_NAMES",
    "Blend",
    "Command",
    "Followed",
    "Motion",
    "Note",
    "Payload",
    "SetOutput",
    "SignalRange",
    "Speeds",
    "SplineBlock",
    "Target",
    "TimeBlock",
    "Wait",
    "WaitFor",
    "follow",
]
