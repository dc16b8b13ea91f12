"""A genetic correction: the straight movement, the parts of it that collided, and what became of
it.
"""

from __future__ import annotations

import math

import numpy as np

from ir_description import Cell
from ir_msgs_py.search_log import CorrectionLog
from ir_recorder.report.methods.view import HEIGHT, WIDTH, View, drawing
from ir_recorder.report.methods.words import counted
from ir_recorder.report.words import percent

# width and height of the chart; to the edges of the drawing
_CHART = (222.0, 92.0)
_GAP = 10.0


def sentence(log: CorrectionLog) -> str:
    """What was done on the movement."""
    before, after = log.costs
    where = f"From {log.start or 'the start'} to {log.goal}" if log.goal else "A movement"
    if not log.generations:
        return (
            f"{where}: the straight movement of least W (eq. 9) is free, nothing had to be "
            "corrected."
        )
    met = f" ({log.met})" if log.met else ""
    more = percent(after / before - 1.0) if before > 0.0 else "0.00 %"
    return (
        f"{where}: the straight movement of least W (eq. 9) collides{met}. The genetic "
        f"correction replaced what collides by {counted(log.generations, 'generation')} for "
        f"{counted(len(log.fitness), 'stretch', 'stretches')}. W of the cheapest corrected path "
        f"changed by {more}; the movement that is driven was optimised from such paths, and is "
        "certified."
    )


def picture(log: CorrectionLog, cell: Cell, number: int) -> str:
    """The movement from where the correction is seen best, and the fitness over the generations."""
    if len(log.path) < 2 or len(log.straight) < 2:
        return ""
    view, seen = _best_view(log)
    content = (
        view.machines(cell, ""),
        view.line(log.straight, "straight"),
        *(view.line(stretch, "collides") for stretch in log.stretches),
        view.line(log.path, "path"),
        view.line(log.driven, "driven"),
        view.dots(log.path[[0, -1]], "place", 4.0),
        view.names(cell),
        view.scale_bar(seen),
        _fitness(log, _emptiest(view, log)),
    )
    label = (
        f"Genetic correction from {log.start} to {log.goal}: straight movement and corrected path"
    )
    return drawing(content, label, f"correction_{number}")


def _best_view(log: CorrectionLog) -> tuple[View, str]:
    """From above, or from the side, whichever shows more of the difference; and which it is."""
    points = np.vstack([log.straight, log.path, log.driven])
    x, y = np.eye(3)[:2]
    along = log.straight[-1] - log.straight[0]
    views = (
        (View.of(points, x, y, 0.35), "from above"),
        (View.from_the_side(points, along, 0.35), "from the side"),
    )
    middle = [path[len(path) // 2] for path in (log.straight, log.path)]

    def apart(view: View) -> float:
        first, second = view.flat(np.array(middle))
        return float(np.linalg.norm(first - second))

    return max(views, key=lambda pair: apart(pair[0]))


def _emptiest(view: View, log: CorrectionLog) -> tuple[float, float]:
    """The corner (left, top) where a chart hides least of the paths; the scale bar has one of the
    four.
    """
    flat = view.flat(np.vstack([log.straight, log.path, log.driven]))
    right = WIDTH - _GAP - _CHART[0]
    bottom = HEIGHT - _GAP - _CHART[1]

    def hidden(corner: tuple[float, float]) -> int:
        return int(((flat >= corner) & (flat <= np.add(corner, _CHART))).all(axis=1).sum())

    return min(((right, _GAP), (_GAP, _GAP), (right, bottom)), key=hidden)


def _fitness(log: CorrectionLog, corner: tuple[float, float]) -> str:
    """The best fitness of every generation on a logarithmic axis, one line for each stretch, in a
    chart with its left top at `corner`.
    """
    values = [value for each in log.fitness for value in each if value > 0.0]
    if len(values) < 2:
        return ""
    (left, top), (width, height) = corner, _CHART
    low = math.log(min(values))
    high = math.log(max(values))
    longest = max(len(each) for each in log.fitness)

    def at(k: int, value: float) -> str:
        share = (math.log(max(value, min(values))) - low) / ((high - low) or 1.0)
        x = left + 8.0 + (width - 16.0) * k / max(longest - 1, 1)
        return f"{x:.1f},{top + 30.0 + (height - 60.0) * (1.0 - share):.1f}"

    lines = "".join(
        f'<polyline class="fit" points="{" ".join(at(k, value) for k, value in enumerate(each))}"/>'
        for each in log.fitness
    )
    frame = (
        f'<rect class="chart" x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}" '
        'rx="5"/>'
    )
    head = f'<text x="{left + 8:g}" y="{top + 20:g}">best fitness, straight: 1</text>'
    ends = f"{max(values):.2f} to {min(values):.2f} in {counted(longest, 'generation')}"
    foot = f'<text class="small" x="{left + 8:g}" y="{top + height - 8:g}">{ends}</text>'
    return frame + head + lines + foot
