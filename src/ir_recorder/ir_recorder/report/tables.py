"""Tables of the page: movements, stations, modes, Table II, facts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ir_msgs_py.report import TrajectoryReport
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.agreement import Agreement
from ir_recorder.analysis.findings import row_name
from ir_recorder.analysis.results import Share, StepResult
from ir_recorder.report.words import (
    DASH,
    joules,
    millimetres,
    mode_words,
    percent,
    seconds,
    text,
    watts,
)

MOST_WARNINGS = 100  # a node that repeats itself must not fill the page
LONGEST_TEXT = 500  # characters of one warning


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], caption: str, kind: str = "") -> str:
    """A table; cells are HTML. A head that starts with ">" is a column of numbers.

    caption: for screen readers, and the name of the CSV file that the page writes of it.
    """
    columns = "".join(
        f'<th scope="col"{_number(head)}>{text(head.lstrip(">"))}</th>' for head in heads
    )
    body = "".join(f"<tr>{_cells(heads, row)}</tr>" for row in rows)
    if not body:
        return '<p class="empty">Nothing was recorded.</p>'
    head = f"<thead><tr>{columns}</tr></thead>"
    named = f'<caption class="unseen">{text(caption)}</caption>'
    return (
        '<div class="scroll"><table '
        f'class="{kind}">{named}{head}<tbody>{body}</tbody></table></div>'
    )


def step_table(analysis: Analysis) -> str:
    """Every step: predicted, with its 90 % interval, against simulated or measured."""
    found = f">{analysis.recording.origin}"
    heads = (
        "#",
        "step",
        "load",
        ">time",
        ">predicted",
        found,
        ">deviation",
        ">mean power",
        ">clearance",
    )
    rows = (_step(result) for result in analysis.steps)
    return table((*heads, ">tool deviation"), rows, "Steps of the program")


def _step(result: StepResult) -> tuple[str, ...]:
    step = result.step
    near = result.clearance
    plan = step.movement.report.energy
    label = f'<button class="go" data-time="{step.start:.3f}">{text(step.label)}</button>'
    if step.outcome != "ended":
        label += f' <b class="bad">{text(step.outcome)}</b>'
    return (
        str(step.index + 1),
        label,
        text(step.movement.load or DASH),
        f"{result.seconds:.2f} s",
        joules(plan) + _predicted(step.movement.report) if plan else DASH,
        joules(result.energy) + _small("from positions", joules(result.indirect_energy)),
        percent(result.energy / plan - 1.0) if plan else DASH,
        watts(result.mean_power) + _small("peak", watts(result.peak_power)),
        f"{millimetres(near.least)}<small>{text(near.least_pair)}</small>" if near else DASH,
        millimetres(result.tool_deviation),
    )


def _predicted(report: TrajectoryReport) -> str:
    """The interval of what was predicted, where the recording has one."""
    if report.energy_high <= 0.0:
        return ""
    return f"<small>{joules(report.energy_low)} to {joules(report.energy_high)}</small>"


def measurement_table(both: Agreement) -> str:
    """Every movement by the meter, from positions, from torques and by Pinocchio."""
    rows = [
        (
            text(row.label),
            joules(row.direct),
            joules(row.indirect),
            percent(row.difference),
            joules(row.from_torques),
            joules(row.second_opinion) if math.isfinite(row.second_opinion) else "not available",
        )
        for row in both.movements
    ]
    heads = (
        "movement",
        ">meter",
        ">from positions",
        ">difference",
        ">from torques",
        ">by Pinocchio's torques",
    )
    return table(heads, rows, "Two measurements") + f"<p>{text(both.sentence)}.</p>"


def station_table(analysis: Analysis) -> str:
    """Time and energy of every station."""
    rows = [
        (
            text(use.station),
            *(_share(share) for share in (use.travel, use.service, use.rest)),
            f"{use.seconds:.1f} s",
            f"<b>{joules(use.energy)}</b>",
        )
        for use in analysis.stations
    ]
    other = analysis.elsewhere
    if math.isfinite(other.energy):
        rows.append(
            (text(other.name), DASH, DASH, DASH, f"{other.seconds:.1f} s", joules(other.energy))
        )
    heads = ("station", ">travel to it", ">service movements", ">pauses", ">time", ">energy")
    return table(heads, rows, "Stations")


def mode_table(analysis: Analysis) -> str:
    """Time and energy of every mode."""
    most = max((share.energy for share in analysis.modes), default=0.0)
    rows = [
        (
            f'<i class="key m-{text(share.name)}"></i>{text(mode_words(share.name))}',
            f"{share.seconds:.1f} s",
            joules(share.energy),
            watts(share.energy / share.seconds) if share.seconds else DASH,
            _bar(share.energy, most, f"m-{share.name}"),
        )
        for share in sorted(analysis.modes, key=lambda share: -share.energy)
    ]
    return table(("mode", ">time", ">energy", ">mean", ""), rows, "Power modes")


def resting_table(analysis: Analysis) -> str:
    """Power at rest beside the data; the paper's Table II where the load is the paper's."""
    rows = [
        (
            text(row_name(row)),
            watts(row.expected),
            f"{row.power:.2f} W",
            percent(row.error),
            watts(row.table_2),
            f"{row.seconds:.1f} s",
        )
        for row in analysis.plateaus
    ]
    found = f">{analysis.recording.origin}"
    heads = (
        "mode and load at machine home",
        ">by the data",
        found,
        ">deviation",
        ">Table II",
        ">over",
    )
    return table(heads, rows, "Power at rest")


def fact_table(analysis: Analysis) -> str:
    """Facts and topics of the file."""
    facts = table(
        ("fact", "value"), ((text(k), text(v)) for k, v in analysis.recording.facts), "Facts"
    )
    topics = table(
        ("topic", "type", ">messages", ">per second"),
        (
            (
                text(t.name),
                text(t.type),
                str(t.count),
                f"{t.count / max(analysis.recording.duration, 1e-9):.1f}",
            )
            for t in sorted(analysis.recording.topics, key=lambda topic: topic.name)
        ),
        "Topics",
    )
    return facts + topics


def warning_table(analysis: Analysis) -> str:
    """Warnings and errors of the nodes' logs, the first MOST_WARNINGS of them."""
    warnings = analysis.recording.warnings
    if not warnings:
        return '<p class="empty">None.</p>'
    rows = [
        (f"{w.time:.2f} s", text(w.name), text(w.text[:LONGEST_TEXT]))
        for w in warnings[:MOST_WARNINGS]
    ]
    more = len(warnings) - MOST_WARNINGS
    left = f'<p class="empty">{more} more in the recording.</p>' if more > 0 else ""
    return table((">time", "node", "text"), rows, "Warnings in the log") + left


def problem_list(problems: Sequence[str]) -> str:
    """What couldn't be planned, read or computed."""
    if not problems:
        return ""
    items = "".join(f"<li>{text(problem)}</li>" for problem in problems)
    return f'<div class="problems"><b>What is missing, and why</b><ul>{items}</ul></div>'


def _cells(heads: Sequence[str], row: Sequence[str]) -> str:
    return "".join(f"<td{_number(head)}>{cell}</td>" for head, cell in zip(heads, row, strict=True))


def _small(name: str, value: str) -> str:
    return "" if value == DASH else f"<small>{name} {value}</small>"


def _share(share: Share) -> str:
    return (
        f"{joules(share.energy)}<small>{seconds(share.seconds)}</small>" if share.seconds else DASH
    )


def _bar(value: float, most: float, kind: str) -> str:
    width = 100.0 * max(value, 0.0) / most if most > 0.0 else 0.0
    return f'<span class="bar {text(kind)}" style="width:{width:.1f}%"></span>'


def _number(head: str) -> str:
    return ' class="n"' if head.startswith(">") else ""
