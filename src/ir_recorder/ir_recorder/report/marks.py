"""How named curves and points of one drawing differ: by a colour, a mark, and beyond seven by a
dash too.

The colours are those of Okabe and Ito, which the colour-blind distinguish; axes.js draws curves
with them.
"""

from __future__ import annotations

COLOURS = 7
MARKS = (
    "M-4 0A4 4 0 1 0 4 0A4 4 0 1 0 -4 0Z",
    "M-3.6 -3.6H3.6V3.6H-3.6Z",
    "M0 -4.8L4.6 3.4H-4.6Z",
    "M0 -5.2L5.2 0L0 5.2L-5.2 0Z",
    "M0 4.8L4.6 -3.4H-4.6Z",
    "M-1.4 -4.6H1.4V-1.4H4.6V1.4H1.4V4.6H-1.4V1.4H-4.6V-1.4H-1.4Z",
    "M-5 -2H5V2H-5Z",
    "M-2 -5H2V5H-2Z",
)
"""SVG paths about the origin; as many as share no factor with the colours, so that 56 pairs
differ.
"""


def mark(index: int, x: float, y: float, inside: str) -> str:
    """The mark of a series at a place of a drawing, as SVG around what belongs to it."""
    path = MARKS[index % len(MARKS)]
    colour = index % COLOURS + 1
    place = f"translate({x:.1f} {y:.1f})"
    return f'<path class="s{colour}" transform="{place}" d="{path}">{inside}</path>'
