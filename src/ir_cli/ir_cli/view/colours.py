"""Colours of the view, and of the tool's path by the power that is drawn there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ir_msgs_py.arrays import FloatArray

Colour = tuple[int, int, int]
KINDS: dict[str, Colour] = {
    "base": (70, 74, 80),
    "link": (235, 120, 40),
    "joint": (60, 64, 70),
    "tool": (120, 130, 140),
    "part": (40, 150, 140),
}
BODIES: tuple[Colour, ...] = (
    (150, 170, 190),
    (175, 165, 145),
    (150, 180, 155),
    (180, 155, 175),
    (165, 165, 165),
)
LYING: Colour = (40, 150, 140)
CAPSULE: Colour = (90, 140, 220)
HIGHLIGHT: Colour = (225, 30, 40)
ZONE: Colour = (200, 150, 30)
APPROACH: Colour = (60, 60, 200)
REACH: Colour = (120, 120, 120)
NEAR: Colour = (30, 150, 70)
TOO_NEAR: Colour = (225, 30, 40)
SCALE = np.array(
    [(48, 70, 170), (40, 150, 190), (60, 180, 90), (230, 200, 50), (220, 60, 40)], dtype=np.float64
)
"""From the least power to the most."""


def by_power(watts: FloatArray) -> NDArray[np.uint8]:
    """Colours (N, 3) of watts (N,), from the least of them to the most."""
    low = float(watts.min())
    high = float(watts.max())
    share = (watts - low) / max(high - low, 1e-9)
    steps = np.linspace(0.0, 1.0, len(SCALE))
    return np.stack([np.interp(share, steps, SCALE[:, k]) for k in range(3)], axis=1).astype(
        np.uint8
    )
