"""Files and summary of the statistics: a row per movement, the page, a table of comparisons."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from ir_recorder.analysis.intervals import ALIKE, LEVEL, Mean
from ir_recorder.report.answer import Answer
from ir_recorder.report.bars import tick_step
from ir_recorder.report.files import write_output
from ir_recorder.report.methods import counted
from ir_recorder.report.money_text import money, price_of
from ir_recorder.report.number_text import DASH, kilowatt_hours, significant, text
from ir_recorder.report.page import PAGE_START, folded
from ir_recorder.report.prices import Costs
from ir_recorder.report.shell import SIMULATED, source_badge
from ir_recorder.report.step_table import write_columns
from ir_recorder.report.tables import table
from ir_studies.page import Head, page, settings_table
from ir_studies.statistics.findings import (
    ASYNCHRONOUS,
    DIRECT,
    PREDICTED,
    PREDICTED_TO_DIRECT,
    SYNCHRONOUS,
    Comparison,
    Findings,
    number,
)
from ir_studies.statistics.settings import DRAWN, StatisticsSettings
from ir_studies.work import Row
from ir_values.files import ANYWHERE

# Drawing of paired comparisons: a dot per pair, a bar for the interval of the mean.

WIDTH = 420.0  # as narrow as a telephone, so that its letters stay readable there
LINE = 34.0
_LETTER = 7.6  # of a name in bold, on average
_DIGIT = 5.9  # of a figure below a name, on average
_GAP = 26.0  # between names and axis: half of the first tick's words
_RIGHT = 26.0
_WORDS = 28.0  # more, for what is said beside an arrow
_TOP = 8.0
_BOTTOM = 48.0
_INSIDE = (10.0, 90.0)  # percentiles that the axis holds; dots outside are arrows at its edge
_SPREAD = 10.0  # up and down that dots are moved apart
_BAR = 22.0  # high
_WIDER = 2.0  # than the span, what is divided into ticks: beside the names there is room for five


def dots(comparisons: Sequence[Comparison], title: str) -> str:
    """SVG, its title below the axis; "" where nothing was compared."""
    kept = [each for each in comparisons if each.count]
    if not kept:
        return ""
    first, last, step = _ticks(kept)
    low = first * step
    high = last * step
    height = _TOP + LINE * len(kept) + _BOTTOM
    every = np.concatenate([each.values for each in kept])
    names = max(_LETTER * len(each.name) for each in kept)
    left = max(names, *(_DIGIT * len(_said(each)) for each in kept)) + _GAP
    left += _WORDS * bool(every.min() < low)
    right = WIDTH - _RIGHT - _WORDS * bool(every.max() > high)

    def at(value: float) -> float:
        inside = min(max(value, low), high)
        return left + (inside - low) / (high - low) * (right - left)

    lines = "".join(_line(each, _TOP + LINE * k, at) for k, each in enumerate(kept))
    said = "; ".join(f"{each.name}: mean {each.mean.value:+.1f} %" for each in kept)
    return (
        f'<div class="figure"><svg class="dots" viewBox="0 0 {WIDTH:g} {height:g}" '
        'role="img" '
        f'aria-label="{text(title)}: '
        f'{text(said)}">{_axis(range(first, last + 1), step, height, at)}{lines}'
        f'<text x="{WIDTH:g}" y="{height - 12:g}" text-anchor="end">'
        f"{text(title)}</text></svg></div>"
    )


def _ticks(kept: Sequence[Comparison]) -> tuple[int, int, float]:
    """First and last tick of the axis in steps, and the step [%]: intervals lie between them whole,
    and dots but for the outermost ones.
    """
    low, high = np.percentile(np.concatenate([each.values for each in kept]), _INSIDE)
    bars = [end for each in kept for end in (each.mean.low, each.mean.high) if math.isfinite(end)]
    low = min(float(low), -1.0, *bars)
    high = max(float(high), 1.0, *bars)
    step = tick_step(_WIDER * (high - low))
    return math.floor(low / step), math.ceil(high / step), step


def _axis(ticks: range, step: float, height: float, at: Callable[[float], float]) -> str:
    found = []
    for k in ticks:
        x = at(k * step)
        kind = "zero" if k == 0 else "grid"
        bottom = height - _BOTTOM
        found.append(
            f'<line class="{kind}" x1="{x:.1f}" x2="{x:.1f}" y1="{_TOP:g}" y2="{bottom:g}"/>'
        )
        found.append(
            f'<text x="{x:.1f}" y="{height - 30:g}" text-anchor="middle">{_tick(k * step)} %</text>'
        )
    return "".join(found)


def _tick(percent: float) -> str:
    return f"{percent:+g}" if percent else "0"


def _said(each: Comparison) -> str:
    """The difference of the sums with its interval."""
    value = f"{percent(each.mean.value)} %"
    return f"{value} ({_interval(each.mean)})" if math.isfinite(each.mean.low) else value


def _line(each: Comparison, top: float, at: Callable[[float], float]) -> str:
    y = top + LINE / 2.0
    marks = "".join(
        _dot(value, y + _SPREAD * (2.0 * (0.618034 * k % 1.0) - 1.0), at)
        for k, value in enumerate(each.values.tolist())
        if not _beyond(value, at)
    )
    marks += "".join(_arrow(each.values.tolist(), way, y, at) for way in (-1, 1))
    figure = "figure shown" if each.shown else "figure"
    label = (
        f'<text class="name" x="0" y="{y - 1.0:.1f}">{text(each.name)}</text>'
        f'<text class="{figure}" x="0" y="{y + 11.0:.1f}">{text(_said(each))}</text>'
    )
    middle = at(each.mean.value)
    ends = f'y1="{y - _BAR / 2.0:.1f}" y2="{y + _BAR / 2.0:.1f}"'
    marks += f'<line class="mean" x1="{middle:.1f}" x2="{middle:.1f}" {ends}/>'
    if math.isnan(each.mean.low):
        return label + marks
    x = at(each.mean.low)
    wide = max(at(each.mean.high) - at(each.mean.low), 2.0)
    bar = f'<rect x="{x:.1f}" y="{y - _BAR / 2.0:.1f}" width="{wide:.1f}" height="{_BAR:g}"/>'
    return label + bar + marks


def _dot(value: float, y: float, at: Callable[[float], float]) -> str:
    return f'<circle cx="{at(value):.1f}" cy="{y:.1f}" r="2"/>'


def _beyond(value: float, at: Callable[[float], float]) -> int:
    """-1 or 1 for a value that lies left or right of the axis, else 0."""
    ends = {at(-math.inf): -1, at(math.inf): 1}
    return ends.get(at(value), 0) if value != 0.0 else 0


def _arrow(values: Sequence[float], way: int, y: float, at: Callable[[float], float]) -> str:
    """An arrow at the end of the axis for the pairs that lie beyond it, with their values."""
    beyond = sorted((value for value in values if _beyond(value, at) == way), key=abs)
    if not beyond:
        return ""
    x = at(way * math.inf)
    words = f"{'to ' if len(beyond) > 1 else ''}{beyond[-1]:+.0f} %"
    anchor = "start" if way > 0 else "end"
    return (
        f'<path class="out" d="M{x:.1f} {y - 3:.1f}l{5 * way:g} 3l{-5 * way:g} 3z"/>'
        f'<text class="beyond" x="{x + 8 * way:.1f}" y="{y + 4:.1f}" text-anchor="{anchor}">'
        f"{words}</text>"
    )


_CSV_START = b"pair,"
_NUMBERS = (
    "duration_s", "predicted_j", "predicted_low_j", "predicted_high_j", "direct_j", "indirect_j", "drives_j",  # noqa: E501
    "peak_w", "path_m", "movement_cost", "torque_share",
)  # fmt: skip
_TEXTS = ("timing", "trajectory_id", "message")
_HEADS = (
    "",
    ">pairs",
    ">difference of the sums, 90 %",
    ">median of the pairs, 90 %",
    ">less / equal / more",
    ">d",
)
_SUMMED_UP = (
    "comparison", "pairs", "values", "mean_percent", "low_percent", "high_percent", "median_percent",  # noqa: E501
    "median_low_percent", "median_high_percent", "effect", "less", "more", "chance", "shown",
)  # fmt: skip


FEW = 30
"""Pairs below which a mean may miss the few that carry it: drawn from the differences of `demo`,
the interval holds their mean in 90 % of samples of 30, in 62 % of samples of 10
(benchmarks/studies.py --only statistics).
"""
_FEW_PAIRS = (
    f"Fewer than {FEW} pairs may miss the few that carry a mean; its interval then holds less "
    "often than 90 %."
)
_SKEWED = "Where few pairs carry a mean its interval may hold less often than 90 %: see the dots."
_TIME_RULE = (
    "objective time: the synchronous answer is a candidate of the asynchronous request, so that "
    "none may be slower; a rule, no finding."
)
_PLANNER_RULE = (
    "A named planner lets joints move asynchronously wherever it can, also where this serves the "
    "objective less."
)
_PORTFOLIO_RULE = (
    "The portfolio lets joints move asynchronously only where this is better by the objective as "
    "predicted: a rule, no finding."
)
_ONE_ROBOT = f"One robot says little of the predicted interval; plant: {DRAWN} draws one per pair."
"""Comparisons that people look for first."""
_SCOPE = (
    "Energies are at the mains, controller and tool included, of simulated robots; nothing "
    "follows for other cells or a real robot."
)


def counts(found: Findings) -> list[tuple[str, str]]:
    """What the comparisons are taken over, each with how many."""
    compared_ = found.solved - found.same
    rows = [
        ("pairs asked", str(found.pairs)),
        ("with both timings certified", str(found.solved)),
        ("same answer in both", str(found.same)),
        ("compared", str(compared_)),
        ("different movements among these", str(found.different)),
        ("asynchronous takes longer", str(found.slower)),
        ("movements driven in simulation", str(found.driven)),
    ]
    if found.driven and math.isfinite(found.covered):
        inside = round(found.covered * found.driven)
        rows.append(("simulated within the predicted 90 % interval", str(inside)))
    return rows


def notes(found: Findings, settings: StatisticsSettings) -> list[str]:
    """What must be known to read the figures; always the same sentences."""
    rows = [each for each in (*found.comparisons, *found.agreements) if each.count]
    few = any(each.pairs < FEW for each in rows)
    rule = _PLANNER_RULE if settings.planner else _PORTFOLIO_RULE
    if settings.objective == "time":
        rule = _TIME_RULE
    return [
        *([_FEW_PAIRS] if few else []),
        *([_SKEWED] if not few and any(each.skewed for each in rows) else []),
        *([rule] if found.solved > found.same else []),
        *([_ONE_ROBOT] if found.driven and settings.plant != DRAWN else []),
        _SCOPE,
    ]


def summary_of(found: Findings, settings: StatisticsSettings) -> str:
    """Counts, a table of the comparisons with their intervals, reasons and notes as plain text."""
    heads = ("", "pairs", "mean %", "90 % interval", "median %", "less/equal/more", "shown")
    rows = [
        (
            each.name,
            str(each.pairs),
            percent(each.mean.value),
            _interval(each.mean),
            percent(each.median.value),
            f"{each.less}/{each.count - each.less - each.more}/{each.more}",
            "yes" if each.shown else "",
        )
        for each in (*found.comparisons, *found.agreements)
        if each.count
    ]
    said = [f"{count:>6}  {what}" for what, count in counts(found)]
    said += _text_table(heads, rows) if rows else []
    said += [f"left out: {each.count} {each.what}: {each.example}" for each in found.failures]
    said += [f"note: {each}" for each in notes(found, settings)]
    return "\n".join(said)


def percent(value: float) -> str:
    """A figure in percent with its sign and two decimals, three where it is smaller; what rounds to
    zero has no sign.
    """
    if not math.isfinite(value):
        return DASH
    shown = f"{value:+.{2 if abs(value) >= _HUNDREDTH else 3}f}"
    return "0.00" if shown in ("+0.000", "-0.000") else shown


_HUNDREDTH = 0.01  # of a percent


def _interval(mean: Mean) -> str:
    return f"{percent(mean.low)} to {percent(mean.high)}" if math.isfinite(mean.low) else DASH


def _text_table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines: the first column to the left, the others to the right."""
    widths = [max(len(row[k]) for row in (heads, *rows)) for k in range(len(heads))]
    return [
        "  ".join(
            cell.ljust(width) if k == 0 else cell.rjust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in (heads, *rows)
    ]


def write_outputs(
    rows: Sequence[Row], found: Findings, settings: StatisticsSettings, folder: Path
) -> tuple[Path, ...]:
    """Write table.csv and index.html. Raises RecorderError for files that can't be written, or
    replaced.
    """
    html = page_html(found, settings).encode()
    return (
        write_columns(columns(rows), folder / "table.csv", _CSV_START, ANYWHERE),
        write_output(folder / "index.html", html, PAGE_START, ANYWHERE),
    )


def columns(rows: Sequence[Row]) -> dict[str, list[str | float | int]]:
    """A row per pair and timing, SI units."""
    flat = list(_flat(rows))
    return {name: [each[name] for each in flat] for name in flat[0]} if flat else {}


def _flat(rows: Sequence[Row]) -> Iterator[dict[str, str | float | int]]:
    for k, row in enumerate(rows):
        for asked in (SYNCHRONOUS, ASYNCHRONOUS):
            one = row.get(asked, {"message": row.get("message", "")})
            yield {
                "pair": k,
                "start": str(row.get("start", "")),
                "goal": str(row.get("goal", "")),
                "asked": asked,
                "solved": int(bool(one.get("solved", False))),
                **{name: number(one, name) for name in _NUMBERS},
                **{name: str(one.get(name, "")) for name in _TEXTS},
            }


def _robot(settings: StatisticsSettings) -> str:
    """The simulated robot in words."""
    if settings.plant == DRAWN:
        return "for each pair a robot drawn from the data sheet"
    if settings.plant.startswith("typical:"):
        return "one robot drawn from the data sheet"
    return f"robot {Path(settings.plant).stem}"


def page_html(found: Findings, settings: StatisticsSettings) -> str:
    """The page as text."""
    varied = [each for each in found.comparisons if not each.count or each.less + each.more]
    same = [each.name for each in found.comparisons if each not in varied]
    head = Head(
        "Predicted and simulated energy",
        f"{settings.cell}: {found.pairs} random pairs of places, planner "
        f"{settings.planner or 'portfolio'}, objective {settings.objective.replace('_', ' ')}",
        _answer(found),
        *_verdict(found),
        source_badge(SIMULATED, "simulated", _robot(settings)),
    )
    parts = {
        "counts": table(("", ">how many"), [(text(a), b) for a, b in counts(found)], "Counts"),
        "notes": "".join(f"<li>{text(note)}</li>" for note in notes(found, settings)),
        "alike": text(f"Alike in all pairs: {', '.join(same)}." if same else ""),
        "comparisons": _table(
            varied,
            "Asynchronous against synchronous",
            (">asynchronous, mean", ">synchronous, mean"),
        ),
        "left_out": folded(_left_out(found)),
        "comparison_dots": "".join(dots(own, _ASYNCHRONOUS) for own in _by_axis(varied)),
        "agreements": _table(
            found.agreements, "Energies of a movement", (">energy, mean", ">direct, mean")
        ),
        "agreement_dots": dots(
            found.agreements, "predicted or indirect less direct, in percent of direct"
        ),
        "settings": settings_table(settings.budget),
    }
    return page("statistics", head, parts)


_ASYNCHRONOUS = "asynchronous less synchronous, in percent of synchronous"
_TIME_AND_ENERGY = ("s", "J")


def _by_axis(comparisons: Sequence[Comparison]) -> tuple[list[Comparison], list[Comparison]]:
    """Time and energy, and natural values, which differ by much more: each has an axis."""
    first = [each for each in comparisons if each.unit in _TIME_AND_ENERGY]
    return first, [each for each in comparisons if each not in first]


def _answer(found: Findings) -> Answer | None:
    """How true predicted energies are, what the timings change, how sure both are, and what
    follows.
    """
    result, words = _predicted(found)
    if not result:
        if found.solved == found.same:
            return None
        return Answer(_timings(found), "", _SCOPE, "", _a_million(found))
    each = _against_direct(found)
    assert each is not None
    sure = [f"{counted(found.driven, 'movement')} between {counted(each.pairs, 'pair')} of places"]
    sure[0] += f": {BOTH_ONCE}." if found.same else "."
    sure.append(_SCOPE)
    if found.solved < found.pairs:
        sure.append(f"{found.pairs - found.solved} of {found.pairs} pairs could not be planned.")
    between = f"90 % interval {_interval(each.mean)} %" if math.isfinite(each.mean.low) else ""
    advice = []
    if each.outside:
        factor = 1.0 / (1.0 + 0.01 * each.mean.value)
        advice.append(
            "Fit the power parameters of your robot to a meter (ir energy fit) before you trust "
            f"sums; for this simulated one a factor of {factor:.3f} would do."
        )
    if not any(one.shown for one in found.comparisons):
        advice.append("Take either timing: neither is shown to be better.")
    costs = [*_a_million(found), *_in_money(each.mean)]
    return Answer(result, f"{words} {_timings(found)}.", sure, advice, costs, between)


BOTH_ONCE = "by both timings, once where these move alike"
"""Which movements of a pair are driven."""


def _a_million(found: Findings) -> list[str]:
    """What a million movements take and cost, on the meter where it is known and as predicted, and
    what asynchronous joints change of it; none where no energy is known.
    """
    costs = Costs()

    def said(joules: float) -> str:
        return f"{kilowatt_hours(1e6 * joules)}, {money(costs.money(1e6 * joules), 'EUR')}"

    price = f"at {price_of(costs.price, costs.currency)}, assumed"
    each = _against_direct(found)
    predicted = next((one for one in found.comparisons if one.name == PREDICTED), None)
    if each is not None:
        lines = [
            f"A million such movements: {said(each.levels[1])} on the meter ({price}); predicted "
            f"{said(each.levels[0])}."
        ]
    elif predicted is not None and math.isfinite(predicted.levels[1]):
        lines = [f"A million such movements: {said(predicted.levels[1])} ({price}), predicted."]
    else:
        return []
    timed = next((one for one in found.comparisons if one.name == DIRECT and one.count), predicted)
    if timed is not None and timed.count:
        less = timed.levels[1] - timed.levels[0]
        kind = "less" if less >= 0.0 else "more"
        shown = "" if timed.shown else ", which is not shown"
        lines.append(f"With asynchronous joints a million takes {said(abs(less))} {kind}{shown}.")
    return lines


def _in_money(off: Mean) -> list[str]:
    """What a predicted cost of 100 EUR is on the meter."""
    if abs(off.value) < ALIKE:
        return []

    def on_the_meter(percent_off: float) -> float:
        return 100.0 / (1.0 + 0.01 * percent_off)

    low, high = sorted(map(on_the_meter, (off.low, off.high)))
    ends = f" (90 % interval {low:.2f} to {high:.2f} EUR)" if math.isfinite(off.low) else ""
    return [
        f"Where a page predicts 100 EUR, such a simulated robot takes "
        f"{on_the_meter(off.value):.2f} EUR{ends}.",
        "What a plan saves changes by the same share, as both of its programs do.",
    ]


def _verdict(found: Findings) -> tuple[str, bool]:
    """The badge: how far predicted energies are off, else how many of the measured ones lie where
    they were predicted.
    """
    if not found.driven or not math.isfinite(found.covered):
        return "", False
    each = _against_direct(found)
    if each is not None and each.outside:
        return _off(each), False
    inside = round(found.covered * found.driven)
    words = f"{inside} of {found.driven} energies in the predicted interval"
    return words, found.covered >= LEVEL


_MOSTLY = 0.5  # of the intervals


def _timings(found: Findings) -> str:
    """What joints' own laws change, in a sentence without its full stop."""
    shown = [each for each in found.comparisons if each.shown]
    if not shown:
        return "No change by asynchronous joints is shown"
    said = [f"{each.name} {percent(each.mean.value)} % ({_interval(each.mean)})" for each in shown]
    return f"Asynchronous joints change {', '.join(said)} in sum"


def _against_direct(found: Findings) -> Comparison | None:
    """Predicted against measured energies; None where none was measured."""
    each = next((one for one in found.agreements if one.name == PREDICTED_TO_DIRECT), None)
    return each if each is not None and math.isfinite(each.mean.value) else None


def _predicted(found: Findings) -> tuple[str, str]:
    """How far and in which direction predicted energies lie from measured ones, and how often the
    measured one lies in the interval; "" where none was measured.
    """
    each = _against_direct(found)
    if each is None:
        return "", ""
    low = each.mean.value < 0.0
    result = f"Predicted energies are {_off(each)}"
    words = (
        f"By the sum of all movements; {'too low' if low else 'too high'} in "
        f"{each.less if low else each.more} of {each.count} of them."
    )
    if abs(each.mean.value) < ALIKE:
        result = "Predicted energies are right"
        words = "By the sum of all movements."
    elif math.isfinite(each.mean.low) and not each.outside:
        words = f"By the sum of all movements: {result.lower()}, which may be chance."
        result = "Predicted energies are not shown to be off"
    if math.isfinite(found.covered):
        inside = round(found.covered * found.driven)
        words += f" {inside} of {found.driven} simulated ones lie in the predicted 90 % interval"
        words += f"{_one_sided(found)}."
    return result, words


def _off(each: Comparison) -> str:
    """How far a mean is off, and in which direction."""
    side = "low" if each.mean.value < 0.0 else "high"
    return f"{significant(abs(each.mean.value), 2)} % too {side}"


def _one_sided(found: Findings) -> str:
    """That intervals begin at the prediction, where most do; "" where they don't."""
    if found.upwards <= _MOSTLY:
        return ""
    return (
        f"; {round(found.upwards * found.driven)} intervals begin at the prediction, as losses can "
        "only add to the data sheet"
    )


def summed_up(found: Findings) -> str:
    """A row of CSV per comparison; the differences are in percent of the second."""
    rows = [
        (
            f'"{each.name}"',
            each.pairs,
            each.count,
            *(each.mean.value, each.mean.low, each.mean.high),
            *(each.median.value, each.median.low, each.median.high),
            *(each.effect, each.less, each.more, each.chance, int(each.shown)),
        )
        for each in (*found.comparisons, *found.agreements)
    ]
    return "".join(f"{','.join(map(str, row))}\n" for row in (_SUMMED_UP, *rows))


def _table(comparisons: Sequence[Comparison], caption: str, sides: tuple[str, str]) -> str:
    """sides: of what the means are. With a column of movements where these are more than the
    pairs.
    """
    rows = [_comparison_cells(each) for each in comparisons]
    heads = [*_HEADS[:2], *sides, *_HEADS[2:]]
    if any(each.count != each.pairs for each in comparisons):
        heads.insert(1, ">movements")
        rows = [
            (row[0], str(each.count), *row[1:]) for row, each in zip(rows, comparisons, strict=True)
        ]
    return table(heads, rows, caption)


def _comparison_cells(each: Comparison) -> tuple[str, ...]:
    """A comparison's row of the table."""
    equal = each.count - each.less - each.more
    return (
        text(each.name),
        str(each.pairs),
        *(
            f"{significant(level, 4)} {each.unit}" if math.isfinite(level) else DASH
            for level in each.levels
        ),
        _with_interval(each.mean, "b" if each.shown else "span"),
        _with_interval(each.median, "span"),
        f"{each.less} / {equal} / {each.more}" if each.count else DASH,
        f"{each.effect:+.2f}" if math.isfinite(each.effect) else DASH,
    )


def _with_interval(found: Mean, tag: str) -> str:
    value = f"<{tag}>{percent(found.value)} %</{tag}>" if math.isfinite(found.value) else DASH
    return f"{value} ({_interval(found)})" if math.isfinite(found.low) else value


def _left_out(found: Findings) -> str:
    """A section with the reasons; "" where nothing was left out."""
    if not found.failures:
        return ""
    rows = [(text(each.what), str(each.count), text(each.example)) for each in found.failures]
    reasons = table(("", ">how many", "why, one of them in words"), rows, "What was left out")
    return f'<section id="left_out"><h2>What was left out</h2>{reasons}</section>'
