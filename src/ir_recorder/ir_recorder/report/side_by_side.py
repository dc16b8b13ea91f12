"""Two or more recordings side by side: figures, steps, and powers over time, each against the
first.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ir_msgs_py.savings import ProgramSavings
from ir_recorder.analysis import Analysis, Finding, Verdict
from ir_recorder.analysis.flows import energy_flows
from ir_recorder.analysis.production import (
    Amount,
    Production,
    drives_only,
    planned_clearance,
    planned_share,
    production_of,
)
from ir_recorder.analysis.results import ProgramTotals, Share
from ir_recorder.analysis.steps import step_label
from ir_recorder.report.answer import Answer
from ir_recorder.report.bars import Piece, Row, bars
from ir_recorder.report.charts import Point, front_part
from ir_recorder.report.cycle_costs import payback
from ir_recorder.report.files import write_output
from ir_recorder.report.headline import checked, plant_of
from ir_recorder.report.money_text import (
    span_of_money,
    yearly_money,
    yearly_span,
)
from ir_recorder.report.motion_scene import planned_side, rests_of
from ir_recorder.report.nights import IdleSaving, recorded_idle_saving, saved_year
from ir_recorder.report.number_text import (
    DASH,
    joules,
    kilowatt_hours,
    millimetres,
    percent,
    seconds,
    text,
    watt_hours,
    watts,
)
from ir_recorder.report.page import PAGE_START, asset
from ir_recorder.report.paid import a_night, counted_at, first_steps
from ir_recorder.report.prices import Costs, assumed_section, counted_with, following_price
from ir_recorder.report.program_names import origin_of, own_pace
from ir_recorder.report.series import Curves, Json, packed, stretches
from ir_recorder.report.shell import badge, shell
from ir_recorder.report.tables import COMPACT, table
from ir_values.arrays import FloatArray
from ir_values.files import ANYWHERE, FileRoots

MOST = 12  # recordings on one page: more columns than that are not read
SCRIPTS = ("charts.js", "axes.js", "export.js", "price.js", "side_by_side.js")
_POINTS = 4000  # of a power curve
Compared = tuple[Analysis, Sequence[Finding]]


def write_comparison(
    compared: Sequence[Compared],
    path: str | Path,
    roots: FileRoots = ANYWHERE,
    costs: Costs | None = None,
) -> Path:
    """Writes the page below `roots`; its absolute path. RecorderError when it can't be written."""
    return write_output(path, comparison_html(compared, costs).encode(), PAGE_START, roots)


def comparison_html(compared: Sequence[Compared], costs: Costs | None = None) -> str:
    """The page as text: the first recording is what the others are held against."""
    analyses = [each for each, _ in compared]
    names = _names([each for each, _ in compared])
    data = {
        "end": _longest(analyses),
        "axes": [_powers(analyses, names)] if _longest(analyses) else [],
    }
    prices = following_price(costs or Costs())
    parts = {
        "problems": _problems(analyses, names),
        "paid": _paid(compared, names, prices),
        "supply": "" if any(map(drives_only, analyses)) else ", at the mains",
        "assumed": assumed_section(prices),
        "figures": _figures(compared, names),
        "front": front_part(_points(analyses, names)),
        "steps": _steps(analyses, names),
        "steps_paper": " paper" if len(names) <= _BESIDE else "",
        "data": json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
    }
    main = re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], asset("side_by_side.html"))
    origins = "; ".join(dict.fromkeys(plant_of(each) for each in analyses))
    kind, words = _verdict(compared)
    return shell(
        f"{len(analyses)} recordings compared",
        "of different cells, each by itself"
        if _apart(analyses)
        else f"{names[0]} is what the others are held against",
        _answer(analyses, names, prices).html() + main,
        badges=[f'<p class="source open">{text(origins)}</p>', badge(words, kind)],
        script="\n".join(asset(script) for script in SCRIPTS),
    )


def _verdict(compared: Sequence[Compared]) -> tuple[str, str]:
    """The badge: whether the checks of all that was driven hold."""
    made = [
        check
        for _, checks in compared
        for check in checks
        if check.verdict is not Verdict.NOT_CHECKED
    ]
    if not made:
        return "open", "Nothing driven to check"
    failed = sum(check.verdict is Verdict.FAILS for check in made)
    if failed:
        return "bad", f"{failed} of {len(made)} checks fail"
    return "good", f"All {len(made)} checks hold"


