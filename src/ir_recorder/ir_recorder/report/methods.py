"""Methods of the paper as figures: withdrawal, genetic correction, search for configurations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ir_description import Cell
from ir_msgs_py.search_log import ConfigurationLog, CorrectionLog, Counts, SearchLog, WithdrawalLog
from ir_recorder.analysis import Analysis
from ir_recorder.report.cell_outline import HEIGHT, WIDTH, View, drawing
from ir_recorder.report.number_text import percent, text
from ir_values.arrays import FloatArray

# Counted things as people read them.

_SHOWN = 3


def counted(number: int, one: str, several: str = "") -> str:
    """A number with its noun: "1 generation", "4 generations"."""
    return f"{number} {one if number == 1 else several or one + 's'}"


def were(number: int, what: str) -> str:
    """What became of so many: "1 was kept", "3 were kept"."""
    return f"{number} {'was' if number == 1 else 'were'} {what}"


def reasons(counts: Counts) -> str:
    """The most frequent reasons: "28 gear_held too near belt, 7 not converged, 4 for other
    reasons".
    """
    ordered = sorted(counts, key=lambda item: (-item[1], item[0]))
    shown = ordered if len(ordered) == _SHOWN + 1 else ordered[:_SHOWN]
    parts = [f"{count} {reason}" for reason, count in shown]
    left = sum(count for _, count in ordered[len(shown) :])
    return ", ".join([*parts, *([f"{left} for other reasons"] if left else [])])


# A search for configurations: where the tool went from every random start, and what ended it.


def configuration_sentence(log: ConfigurationLog) -> str:
    """What was done at the station."""
    rejected = sum(count for _, count in log.rejected)
    said = (
        f"Configurations at {log.station} by cyclic coordinate descent, eqs. (1) to (6): of "
        f"{counted(log.starts, 'random start')} {were(log.accepted, 'accepted')}, {log.distinct} "
        f"of them distinct; {were(rejected, 'rejected')}"
    )
    return f"{said}: {reasons(log.rejected)}." if rejected else f"{said}."


def configuration_figure(log: ConfigurationLog, cell: Cell, number: int) -> str:
    """The cell from the side with the tool's places from sweep to sweep; "" where there is none to
    show.
    """
    station = next((each for each in cell.stations if each.name == log.station), None)
    if station is None or not log.tracks:
        return ""
    places = np.vstack([track.points for track in log.tracks])
    view = View.from_the_side(places, station.pose[:3, 3], 0.1)
    ordered = sorted(log.tracks, key=lambda track: track.outcome == "")
    lines = (
        view.line(track.points, "tried" if track.outcome else "accepted")
        + (
            view.crosses(track.points[:: max(len(track.points) - 1, 1)], "dropped", 2.6)
            if track.outcome
            else view.dots(track.points[:1], "kept", 2.6)
        )
        for track in ordered
    )
    content = (
        view.machines(cell, log.station),
        *lines,
        view.dots(station.pose[None, :3, 3], "place", 4.5),
        view.names(cell),
        view.scale_bar("from the side"),
    )
    label = (
        f"Search for configurations at {log.station}: {log.accepted} of {log.starts} starts "
        "accepted"
    )
    return drawing(content, label, f"configurations_{number}")


# A genetic correction: the straight movement, the parts of it that collided, and what became of
# it.

# width and height of the chart; to the edges of the drawing
_CHART = (222.0, 92.0)
_GAP = 10.0


def correction_sentence(log: CorrectionLog) -> str:
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


def correction_figure(log: CorrectionLog, cell: Cell, number: int) -> str:
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
    left, top = corner
    width, height = _CHART
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


# A withdrawal: what eq. (7) kept, what it dropped, and the path that was left.

_LEAST = 0.05  # m: a path that goes less far sideways is seen across the direction to the robot
_DEPTH = 0.12  # m: bodies farther from the plane of the drawing are outlines
_ENTERING = "Entering is the same path reversed."


def withdrawal_sentence(log: WithdrawalLog) -> str:
    """What was done at the station."""
    if not log.generations:
        return f"Leaving {log.station}: {_why(log)}two trees found the path out. {_ENTERING}"
    kept = len(log.kept) - 1
    dropped = max(log.candidates - kept, 0)
    why = f" ({reasons(log.rejected)})" if log.rejected else ""
    return (
        f"Leaving {log.station} by eq. (7): {_why(log)}{counted(log.generations, 'generation')} "
        f"drew {counted(log.candidates, 'configuration')} around those before; "
        f"{were(kept, 'kept')}, {dropped} dropped{why}. The total metric distance D to the "
        f"machine grew from {log.distance[0]:.1f} m to {log.distance[1]:.1f} m, and the best "
        f"path out was shortened. {_ENTERING}"
    )


def _why(log: WithdrawalLog) -> str:
    """Why it isn't the straight line; "" for recordings that don't say."""
    if log.blocked:
        reason = log.blocked.removeprefix(f"line out of {log.station}: ")
        return f"the straight line back along the tool is not free ({reason}); "
    return (
        "the cell asks for it, though the straight line back along the tool is free; "
        if log.asked
        else ""
    )


def withdrawal_figure(log: WithdrawalLog, cell: Cell, number: int) -> str:
    """The machine from the side with all of the search; "" for a station that the cell hasn't."""
    station = next((each for each in cell.stations if each.name == log.station), None)
    if station is None or len(log.path) < 2:
        return ""
    view = View.from_the_side(
        log.path, _sideways(log, station.pose[:3, 3] - cell.base_pose[:3, 3]), 0.4
    )
    child = log.kept[1:]
    parent = log.kept[log.parents[1:]]
    content = (
        view.held(cell, log.load, station.pose),
        view.machines(cell, log.station, log.path[0], _DEPTH),
        view.segments(parent, child, "tried"),
        view.crosses(log.dropped, "dropped", 1.8),
        view.dots(child, "kept", 2.2),
        view.line(log.path, "path"),
        view.dots(log.path[:1], "place", 4.5),
        view.names(cell, only=station.equipment),
        view.scale_bar("from the side"),
    )
    label = (
        f"Withdrawal from {log.station}, seen from the side: {len(log.kept)} kept configurations"
    )
    return drawing(content, label, f"withdrawal_{number}")


