"""Numbers and frames as text."""

from __future__ import annotations

from ir_krl.errors import Place
from ir_krl.run.values import FRAME_NAMES, components, frame
from ir_msgs_py.arrays import FloatArray


def decimal(value: float, digits: int) -> str:
    """A number without the sign of a zero."""
    text = f"{value:.{digits}f}"
    return text if text.strip("-0.") else text.removeprefix("-")


def frame_text(transform: FloatArray, digits: int) -> str:
    """X to C [mm, deg] of a pose (4, 4) [m], without brackets."""
    fields = components(frame(transform), FRAME_NAMES, Place())
    return ",".join(f"{name} {decimal(value, digits)}" for name, value in fields.items())