def _answer(analyses: Sequence[Analysis], names: Sequence[str], costs: Costs) -> Answer:
    """Which program costs least, how sure that is, and what to do; of different cells none is held
    against another.
    """
    cycles = [production_of(analysis) for analysis in analyses]
    if _apart(analyses):
        words = "They are of different cells."
        return Answer("Nothing to hold against another", words, counted=counted_at(costs))
    known = {
        name: costs.energy_of_year(cycle).of(costs.money)
        for name, cycle in zip(names, cycles, strict=True)
        if cycle is not None
    }
    alike = len({cycle.drives_only for cycle in cycles if cycle is not None}) == 1
    if len(known) < len(cycles) or not alike:
        why = "What a year costs is not known of each, or not of the same supply."
        return Answer("No program is shown to cost least", why, counted=counted_at(costs))
    driven = [name for name, one in zip(names, analyses, strict=True) if one.program is not None]
    first = known[names[0]]
    least = min(known, key=lambda name: known[name].value)
    said = [f"{name} {yearly_money(known[name].value, costs.currency)}" for name in names[:_NAMED]]
    words = f"A year in shifts: {', '.join(said)}"
    paid: list[str] = []
    intervals = [
        f"{name} {yearly_span(year.low, year.high, costs.currency)} {costs.currency}"
        for name, year in list(known.items())[:_NAMED]
        if year.low < year.high
    ]
    sure = ["A run that was driven once has no interval."]
    if intervals:
        sure.insert(0, f"90 % intervals: {', '.join(intervals)}.")
    do = []
    pair = len(names) == _BESIDE and len(driven) == 1
    if pair and not intervals:
        off = percent(known[driven[0]].value / _other(known, driven[0]).value - 1.0)
        result = f"The run against the plan: {off}"
        do.append("In shifts: nothing, as the plan has no interval to tell it from chance.")
    elif least == names[0] and all(year.low > first.high for year in list(known.values())[1:]):
        result = f"{least} costs least"
        do.append(f"Keep {least}.")
    elif known[least].high < first.low:
        less = yearly_money(first.value - known[least].value, costs.currency)
        result = f"{least}: {less} less a year"
        do.append(f"Drive {least}.")
        paid.append(payback(_less(first, known[least]), costs))
    elif pair:  # the run lies in the interval of the plan
        off = percent(known[driven[0]].value / _other(known, driven[0]).value - 1.0)
        result = f"The run costs what its plan predicts, {off}"
        do.append("In shifts: nothing, both cost alike.")
    else:
        result = f"None is shown to cost less than {names[0]}"
        do.append("In shifts: choose by time, peak or clearance (Runs in figures).")
    idle = recorded_idle_saving(analyses[0], costs)
    if idle is not None:
        do += first_steps((), idle, costs)
        sure.append(f"What nights save is {idle.basis}.")
        paid.append(f"what nights save {payback(idle.money, costs)}")
    words = "; ".join((words, *paid))
    return Answer(result, f"{words}.", sure, do, a_night(idle, costs), counted=counted_at(costs))


def _less(first: Amount, least: Amount) -> Amount:
    """What a year of the second costs less than one of the first."""
    return Amount(first.value - least.value, first.low - least.high, first.high - least.low)


def _other(known: Mapping[str, Amount], name: str) -> Amount:
    """The year of the second of two recordings."""
    return next(year for other, year in known.items() if other != name)


_NAMED = 4  # recordings in a sentence


def _names(analyses: Sequence[Analysis]) -> list[str]:
    """File names; with their folders where two are alike, with their cells where those differ."""
    short = [analysis.recording.path.stem for analysis in analyses]
    long = [f"{a.recording.path.parent.name}/{a.recording.path.stem}" for a in analyses]
    names = [
        name if short.count(name) == 1 else other for name, other in zip(short, long, strict=True)
    ]
    if not _apart(analyses):
        return names
    cells = [a.cell.name if a.cell is not None else "no cell" for a in analyses]
    return [f"{name} ({cell})" for name, cell in zip(names, cells, strict=True)]


