"""Data of the page's scripts, as one JSON text."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np

from ir_description import Cell
from ir_msgs_py.savings import Side
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.clearance import StepClearance
from ir_recorder.analysis.results import mode_name
from ir_recorder.analysis.steps import ExecutedStep
from ir_recorder.reading.recording import BitSeries
from ir_recorder.report.motion_scene import (
    blamed,
    failed_scene,
    lanes,
    planned_scene,
    planned_side,
    rests_of,
    scene,
)
from ir_recorder.report.number_text import mode_words
from ir_recorder.report.series import (
    Json,
    Span,
    axis_curves,
    envelope,
    floats,
    long_rests,
    machine_lanes,
)
from ir_values.arrays import FloatArray

MOST_POINTS = 24_000  # of the power curve: 4 minutes as they were read
_BITS = {
    "ab": "bus off",
    "hib": "hibernate",
    "bbs": "ready",
    "drives_ready": "drives ready",
    "emergency_stop": "stop",
}
MOST_CLEARANCES = 6_000  # per movement: 2 minutes at the 50 Hz of the profile


def page_data(analysis: Analysis, safety_distance: float) -> str:
    """Safe inside a script element."""
    content = page_content(analysis, safety_distance)
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def page_content(analysis: Analysis, safety_distance: float) -> dict[str, Json]:
    """What the charts and the picture in 3D show of a recording, or of its plan."""
    return {
        "end": _last(analysis),
        "shown": _shown(analysis),
        "power": _power(analysis),
        "lanes": list(_lanes(analysis)),
        "clearance": [
            _clearance(result.step.label, result.clearance)
            for result in analysis.steps
            if result.clearance is not None
        ],
        "safetyDistance": safety_distance,
        "axes": axis_curves(analysis),
        "rests": long_rests([_rests(analysis)]),
        "scene": scene(analysis),
        "peak": _number(analysis.peak_power),
        "blamed": [] if analysis.cell is None else blamed(analysis.cell, analysis.problems),
        **_planned(analysis),
    }


def _last(analysis: Analysis) -> float:
    """When there is nothing more to see [s]: a recording lasts until its file is closed."""
    recording = analysis.recording
    ends = [result.step.end for result in analysis.steps[-1:]]
    ends += [
        s.time[-1] for s in (recording.power, recording.joints) if s is not None and len(s.time)
    ]
    return min(float(max(ends, default=recording.duration)) + _AFTER, recording.duration)


def _shown(analysis: Analysis) -> list[Json] | None:
    """The part of the time that charts show first [s]: the program, where one was driven."""
    if not analysis.steps:
        return None
    begin = analysis.steps[0].step.start
    end = analysis.steps[-1].step.end
    around = _AROUND * (end - begin)
    return [max(begin - around, 0.0), min(end + around, _last(analysis))]


_AFTER = 0.5  # s shown after the last reading
_AROUND = 0.02  # of the program's time, before and after it


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None


def _rests(analysis: Analysis) -> list[Span]:
    return [
        (result.step.start, result.step.end)
        for result in analysis.steps
        if result.step.movement.is_pause
    ]


def _planned(analysis: Analysis) -> dict[str, Json]:
    """What stands in place of a run where there is a plan alone, or none was found."""
    if not analysis.recording.never_driven or analysis.cell is None:
        return {}
    side = planned_side(analysis)
    if side is not None:
        return side_content(side, analysis.cell)
    if analysis.recording.planned:
        return {}  # the steps of a file, without their trajectories
    return {"end": 1.0, "scene": failed_scene(analysis.cell)}


def side_content(side: Side, cell: Cell) -> dict[str, Json]:
    """The same of a program that was not driven."""
    return {
        "end": side.report.duration,
        "power": _curve(side.time, side.watts),
        "lanes": lanes(side),
        "peak": max(step.report.peak_power for step in side.movements),
        "scene": planned_scene(side, cell),
        "rests": long_rests([rests_of(side)]),
    }


def _power(analysis: Analysis) -> dict[str, Json] | None:
    power = analysis.recording.power
    return None if power is None or len(power.time) < 2 else _curve(power.time, power.power)


def _curve(time: FloatArray, watts: FloatArray) -> dict[str, Json]:
    shape = envelope(time, watts, MOST_POINTS)
    return {"time": floats(shape.time), "low": floats(shape.low), "high": floats(shape.high)}


def _clearance(label: str, near: StepClearance) -> dict[str, Json]:
    kept = np.isfinite(near.distance)
    shape = envelope(near.time[kept], near.distance[kept], MOST_CLEARANCES)
    return {"time": floats(shape.time), "low": floats(shape.low), "label": label}


def _lanes(analysis: Analysis) -> Iterator[dict[str, Json]]:
    """Rows of spans [from, to, text, style] above the power curve."""
    recording = analysis.recording
    steps = [_step_span(result.step) for result in analysis.steps]
    if steps:
        yield {"label": "program", "spans": steps}
    if recording.power is not None and len(recording.power.time) > 1:
        yield {"label": "mode", "spans": list(_mode_spans(analysis))}
    if analysis.loads.observations:
        yield {"label": "load", "spans": list(_load_spans(analysis))}
    yield from machine_lanes(recording)
    for series, side, names in (
        (recording.plc_inputs, " ?", ("ab", "hib", "emergency_stop")),
        (recording.plc_outputs, "", ("bbs", "ab", "drives_ready")),
    ):
        if series is not None and len(series.time):
            for name in names:
                spans = list(_bit_spans(series, name, recording.duration))
                if spans:
                    yield {"label": f"{_BITS[name]}{side}", "spans": spans, "thin": True}


def _step_span(step: ExecutedStep) -> list[Json]:
    return [
        step.start,
        step.end,
        step.label,
        "pause" if step.movement.is_pause else step.movement.kind,
    ]


def _mode_spans(analysis: Analysis) -> Iterator[list[Json]]:
    power = analysis.recording.power
    if power is None:
        return
    change = np.flatnonzero(np.diff(power.mode)) + 1
    for first, last in zip([0, *change], [*change, len(power.mode)], strict=True):
        name = mode_name(int(power.mode[first]))
        start = power.time[first - 1] if first else power.time[0]
        yield [float(start), float(power.time[last - 1]), mode_words(name), f"m-{name}"]


def _load_spans(analysis: Analysis) -> Iterator[list[Json]]:
    observations = analysis.loads.observations
    start, current = observations[0]
    for time, load in [*observations[1:], (analysis.recording.duration, "")]:
        if load != current:
            yield [max(start, 0.0), time, current, "load" if current != "none" else "none"]
            start = time
            current = load


def _bit_spans(series: BitSeries, name: str, end: float) -> Iterator[list[Json]]:
    levels = series.levels[:, series.names.index(name)]
    times = np.append(series.time, end)
    since = None
    for k, level in enumerate(levels):
        if level and since is None:
            since = float(times[k])
        if not level and since is not None:
            yield [since, float(times[k]), "1", "bit"]
            since = None
    if since is not None:
        yield [since, float(end), "1", "bit"]
