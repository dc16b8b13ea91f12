"""Which motions of a program are its process: what the tool does between switching an output on and
off.
"""

from collections.abc import Sequence

from ir_krl import Command, Motion, SetOutput, SplineBlock


def process_motions(commands: Sequence[Command]) -> frozenset[int]:
    """Places in `commands` of the motions of a process.

    A process begins where an output is switched on and ends where the same one is switched off, and
    only the tool is led meanwhile (LIN, CIRC, SPLINE and their relatives; waits don't matter). A
    PTP ends it: what is switched around one is a gripper or a message. A pulse switches nothing.
    """
    found: set[int] = set()
    since: dict[int, set[int]] = {}  # by output: motions since it was switched on
    for k, command in enumerate(commands):
        match command:
            case SetOutput(value=True, pulse=0.0):
                since.setdefault(command.number, set())
            case SetOutput(value=False):
                found |= since.pop(command.number, set())
            case Motion(kind="ptp") | SplineBlock(axis=True):
                since.clear()
            case Motion() | SplineBlock():
                for motions in since.values():
                    motions.add(k)
    return frozenset(found)