def _apart(analyses: Sequence[Analysis]) -> bool:
    """Whether the recordings are of different cells: no share of one is one of another."""
    return len({a.cell.name for a in analyses if a.cell is not None}) > 1


def _problems(analyses: Sequence[Analysis], names: Sequence[str]) -> str:
    items = [
        f"<li>{text(name)}: {text(problem)}</li>"
        for analysis, name in zip(analyses, names, strict=True)
        for problem in analysis.problems
    ]
    if _apart(analyses):
        items.append("<li>These recordings are of different cells.</li>")
    items += [
        f"<li>{text(name)}: {text(own_pace(cycle))}</li>"
        for name, cycle in zip(names, map(production_of, analyses), strict=True)
        if own_pace(cycle)
    ]
    if len({(a.recording.origin, a.recording.plant) for a in analyses}) > 1:
        never = any(each.recording.never_driven for each in analyses)
        why = "not all were driven" if never else "they are of different plants"
        items.append(f"<li>Not only the programs differ: {why}.</li>")
    return (
        f'<div class="problems calm"><b>Notes</b><ul>{"".join(items)}</ul></div>' if items else ""
    )


def _paid(compared: Sequence[Compared], names: Sequence[str], costs: Costs) -> str:
    """The figures for those who pay, as the report of each recording has them."""
    analyses = [analysis for analysis, _ in compared]
    cycles = [production_of(analysis) for analysis in analyses]
    first = None if _apart(analyses) else cycles[0]
    rows = [
        ("a year of such cycles", *(_year(cycle, first, costs) for cycle in cycles)),
        *_saved_rows(analyses, cycles, costs),
        ("a cycle", *(_cycle(cycle) for cycle in cycles)),
        ("plant", *(text(plant_of(a)) for a, _ in compared)),
        ("checks", *(text(checked(checks, a)[1]) for a, checks in compared)),
    ]
    hint = (
        "A year is one cycle after the other in shifts, pauses at full length, without nights and "
        "weekends. What a plan saves is "
        "predicted, against the same stations by PTP at full speed and the controller's own "
        "timers; intervals hold 90 %. "
    )
    shown = table(("", *(f">{name}" for name in names)), rows, "For those who pay")
    drawn = "" if _apart(analyses) else _year_bars(analyses, cycles, names, costs)
    return f'{drawn}{shown}<p class="hint">{text(hint)}{counted_with(costs)}</p>'


def _year_bars(
    analyses: Sequence[Analysis],
    cycles: Sequence[Production | None],
    names: Sequence[str],
    costs: Costs,
) -> str:
    """A year of such cycles of each recording, as the table below has it, with the interval of what
    is predicted.
    """
    rows = []
    for analysis, cycle, name in zip(analyses, cycles, names, strict=True):
        if cycle is None:
            continue
        price = costs.energy_of_year(cycle).of(costs.money)
        shown = yearly_money(price.value, costs.currency)
        style = PLANNED_STYLE if analysis.program is None else "driven"
        pieces = (Piece(style, "in shifts", price.value),)
        notes = (f"in shifts, {origin_of(cycle)}",)
        rows.append(Row(name, pieces, shown, notes, whisker=(price.low, price.high)))
    return bars(rows, "a year of such cycles") if len(rows) > 1 else ""


PLANNED_STYLE = "planned"


def _year(cycle: Production | None, first: Production | None, costs: Costs) -> str:
    if cycle is None:
        return DASH
    year = costs.energy_of_year(cycle).value
    shown = (
        f"<b>{text(yearly_money(costs.money(year), costs.currency))}</b>"
        f"<small>{kilowatt_hours(year)}</small>"
        + (f"<small>{cycle.supply}</small>" if cycle.supply else "")
    )
    if first is None or first is cycle or first.drives_only != cycle.drives_only:
        return shown
    return f"{shown}<small>{percent(year / costs.energy_of_year(first).value - 1.0)}</small>"


