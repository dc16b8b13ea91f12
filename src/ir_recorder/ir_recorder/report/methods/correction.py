"""A genetic correction: the straight movement, the parts of it that collided, and what became of it."""

from __future__ import annotations

import math

import numpy as np

from ir_description import Cell
from ir_msgs_py.search_log import CorrectionLog
from ir_recorder.report.methods.view import HEIGHT, WIDTH, View, drawing
from ir_recorder.report.words import percent

_CHART = (WIDTH - 176.0, 14.0, 162.0, 92.0)  # left, top, width, height


def sentence(log: CorrectionLog) -> str:
    """What was done on the movement."""
    before, after = log.costs
    where = f"From {log.start or 'the start'} to {log.goal}" if log.goal else "A movement"
    if not log.stretches:
        return f"{where}: the straight movement of least W (eq. 9) is free, nothing had to be corrected."
    parts = "one population" if len(log.fitness) == 1 else f"{len(log.fitness)} populations"
    more = percent(after / before - 1.0) if before > 0.0 else ""
    return (
        f"{where}: the straight movement of least W (eq. 9) collides. The genetic correction replaced what "
        f"collides by {log.generations} generations in {parts}; W of the path changed by {more}. The "
        "movement that was made of it is certified."
    )


def picture(log: CorrectionLog, cell: Cell, number: int) -> str:
    """The movement from where the correction is seen best, and the fitness over the generations."""
    if len(log.path) < 2 or len(log.straight) < 2:
        return ""
    view = _best_view(log)
    content = (
        view.machines(cell, ""),
        view.line(log.straight, "straight"),
        *(view.line(stretch, "collides") for stretch in log.stretches),
        view.line(log.path, "path"),
        view.dots(log.path[[0, -1]], "place", 4.0),
        view.names(cell),
        _fitness(log),
    )
    label = f"Genetic correction from {log.start} to {log.goal}: straight movement and corrected path"
    return drawing(content, label, f"correction_{number}")


def _best_view(log: CorrectionLog) -> View:
    """From above, or from the side, whichever shows more of the difference."""
    points = np.vstack([log.straight, log.path])
    x, y = np.eye(3)[:2]
    along = log.straight[-1] - log.straight[0]
    views = (View.of(points, x, y, 0.35), View.from_the_side(points, along, 0.35))
    middle = [path[len(path) // 2] for path in (log.straight, log.path)]

    def apart(view: View) -> float:
        first, second = view.flat(np.array(middle))
        return float(np.linalg.norm(first - second))

    return max(views, key=apart)


def _fitness(log: CorrectionLog) -> str:
    """The best fitness of every generation on a logarithmic axis, one line for each part."""
    values = [value for each in log.fitness for value in each if value > 0.0]
    if len(values) < 2:
        return ""
    left, top, width, height = _CHART
    low, high = math.log(min(values)), math.log(max(values))
    longest = max(len(each) for each in log.fitness)

    def at(k: int, value: float) -> str:
        share = (math.log(max(value, min(values))) - low) / ((high - low) or 1.0)
        x = left + 8.0 + (width - 16.0) * k / max(longest - 1, 1)
        return f"{x:.1f},{top + 26.0 + (height - 44.0) * (1.0 - share):.1f}"

    lines = "".join(
        f'<polyline class="fit" points="{" ".join(at(k, value) for k, value in enumerate(each))}"/>'
        for each in log.fitness
    )
    frame = f'<rect class="chart" x="{left:g}" y="{top:g}" width="{width:g}" height="{height:g}" rx="5"/>'
    head = f'<text x="{left + 8:g}" y="{top + 16:g}">best fitness</text>'
    ends = f"{max(values):.2f} to {min(values):.2f}, {longest} generations"
    foot = f'<text class="small" x="{left + 8:g}" y="{top + height - 6:g}">{ends}</text>'
    return frame + head + lines + foot if top + height < HEIGHT else ""