def _sideways(log: WithdrawalLog, radial: FloatArray) -> FloatArray:
    """The horizontal direction (3,) in which the path goes farthest, away from the robot; `radial`
    (3,): from the robot to the station.
    """
    away = (log.path - log.path[0]) * [1.0, 1.0, 0.0]
    reach = np.linalg.norm(away, axis=1)
    farthest: FloatArray = away[int(np.argmax(reach))] if reach.max() > _LEAST else radial
    return farthest if farthest @ radial >= 0.0 else -farthest


# The section of the page: one figure for each search, with its sentence; equal ones are
# counted.

_MOST = 24  # figures
_KEY = (
    '<p class="hint">Black: the path that was found. Blue: what is driven, optimised from there. '
    "Dashed: the straight movement. Green dots: kept or accepted. Red crosses: dropped or "
    "rejected; a thick red line collides. Grey: bodies of the machines, those that are not near "
    "the drawn plane as outlines. Paths are those of the tool centre point.</p>"
)


def methods_section(analysis: Analysis) -> str:
    """What the paper's methods did for the recorded program; "" where none was asked for."""
    logs = analysis.recording.searches
    cell = analysis.cell
    alike: dict[str, list[SearchLog]] = {}
    for log in logs:
        alike.setdefault(_sentence(log), []).append(log)
    figures = "".join(_figures(list(alike.items())[:_MOST], cell))
    if not figures:
        return ""
    if len(alike) > _MOST:
        figures += f'<p class="hint">{_MOST} of {len(alike)} are shown.</p>'
    head = "<h2>What the paper's methods did</h2>"
    return f'<section id="methods">{head}{_KEY}<div class="methods">{figures}</div></section>'


def _figures(alike: Sequence[tuple[str, Sequence[SearchLog]]], cell: Cell | None) -> Iterator[str]:
    for number, (sentence, logs) in enumerate(alike):
        drawn = _picture(logs[0], cell, number) if cell else ""
        words = f"{sentence} {_times(logs)}".rstrip()
        yield f"<figure>{drawn}<figcaption>{text(words)}</figcaption></figure>"


def _times(logs: Sequence[SearchLog]) -> str:
    """How often it was the same; "" for once."""
    if len(logs) == 1:
        return ""
    what = {WithdrawalLog: "visits", ConfigurationLog: "programs", CorrectionLog: "movements"}
    return f"This holds for {len(logs)} {what[type(logs[0])]}."


def _sentence(log: SearchLog) -> str:
    if isinstance(log, WithdrawalLog):
        return withdrawal_sentence(log)
    return (
        configuration_sentence(log)
        if isinstance(log, ConfigurationLog)
        else correction_sentence(log)
    )


def _picture(log: SearchLog, cell: Cell, number: int) -> str:
    if isinstance(log, WithdrawalLog):
        return withdrawal_figure(log, cell, number)
    if isinstance(log, ConfigurationLog):
        return configuration_figure(log, cell, number)
    return correction_figure(log, cell, number)