def _year_saved(cycle: Production | None, costs: Costs) -> str:
    amount = costs.saving_of_year(cycle) if cycle is not None else None
    if cycle is None or cycle.savings is None or amount is None:
        return DASH
    word, gain = amount.gain()
    price = gain.of(costs.money)
    lines = [
        f"{kilowatt_hours(gain.value)}{' more' if word == 'more' else ''}",
        cycle.savings.total.change,
        gain.doubt,
        cycle.supply,
    ]
    if price.high > price.low:
        lines.insert(0, f"{yearly_span(price.low, price.high, costs.currency)} {costs.currency}")
    small = "".join(f"<small>{text(line)}</small>" for line in lines if line)
    return f"<b>{text(yearly_money(price.value, costs.currency))}</b>{small}"


def _saved_rows(
    analyses: Sequence[Analysis], cycles: Sequence[Production | None], costs: Costs
) -> list[tuple[str, ...]]:
    """Rows of what plans save, what rest saves outside of the shifts, and of both together; those
    of rest are left out where it is not known of any.
    """
    found = [
        None if cycle is None else recorded_idle_saving(analysis, costs)
        for analysis, cycle in zip(analyses, cycles, strict=True)
    ]
    saved = [None if cycle is None else costs.saving_of_year(cycle) for cycle in cycles]
    by_plan = [_year_saved(cycle, costs) for cycle in cycles]
    rows = [("saved by its plan, a year", *by_plan)]
    if not any(found):
        return rows
    idle = next(each for each in found if each is not None)
    words = (
        f"{idle.mode} ({watts(idle.watts_deepest)}) instead of closed brakes "
        f"({watts(idle.watts_left_alone)}), {idle.basis}"
    )
    said = f"<small>{text(words)}</small>"
    nights = (DASH if idle is None else _night(idle, costs) for idle in found)
    both = (
        DASH if idle is None or amount is None else _both(amount, idle, costs)
        for idle, amount in zip(found, saved, strict=True)
    )
    return [
        *rows,
        (f"saved at night and at weekends, a year{said}", *nights),
        ("both together, a year", *both),
    ]


def _night(idle: IdleSaving, costs: Costs) -> str:
    ends = span_of_money(idle.money, costs.currency)
    small = f"<small>{text(ends)}</small>" if ends else ""
    return f"<b>{text(yearly_money(idle.saved, costs.currency))}</b>{small}"


def _both(amount: Amount, idle: IdleSaving, costs: Costs) -> str:
    year = saved_year(amount, idle, costs)
    word, gain = year.money.gain()
    price = yearly_money(year.money.value, costs.currency)
    between = (
        f"{yearly_span(gain.low, gain.high, costs.currency)} {costs.currency}"
        if gain.low < gain.high
        else ""
    )
    energy = year.with_energy(costs)
    more = f"{energy} more" if word == "more" and energy else energy
    lines = (between, more)
    small = "".join(f"<small>{text(line)}</small>" for line in lines if line)
    return f"<b>{text(price)}</b>{small}"


def _cycle(cycle: Production | None) -> str:
    if cycle is None:
        return DASH
    return (
        f"<b>{kilowatt_hours(cycle.energy)}</b><small>{seconds(cycle.pace)}</small>"
        f"<small>{text(cycle.name)}</small>"
    )


_BESIDE = 2  # recordings whose short figures a phone shows beside each other


def _figures(compared: Sequence[Compared], names: Sequence[str]) -> str:
    rows = [
        _measured_row(name, unit, value, compared)
        for name, unit, value in _VALUES
        if any(math.isfinite(value(analysis)) for analysis, _ in compared)
    ]
    kind = COMPACT if len(names) <= _BESIDE else ""
    return table(("", *(f">{name}" for name in names)), rows, "Runs in figures", kind)


def _measured_row(
    name: str,
    unit: Callable[[float], str],
    value: Callable[[Analysis], float],
    compared: Sequence[Compared],
) -> tuple[str, ...]:
    analyses = [analysis for analysis, _ in compared]
    values = [value(analysis) for analysis in analyses]
    short = [name in _WITH_PAUSES and _shortened(analysis) for analysis in analyses]
    apart = _apart(analyses)
    cells = (
        _against(each, values[0], unit, k == 0 or apart or short[k] != short[0])
        + (
            "<small>pauses shortened</small>"
            if short[k] and any(map(math.isfinite, values))
            else ""
        )
        for k, each in enumerate(values)
    )
    return (name, *cells)


