"""A robot that tends machines: its parts as a table, and for each a Gantt chart of robot, power
modes, machines and power at the mains.
"""

from __future__ import annotations

from collections.abc import Mapping

from ir_recorder.analysis import Analysis
from ir_recorder.analysis.tending import SHORT, PartRow, Span, Tending
from ir_recorder.reading.recording import PowerSeries
from ir_recorder.report.gantt import Bar, Gantt, legend, mode_bars
from ir_recorder.report.number_text import DASH, seconds, text, watt_hours
from ir_recorder.report.tables import table

_COUNTED = 1.0  # J


def tending_section(analysis: Analysis) -> str:
    """The section of a cell with a route of which parts were driven; "" for another."""
    tending = analysis.tending
    if tending is None:
        return ""
    charts = "".join(_figure(part, tending, analysis.recording.power) for part in tending.parts)
    return (
        '<section id="tending"><h2>Parts: what each took, and who waited for whom</h2>'
        f"{_rest(analysis, tending)}{_parts(tending)}{legend(_KINDS)}{charts}</section>"
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
        late = {f"{name}, late": value for name, value in part.late.items()}
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
    return "<br>".join(said) or DASH


_KINDS = {
    "loaded": "robot with a part, machine at work",
    "empty": "robot without, finished part that waits",
    "late": "robot waits for a late signal",
}


def _figure(part: PartRow, tending: Tending, power: PowerSeries | None) -> str:
    chart = Gantt(part.span)
    chart.lane("robot", _robot(part, tending))
    if power is not None:
        chart.lane("mode", mode_bars(power, part.span))
    for machine in tending.machines:
        bars = [("loaded", span, "at work") for span in machine.working]
        bars += [("empty", span, "finished, waits for the robot") for span in machine.finished]
        chart.lane(f"{machine.name} {machine.slot or ''}".strip(), bars)
    if power is not None and len(power.time) > 1:
        chart.power([power])
    said = f"part {part.number}: {seconds(part.span.seconds)}, {watt_hours(part.joules)}"
    return (
        f'<figure class="figure"><figcaption>{text(said)}</figcaption>'
        f"{chart.drawn(f'part_{part.number}', said)}</figure>"
    )


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
