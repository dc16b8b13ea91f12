"""Charge of the DC link's capacitors that a plan counted on, and that had gone when the robot
moved.

A program's plan carries what braking leaves to the next movement, less what holding the arm takes
in the planned time between. Nodes answer late where the machine is busy: by then more of it has
gone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from ir_description.robot import DcLink
from ir_recorder.analysis.meter import Meter
from ir_recorder.analysis.steps import ExecutedStep


def lost_charges(steps: Sequence[ExecutedStep], meter: Meter | None, link: DcLink) -> list[float]:
    """J for each step: in the capacitors when it should have begun, less those in them when it did.

    0 where it did not begin late, or where the bus voltage was not recorded.
    """
    lost: list[float] = []
    due = math.inf
    for step in steps:
        if not step.index:  # a program begins when it is asked to
            due = math.inf
        late = meter is not None and due < step.start
        gone = (
            meter.stored(due, link) - meter.stored(step.start, link)
            if meter is not None and late
            else 0.0
        )
        lost.append(gone if gone > 0.0 else 0.0)
        due = due + step.movement.duration if step.movement.is_pause else step.end
    return lost
