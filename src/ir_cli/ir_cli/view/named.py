"""Names of bodies and capsules in a sentence: what it blames can be shown."""

from __future__ import annotations

import re

from ir_description import Cell

_PROSE = "robot's base"
"""What sentences say that is no capsule, though one is called so."""
_WORD = re.compile(r"[A-Za-z][\w.-]*")


def names_in(sentence: str, cell: Cell) -> frozenset[str]:
    """Bodies and capsules of the cell that the sentence names."""
    bodies = {body.name for machine in cell.equipment for body in machine.bodies}
    parts = {body.name for part in cell.parts for body in part.bodies}
    held = {capsule.name for part in cell.parts for capsule in part.load.capsules}
    known = bodies | parts | held | {capsule.name for capsule in cell.capsules()}
    words = _WORD.findall(sentence.replace(_PROSE, ""))
    return frozenset(known.intersection(word.rstrip(".") for word in words))
