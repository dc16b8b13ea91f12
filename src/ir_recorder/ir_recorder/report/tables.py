"""Tables of the page: movements, stations, modes, Table II, facts, checks and savings."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_msgs_py.savings import ProgramSavings, Saving
from ir_recorder.analysis import Analysis, Finding, Verdict
from ir_recorder.analysis.checks import row_name
from ir_recorder.analysis.indirect import Agreement
from ir_recorder.analysis.predicted_power import recorded_power_data
from ir_recorder.analysis.production import (
    OPEN,
    SLOWER,
    Production,
    deviation,
    production_of,
    saved_amount,
)
from ir_recorder.analysis.results import Share, StepResult
from ir_recorder.analysis.steps import step_label
from ir_recorder.format import contents
from ir_recorder.report.number_text import (
    DASH,
    interval,
    joules,
    millimetres,
    mode_words,
    modes_as_words,
    number,
    percent,
    seconds,
    text,
    watts,
)

# Tables of the page: movements, stations, modes, Table II, facts.

MOST_WARNINGS = 100  # a node that repeats itself must not fill the page
LONGEST_TEXT = 500  # characters of one warning


_NARROW = 2  # columns: a phone shows each row of wider tables as a card
COMPACT = "compact"
"""The kind of a wider table whose cells are short: it stays a table on a phone."""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], caption: str, kind: str = "") -> str:
    """A table; cells are HTML. A head that starts with ">" is a column of numbers.

    caption: for screen readers, and the name of the CSV file that the page writes of it.
    """
    columns = "".join(
        f'<th scope="col"{_number(head)}>{_words(head)}</th>' if head else "<td></td>"
        for head in heads
    )
    cells = [_cells(heads, row) for row in rows]
    body = "".join(f"<tr>{row}</tr>" for row in cells)
    if not body:
        return '<p class="empty">Nothing was recorded.</p>'
    head = f"<thead><tr>{columns}</tr></thead>"
    named = f'<caption class="unseen">{text(caption)}</caption>'
    wide = "cards" if len(heads) > _NARROW and kind != COMPACT else ""
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{text(caption)}"><table '
        f'class="{f"{kind} {wide}".strip()}">{named}{head}<tbody>{body}</tbody></table></div>'
    )


def _words(head: str) -> str:
    """A head, which may be broken where a long name has an underscore."""
    return text(head.lstrip(">")).replace("_", "_<wbr>")


def step_table(analysis: Analysis) -> str:
    """Every step: predicted, with its 90 % interval, against simulated or measured; of a plan that
    was not driven with its certificate.
    """
    if not analysis.steps and analysis.recording.planned:
        return _planned_table(analysis.recording.planned, production_of(analysis))
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


def _planned_table(steps: Sequence[PlannedMovement], cycle: Production | None) -> str:
    """The steps, and where the plan's money is of another time than theirs what lies between."""
    heads = (
        "#", "step", "load", ">time", ">predicted", ">mean power", ">clearance", "certificate"
    )  # fmt: skip
    rows: list[tuple[str, ...]] = [
        (
            str(place),
            text(modes_as_words(step_label(step))),
            text(step.load or DASH),
            seconds(step.duration),
            joules(step.report.energy) + _predicted(step.report),
            watts(step.report.energy / step.duration) if step.duration > 0.0 else DASH,
            DASH if step.is_pause else millimetres(step.report.min_clearance),
            _certificate(step),
        )
        for place, step in enumerate(steps, start=1)
        if step.duration > 0.0
    ]
    if cycle is not None and cycle.own is not None:
        more = (cycle.seconds - cycle.own.seconds, cycle.energy - cycle.own.energy)
        rows.append(_sum_row(SLOWER, *more))
        rows.append(_sum_row("cycle that the money is of", cycle.seconds, cycle.energy))
    return table(heads, rows, "Steps of the plan")


def _sum_row(name: str, time: float, energy: float) -> tuple[str, ...]:
    """A row below the steps."""
    shown = (seconds(time), f"<b>{joules(energy)}</b>")
    return (DASH, f"<b>{text(name)}</b>", DASH, *shown, DASH, DASH, DASH)


