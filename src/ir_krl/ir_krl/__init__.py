"""KUKA Robot Language: programs read and followed statement by statement, and written.

    sources = [parse(text, "old.src")]
    program = follow(sources, home, tool)      # motions, waits, outputs, in their order

What the motions mean for a robot among machines is `ir_planner.krl`'s.
"""

from ir_krl.errors import KrlError, KrlMotionError, KrlRunError, KrlSyntaxError, Place
from ir_krl.language import Source, parse
from ir_krl.run import (
    FRAME_NAMES,
    Blend,
    Command,
    Followed,
    Motion,
    Note,
    Payload,
    SetOutput,
    SignalRange,
    Speeds,
    SplineBlock,
    Target,
    TimeBlock,
    Wait,
    WaitFor,
    follow,
)
from ir_krl.write import (
    NAME_MAX,
    Attached,
    Part,
    WrittenPath,
    WrittenPause,
    WrittenSignals,
    WrittenSpline,
    check_name,
    written,
)

__all__ = [
    "FRAME_NAMES",
    "NAME_MAX",
    "Attached",
    "Blend",
    "Command",
    "Followed",
    "KrlError",
    "KrlMotionError",
    "KrlRunError",
    "KrlSyntaxError",
    "Motion",
    "Note",
    "Part",
    "Payload",
    "Place",
    "SetOutput",
    "SignalRange",
    "Source",
    "Speeds",
    "SplineBlock",
    "Target",
    "TimeBlock",
    "Wait",
    "WaitFor",
    "WrittenPath",
    "WrittenPause",
    "WrittenSignals",
    "WrittenSpline",
    "check_name",
    "follow",
    "parse",
    "written",
]
