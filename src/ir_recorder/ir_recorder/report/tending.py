"""A robot that tends machines: its parts as a table, and for each a Gantt chart of robot, power
modes, machines and power at the mains.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from ir_recorder.analysis import Analysis
from ir_recorder.analysis.production import NO_MODE
from ir_recorder.analysis.tending import (
    SHORT,
    MachineTimes,
    PartRow,
    Span,
    Tending,
    planned_machines,
)
from ir_recorder.reading.recording import PowerSeries
from ir_recorder.report.gantt import Bar, Gantt, legend, mode_bars
from ir_recorder.report.number_text import DASH, mode_words, seconds, text, watt_hours
from ir_recorder.report.tables import table

_COUNTED = 1.0  # J


def tending_section(analysis: Analysis) -> str:
    """The section of a cell with a route of which parts were driven, or a cycle was planned; ""
    for another.
    """
    tending = analysis.tending
    if tending is None:
        return _planned(analysis)
    charts = "".join(_figure(part, tending, analysis.recording.power) for part in tending.parts)
    return (
        '<section id="tending"><h2>Parts: what each took, and who waited for whom</h2>'
        f"{_rest(analysis, tending)}{_parts(tending)}{legend(_KINDS)}{charts}</section>"
    )


def _planned(analysis: Analysis) -> str:
    """The cycle of a plan that nobody drove."""
    cell = analysis.cell
    steps = analysis.recording.planned
    if cell is None or cell.route is None or not analysis.recording.only_planned:
        return ""
    ends = np.cumsum([0.0, *(step.duration for step in steps)]).tolist()
    spans = [Span(begin, end) for begin, end in itertools.pairwise(ends)]
    robot: list[Bar] = []
    modes: list[Bar] = []
    for step, span in zip(steps, spans, strict=True):
        if not (step.is_pause and step.power_mode):
            style = "loaded" if "+" in step.load else "empty"
            robot.append((style, span, f"{step.kind} {step.to_station}"))
        mode = (step.power_mode or NO_MODE) if step.is_pause else "MOVING"
        modes.append((f"m-{mode}", span, mode_words(mode)))
    chart = Gantt(Span(0.0, ends[-1]))
    chart.lane("robot", robot)
    chart.lane("mode", modes)
    for machine in planned_machines(cell, steps):
        chart.lane(machine.name, _machine_bars(machine))
    said = f"a cycle of {seconds(ends[-1])}"
    return (
        '<section id="tending"><h2>Who works and who waits</h2>'
        f'{legend(_PLANNED)}<figure class="figure"><figcaption>{text(said)}</figcaption>'
        f"{chart.drawn('cycle', said)}</figure></section>"
    )


def _rest(analysis: Analysis, tending: Tending) -> str:
    """What the run took outside of the times of its parts; "" where that is nothing."""
    program = analysis.program
    parts = sum(part.joules for part in tending.parts)
    rest = program.whole.energy - parts if program is not None else 0.0
    if not rest >= _COUNTED:
        return ""
    said = (
        f"The parts took {watt_hours(parts)} together, the run {watt_hours(rest)} more outside of "
        "their times."
    )
    return f'<p class="hint">{text(said)}</p>'


def _parts(tending: Tending) -> str:
    figures = (">time", ">planned", ">energy", ">predicted")
    heads = ("part", *figures, "robot waited for", "part waited in")
    rows = []
    for part in tending.parts:
        name = f"{part.number}"
        if part.number <= tending.filling:
            name += " <small>fills the line</small>"
        late = {f"{machine} late": value for machine, value in part.late.items()}
        rows.append(
            (
                name,
                seconds(part.span.seconds),
                seconds(part.planned_seconds),
                f"<b>{watt_hours(part.joules)}</b>",
                watt_hours(part.planned_joules),
                _waits({**part.paused, **late}),
                _waits(part.finished),
            )
        )
    return table(heads, rows, "Parts")


def _waits(waits: Mapping[str, float]) -> str:
    said = [f"{text(name)} {seconds(value)}" for name, value in waits.items()]
    return ", ".join(said) or DASH


_PLANNED = {
    "loaded": "robot with a part, machine at work",
    "empty": "robot without, finished part that waits",
}
_KINDS = {**_PLANNED, "late": "robot waits for a late signal"}


def _figure(part: PartRow, tending: Tending, power: PowerSeries | None) -> str:
    chart = Gantt(part.span)
    chart.lane("robot", _robot(part, tending))
    if power is not None:
        chart.lane("mode", mode_bars(power, part.span))
    for machine in tending.machines:
        chart.lane(machine.label, _machine_bars(machine))
    if power is not None and len(power.time) > 1:
        chart.power([power])
    said = f"part {part.number}: {seconds(part.span.seconds)}, {watt_hours(part.joules)}"
    return (
        f'<figure class="figure"><figcaption>{text(said)}</figcaption>'
        f"{chart.drawn(f'part_{part.number}', said)}</figure>"
    )


def _machine_bars(machine: MachineTimes) -> list[Bar]:
    working: list[Bar] = [("loaded", span, "at work") for span in machine.working]
    waits = "finished, waits for the robot"
    return [*working, *(("empty", span, waits) for span in machine.finished)]


def _robot(part: PartRow, tending: Tending) -> list[Bar]:
    bars: list[Bar] = []
    carrying = False
    for step in tending.steps:
        movement = step.movement
        if step.start - step.begin > SHORT:
            bars.append(("late", Span(step.begin, step.start), "waits for a signal"))
        if not movement.since:
            style = "loaded" if carrying else "empty"
            words = f"{movement.kind} {movement.to_station}"
            bars.append((style, Span(step.start, step.end), words))
        carrying = bool(movement.attach) or (carrying and not movement.detach)
    return [bar for bar in bars if bar[1].within(part.span.begin, part.span.end) > 0.0]
