"""KUKA Robot Language: programs read and followed statement by statement, and written.

    sources = [parse(text, "old.src")]
    program = follow(sources, home, tool)      # motions, waits, outputs, in their order

What the motions mean for a robot among machines is `ir_planner.krl`'s.
"""

from ir_krl.errors import KrlError, KrlMotionError, SourcePlace
from ir_krl.language import parse
from ir_krl.project import read_project
from ir_krl.run import Followed, Motion, follow

__all__ = [
    "Followed",
    "KrlError",
    "KrlMotionError",
    "Motion",
    "SourcePlace",
    "follow",
    "parse",
    "read_project",
]
