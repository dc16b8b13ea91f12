"""A program followed without a robot: values, control structures, and the commands that come
out.
"""

from ir_krl.run.commands import (
    AdvanceStop,
    Blend,
    Command,
    Motion,
    Payload,
    SetOutput,
    Speeds,
    SplineBlock,
    StandStill,
    Switch,
    Target,
    TimeBlock,
    WaitForCondition,
)
from ir_krl.run.notes import Effect, Note, worst_first
from ir_krl.run.program import Followed, UnknownRoutine, follow
from ir_krl.run.signals import SignalRange
from ir_krl.run.values import FRAME_NAMES, RAIL_NAME

__all__ = [
    "FRAME_NAMES",
    "RAIL_NAME",
    "AdvanceStop",
    "Blend",
    "Command",
    "Effect",
    "Followed",
    "Motion",
    "Note",
    "Payload",
    "SetOutput",
    "SignalRange",
    "Speeds",
    "SplineBlock",
    "StandStill",
    "Switch",
    "Target",
    "TimeBlock",
    "UnknownRoutine",
    "WaitForCondition",
    "follow",
    "worst_first",
]
