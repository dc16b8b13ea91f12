"""Figures of a program that was planned and not driven."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ir_msgs_py.report import PlannedMovement
from ir_recorder.analysis.results import Share

_PARTS = {"whole": (True, False), "movements": (False,), "pauses": (True,)}


def planned_share(steps: Sequence[PlannedMovement], part: str = "whole") -> Share | None:
    """Time and energy of the whole program, its movements or its pauses; None for no plan or
    another part.
    """
    if not steps or part not in _PARTS:
        return None
    own = [step for step in steps if step.is_pause in _PARTS[part]]
    return Share(part, sum(step.duration for step in own), sum(step.report.energy for step in own))


def planned_interval(steps: Sequence[PlannedMovement]) -> tuple[float, float] | None:
    """90 % interval of the whole energy [J], None where the plan has none."""
    low, high = (
        sum(getattr(step.report, name) for step in steps) for name in ("energy_low", "energy_high")
    )
    return (low, high) if high > low else None


def planned_clearance(steps: Sequence[PlannedMovement]) -> float:
    """The least clearance of the movements [m], NaN without any."""
    return min((step.report.min_clearance for step in steps if not step.is_pause), default=math.nan)