def _certificate(step: PlannedMovement) -> str:
    if step.is_pause:
        return DASH
    known = step.report.certified
    return '<b class="good">proved</b>' if known else '<b class="bad">not certified</b>'


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
        percent(deviation(result.energy, plan)),
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
            bar(share.energy, most, f"m-{share.name}"),
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
    data, _ = recorded_power_data(analysis.recording, analysis.cell)
    remark = ""
    if analysis.plateaus and analysis.cell is not None and data.has_table:
        home = analysis.cell.machine_home.tolist()
        masses = [row.payload for row in analysis.plateaus if math.isfinite(row.payload)]
        said = (data.rest_remark(home, mass) for mass in masses or [0.0])
        remark = f'<p class="hint">{text("; ".join(dict.fromkeys(said)))}.</p>'
    return f"{table(heads, rows, 'Power at rest')}{remark}"


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
    """Each cell with its head, which a narrow screen shows beside it; there what isn't known is
    left out.
    """
    return "".join(
        f'<td{_number(head, cell)} data-head="{text(head.lstrip(">"))}">{cell}</td>'
        for head, cell in zip(heads, row, strict=True)
    )


def _small(name: str, value: str) -> str:
    return "" if value == DASH else f"<small>{name} {value}</small>"


def _share(share: Share) -> str:
    return (
        f"{joules(share.energy)}<small>{seconds(share.seconds)}</small>" if share.seconds else DASH
    )


def bar(value: float, most: float, kind: str) -> str:
    """A bar of a table's row, of the colour `kind`."""
    width = 100.0 * max(value, 0.0) / most if most > 0.0 else 0.0
    return f'<span class="bar {text(kind)}" style="width:{width:.1f}%"></span>'


def _number(head: str, cell: str = "") -> str:
    kinds = [name for name, is_so in (("n", head.startswith(">")), ("no", cell == DASH)) if is_so]
    return f' class="{" ".join(kinds)}"' if kinds else ""


# Checks as tables: for each kind the one that is nearest to its bound, then the checks
# themselves.

_KIND = re.compile(
    r"energy of .* from joint states$|energy of |duration of |.*? (?=on \d)|power at rest|Table "
    r"II|goals of"
)
_ORDER = (Verdict.HOLDS, Verdict.FAILS, Verdict.NOT_CHECKED)
_STYLES = {Verdict.HOLDS: "good", Verdict.FAILS: "bad", Verdict.NOT_CHECKED: "open"}
_NAMES = {
    "energy of": "energy against the plan",
    "duration of": "duration against the plan",
    "goals of": "goals",
}


def check_table(findings: Sequence[Finding]) -> str:
    """All checks: by kind, then what fails and what was not checked, and what holds folded away."""
    shown = [f for f in findings if not f.ok]
    held = [f for f in findings if f.ok]
    rows = [_check(f) for f in sorted(shown, key=lambda f: f.verdict is not Verdict.FAILS)]
    heads = ("", "check", ">found", ">allowed", ">expected", "reason of the bound", "note")
    top = table(heads, rows, "Checks that fail or were not made", "checks") if rows else ""
    top = _kinds(findings) + top
    if not held:
        return top or '<p class="empty">Nothing was checked.</p>'
    below = table(heads, [_check(f) for f in held], "Checks that hold", "checks")
    count = f"{len(held)} checks hold" if len(held) > 1 else "1 check holds"
    return f"{top}<details><summary>{count}</summary>{below}</details>"


def _check(finding: Finding) -> tuple[str, ...]:
    return (
        f'<b class="{_STYLES[finding.verdict]}">{finding.verdict}</b>',
        text(finding.name),
        text(number(finding.measured, finding.unit)),
        text(interval(finding.low, finding.high, finding.unit)),
        text(number(finding.expected, finding.unit)),
        text(finding.reason),
        text(finding.note),
    )


def _kinds(findings: Sequence[Finding]) -> str:
    """One row for each kind of check."""
    kinds: dict[str, list[Finding]] = {}
    for finding in findings:
        kinds.setdefault(_kind(finding), []).append(finding)
    if not kinds:
        return ""
    heads = (
        "kind",
        ">hold",
        ">fail",
        ">not checked",
        "nearest to its bound",
        ">found",
        ">allowed",
        "reason of the bound",
    )
    return table(
        heads, [_kind_row(kind, own) for kind, own in kinds.items()], "Checks by kind", "kinds"
    )


def _kind(finding: Finding) -> str:
    found = _KIND.match(finding.name)
    name = found[0].strip() if found else finding.name
    return (
        "energy from joint states" if name.endswith("from joint states") else _NAMES.get(name, name)
    )