_WITH_PAUSES = ("program", "its time", "pauses")
"""Rows that a run with shortened pauses makes smaller: no share of one at full length."""


def _shortened(analysis: Analysis) -> bool:
    return analysis.program is not None and analysis.program.unshortened is not None


def _against(value: float, first: float, unit: Callable[[float], str], own: bool) -> str:
    shown = f"<b>{unit(value)}</b>"
    if own or not math.isfinite(value) or not math.isfinite(first) or first == 0.0:
        return shown
    more = value / first - 1.0
    return f"{shown}<small>{percent(more)}</small>" if _LITTLE < abs(more) < _MUCH else shown


_LITTLE = 5e-4  # of the first: less is alike
_MUCH = 2.0  # times it: more is another thing


def _of_program(part: str, value: str) -> Callable[[Analysis], float]:
    """Energy [J] or seconds of a part of the program that was executed, else of the one that was
    planned.
    """

    def found(analysis: Analysis) -> float:
        program: ProgramTotals | None = analysis.program
        if program is not None:
            return float(getattr(getattr(program, part), value))
        planned = planned_share(analysis.recording.planned, part)
        return math.nan if planned is None else float(getattr(planned, value))

    return found


def _flow(name: str) -> Callable[[Analysis], float]:
    def value(analysis: Analysis) -> float:
        flows = energy_flows(analysis)
        return float(getattr(flows, name)) if flows is not None else math.nan

    return value


def _saved(of: Callable[[ProgramSavings], float]) -> Callable[[Analysis], float]:
    def value(analysis: Analysis) -> float:
        cycle = production_of(analysis)
        savings = cycle.savings if cycle is not None else analysis.savings
        return of(savings) if savings is not None else math.nan

    return value


def _least(analysis: Analysis) -> float:
    executed = [r.clearance.least for r in analysis.movements if r.clearance is not None]
    return min(executed, default=planned_clearance(analysis.recording.planned))


def _peak(analysis: Analysis) -> float:
    planned = [step.report.peak_power for step in analysis.recording.planned]
    return max(planned) if planned else analysis.peak_power


_VALUES: tuple[tuple[str, Callable[[float], str], Callable[[Analysis], float]], ...] = (
    ("program", watt_hours, _of_program("whole", "energy")),
    ("its time", seconds, _of_program("whole", "seconds")),
    ("movements", watt_hours, _of_program("movements", "energy")),
    ("time of movements", seconds, _of_program("movements", "seconds")),
    ("pauses", watt_hours, _of_program("pauses", "energy")),
    ("waiting between steps", watt_hours, _of_program("waiting", "energy")),
    ("returned by braking axes", watt_hours, _flow("returned")),
    ("brake resistor", watt_hours, _flow("resistor")),
    ("motors and inverters", watt_hours, _flow("motors")),
    ("friction", watt_hours, _flow("friction")),
    ("planned, pauses at full length", watt_hours, _saved(lambda s: s.total.planned)),
    ("common program, pauses at full length", watt_hours, _saved(lambda s: s.total.common)),
    ("saved by its plan", watt_hours, _saved(lambda s: s.total.saved)),
    ("peak power", watts, _peak),
    ("least clearance", millimetres, _least),
)


def _points(analyses: Sequence[Analysis], names: Sequence[str]) -> list[Point]:
    """Each program with its pauses at full length, driven or else planned."""
    points = []
    for analysis, name in zip(analyses, names, strict=True):
        if _shortened(analysis):
            cycle = production_of(analysis)
            if cycle is not None:
                origin = analysis.recording.origin
                points.append(Point(name, cycle.seconds, cycle.energy, origin))
        elif analysis.program is not None and math.isfinite(analysis.program.whole.energy):
            whole = analysis.program.whole
            points.append(Point(name, whole.seconds, whole.energy, analysis.recording.origin))
        elif (planned := planned_share(analysis.recording.planned)) is not None:
            points.append(Point(name, planned.seconds, planned.energy, "predicted"))
        elif analysis.savings is not None:
            total = analysis.savings.total
            points.append(Point(name, total.seconds, total.planned, "predicted"))
    return points