def _kind_row(kind: str, own: Sequence[Finding]) -> tuple[str, ...]:
    count = {verdict: sum(f.verdict is verdict for f in own) for verdict in Verdict}
    made = [finding for finding in own if finding.verdict is not Verdict.NOT_CHECKED]
    row = (text(kind), *(_count(count[verdict], verdict) for verdict in _ORDER))
    if not made:
        return (*row, "", "", "", text(own[0].note))
    near = min(made, key=_room)
    allowed = interval(near.low, near.high, near.unit)
    return (
        *row,
        text(near.name),
        text(number(near.measured, near.unit)),
        text(allowed),
        text(near.reason),
    )


def _count(number: int, verdict: Verdict) -> str:
    return f'<b class="{_STYLES[verdict]}">{number}</b>' if number else "0"


def _room(finding: Finding) -> float:
    """How far within its bounds a check lies, as a share of them; negative where it fails."""
    to_bound = min(finding.high - finding.measured, finding.measured - finding.low)
    width = (finding.high - finding.low) / 2.0
    return (
        to_bound / (width if math.isfinite(width) else max(abs(finding.measured), 1e-9))
        if width
        else 0.0
    )


# What the program saves by its plan, in three figures, each with its baseline.

Row = tuple[str, Saving, str]


def savings_section(analysis: Analysis) -> str:
    """Section of the page; "" where the recording carries no savings."""
    savings = analysis.savings
    if savings is None:
        return ""
    cells = (
        (
            text(name),
            joules(saving.common),
            joules(saving.planned),
            f"<b>{saving.change}</b>{_within(saving)}",
            seconds(saving.seconds),
            text(baseline),
        )
        for name, saving, baseline in _rows(analysis, savings)
    )
    heads = ("", ">baseline", ">planned", ">saved", ">time", "held against")
    return (
        '<section id="savings"><h2>What the program saves</h2>'
        '<p class="hint">Predicted energies at the mains, over the same seconds, with the 90 % '
        "interval of "
        "what is saved; nothing here is simulated or measured. Losses that the data sheet puts "
        "at zero can "
        "only add; where the common program has more of them, the interval lies mostly above the "
        "value.</p>"
        f"{table(heads, cells, 'What the program saves')}"
        f"<details><summary>In words</summary><p>{text(savings.sentence)}; program "
        f"{text(savings.program_id)}.</p></details></section>"
    )


def savings_lines(analysis: Analysis) -> list[str]:
    """A sentence for each figure; none where the recording carries no savings."""
    savings = analysis.savings
    if savings is None:
        return []
    return [
        f"{name}: {saving.change} by plan (predicted), "
        f"{joules(saving.planned)} instead of {joules(saving.common)} "
        f"in {seconds(saving.seconds)}{_sure(saving)}, against {baseline}"
        for name, saving, baseline in _rows(analysis, savings)
    ]


def _rows(analysis: Analysis, savings: ProgramSavings) -> list[Row]:
    """Name, figures and baseline; the row of pauses only where there are any."""
    common = (
        f"synchronous S-curve PTP at 100 % through the same stations ({savings.around} movements "
        "around bodies)"
    )
    shortened = (
        " (pauses shortened)" if analysis.recording.fact(contents.UNSHORTENED_PAUSES) else ""
    )
    rows = [("movements", savings.movements, common)]
    if savings.pauses.seconds > 0.0:
        rows.append(("pauses", savings.pauses, f"the controller's own timers{shortened}"))
    rows.append(("total", savings.total, f"both{shortened}"))
    cycle = production_of(analysis)
    if cycle is not None and cycle.savings is not None and cycle.savings != savings:
        rows.append(("total, pauses at full length", cycle.savings.total, "both, computed"))
    return rows


def _within(saving: Saving) -> str:
    """What is saved, and its interval in percent as the figure above it."""
    word, amount = saved_amount(saving).gain()
    lines = [f"{joules(amount.value)}{' more' if word == 'more' else ''}"]
    if amount.high > amount.low and saving.common > 0.0:
        low, high = (100.0 * end / saving.common for end in (amount.low, amount.high))
        lines.append(f"90 % interval {low:.1f} to {high:.1f} %")
        if not saving.certain:
            lines.append(OPEN)
    return "".join(f"<small>{text(line)}</small>" for line in lines)


def _sure(saving: Saving) -> str:
    """The interval of what is saved; "" where the recording has none."""
    if saving.saved_low == saving.saved_high:
        return ""
    within = f", 90 % interval {joules(saving.saved_low)} to {joules(saving.saved_high)}"
    return within if saving.certain else f"{within}: {OPEN}"