def _steps(analyses: Sequence[Analysis], names: Sequence[str]) -> str:
    """Energy of every step; steps are matched by their label and its number of times before."""
    apart = _apart(analyses)
    held = [dict(_keyed(analysis)) for analysis in analyses]
    keys = list(dict.fromkeys(key for own in held for key in own))
    rows = []
    for key in keys:
        found = [own.get(key) for own in held]
        first = found[0].energy if found[0] is not None else math.nan
        cells = (_step(result, first, k == 0 or apart) for k, result in enumerate(found))
        rows.append((text(key[0]), *cells))
    return table(("step", *(f">{name}" for name in names)), rows, "Steps")


def _keyed(analysis: Analysis) -> Iterator[tuple[tuple[str, int], Share]]:
    """Energy and duration of each step, executed or planned."""
    steps = [(r.step.label, Share(r.step.label, r.seconds, r.energy)) for r in analysis.steps]
    for movement in analysis.recording.planned:
        if movement.duration <= 0.0:  # it is where it has to go
            continue
        label = step_label(movement)
        steps.append((label, Share(label, movement.duration, movement.report.energy)))
    times: dict[str, int] = {}
    for label, found in steps:
        times[label] = times.get(label, 0) + 1
        yield (label, times[label]), found


def _step(result: Share | None, first: float, own: bool) -> str:
    if result is None:
        return DASH
    return f"{_against(result.energy, first, joules, own)}<small>{seconds(result.seconds)}</small>"


def _longest(analyses: Sequence[Analysis]) -> float:
    return max((curve.end for curve in map(_curve, analyses) if curve is not None), default=0.0)


@dataclass(frozen=True, eq=False)
class _Curve:
    """Power at the mains [W] (N,) over the time [s] (N,) from the start of a program to its end."""

    time: FloatArray
    watts: FloatArray
    high: FloatArray
    end: float


def _curve(analysis: Analysis) -> _Curve | None:
    """That of the program that was driven, else of the planned one; None where neither is known."""
    power = analysis.recording.power
    program = analysis.program
    if program is not None and power is not None and len(power.time) > 1:
        start = analysis.steps[0].step.start
        spans = [
            (result.step.start - start, result.step.end - start)
            for result in analysis.steps
            if result.step.movement.is_pause
        ]
        whole = _Curve(power.time - start, power.power, power.power, program.whole.seconds)
        return _cut(whole, spans)
    side = planned_side(analysis) if analysis.recording.never_driven else None
    if side is None or not len(side.time):
        return None
    return _cut(_Curve(side.time, side.watts, side.high, side.report.duration), rests_of(side)[:-1])


REST = 12.0  # s: longer pauses are drawn so short


def _cut(curve: _Curve, pauses: Sequence[tuple[float, float]]) -> _Curve:
    """The curve with each long pause as long as REST: those of a run may be shortened, and curves
    beside each other are to be compared.
    """
    edges = [0.0]
    places = [0.0]
    for begin, end in pauses:
        if end - begin > REST:
            first = places[-1] + begin - edges[-1]
            edges += [begin, end]
            places += [first, first + REST]
    shift = places[-1] - edges[-1]
    time = np.where(
        curve.time > edges[-1], curve.time + shift, np.interp(curve.time, edges, places)
    )
    before = curve.time < 0.0  # what was recorded before the program
    return replace(curve, time=np.where(before, curve.time, time), end=curve.end + shift)


def _powers(analyses: Sequence[Analysis], names: Sequence[str]) -> dict[str, Json]:
    """Mains power from the start of each program on one grid, every peak kept."""
    edges = np.linspace(0.0, _longest(analyses), _POINTS + 1)
    known = [(name, curve) for name, curve in zip(names, map(_curve, analyses), strict=True)]
    drawn = [(name, curve) for name, curve in known if curve is not None]
    low = np.zeros((_POINTS, len(drawn)))
    high = np.zeros((_POINTS, len(drawn)))
    for k, (_, curve) in enumerate(drawn):
        low[:, k] = stretches(edges, curve.time, curve.watts).low
        high[:, k] = stretches(edges, curve.time, curve.high).high
    middle = (edges[1:] + edges[:-1]) / 2.0
    curves = Curves("power at the mains", "W", middle, high, low=low)
    ends: list[Json] = [curve.end for _, curve in drawn]
    return {**packed(curves), "names": [name for name, _ in drawn], "ends": ends}
