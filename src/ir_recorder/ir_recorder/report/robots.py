"""The page of a recording of several robots: what a year of all together costs, each of them, when
each moved, waited and passed a zone, and what holds between them. Each robot has a page of its own
beside it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ir_msgs_py.savings import largest_quarter
from ir_recorder.analysis import Analysis, Finding
from ir_recorder.analysis.production import (
    Production,
    deviation,
    idle_watts,
    production_of,
    rest_measured,
    rest_saving,
    sum_of,
)
from ir_recorder.analysis.results import StepResult
from ir_recorder.analysis.robots import STAMPS, zone_passes
from ir_recorder.analysis.tending import Span
from ir_recorder.report.answer import Answer
from ir_recorder.report.cycle_costs import cycles_of_year, money_of_thousand, payback
from ir_recorder.report.files import write_output
from ir_recorder.report.gantt import Bar, Gantt, legend, mode_bars, together
from ir_recorder.report.headline import (
    checked,
    failing,
    source,
    verdict,
    year_in_words,
    yearly_tile,
)
from ir_recorder.report.methods import counted
from ir_recorder.report.nights import IdleSaving, idle_saving
from ir_recorder.report.number_text import (
    DASH,
    kilograms,
    kilowatt_hours,
    number,
    percent,
    seconds,
    text,
    watt_hours,
    watts,
)
from ir_recorder.report.page import PAGE_START
from ir_recorder.report.paid import Paid, RunNow, Tile, a_night, counted_at, first_steps, row_of
from ir_recorder.report.prices import Costs, assumed_section, counted_with, following_price
from ir_recorder.report.program_names import DRIVEN
from ir_recorder.report.quarter_hour import demand_note, demand_of
from ir_recorder.report.shell import shell
from ir_recorder.report.tables import check_table, table
from ir_values.files import ANYWHERE, FileRoots


def write_robots(
    analyses: Mapping[str, Analysis],
    checks: Sequence[Finding],
    path: str | Path,
    roots: FileRoots = ANYWHERE,
) -> Path:
    """Writes the page below `roots`; its absolute path. RecorderError when it can't be written."""
    return write_output(path, robots_html(analyses, checks).encode(), PAGE_START, roots)


def robots_html(
    analyses: Mapping[str, Analysis], checks: Sequence[Finding], costs: Costs | None = None
) -> str:
    """The page as text; without `costs` with those that are assumed."""
    prices = following_price(costs or Costs())
    first = next(iter(analyses.values()))
    cell = first.cell.name.rpartition(".")[0] if first.cell is not None else ""
    name = cell or first.recording.path.stem
    cycle = common_cycle(analyses)
    main = [
        _answer(analyses, checks, cycle, prices).html(),
        _picture(analyses, cycle, prices),
        row_of(_tiles(analyses, cycle, prices)),
        failing(checks),
        f"<section><h2>Energy, money and time</h2>{_table(analyses, cycle, prices)}</section>",
        f"<section><h2>Who moved, waited and passed a zone when</h2>{_figure(analyses)}</section>",
        assumed_section(prices),
        '<details class="part" id="checks"><summary><h2>Checks</h2></summary>'
        f"{check_table(checks)}</details>",
    ]
    return shell(
        f"{name}: {len(analyses)} robots",
        f"{first.recording.origin}, all robots of one recording",
        "\n".join(main),
        badges=[source(first), verdict(checks)],
    )


def _answer(
    analyses: Mapping[str, Analysis],
    checks: Sequence[Finding],
    cycle: Production | None,
    costs: Costs,
) -> Answer:
    """What a year of all costs, how far that is from what was predicted, and what saves of it."""
    every = analyses.values()
    driven = sum(map(driven_joules, every))
    predicted = sum(map(predicted_joules, every))
    sure = [_sentence_of(checks, analyses)]
    if predicted > 0.0:
        sure.insert(
            0,
            f"One {next(iter(every)).recording.origin} run: "
            f"{percent(deviation(driven, predicted))} against the plan, which knows no waits "
            "for signals.",
        )
    if cycle is None:
        words = "No cycle of all robots was driven to its end, or its energy is not known."
        return Answer("A year is not known", words, sure)
    year = costs.energy_of_year(cycle)
    idle = _idle_of_all(analyses, costs)
    taken = f"{kilowatt_hours(year.value)}, {kilograms(costs.co2(year.value))} CO2"
    result, words = year_in_words(year, idle, taken, costs)
    hours = "" if idle is None else payback(idle.money, costs)
    words += f" What nights save {hours}." if hours else ""
    part = cycle.energy / costs.parts_per_cycle
    each = f"Parts: {money_of_thousand(part, costs)}"
    rest = [f"What nights save is {idle.basis}."] if idle is not None else []
    return Answer(
        result,
        f"{_ALL.get(len(analyses), f'All {len(analyses)} robots')}: {words}",
        [*sure, *rest],
        _to_do(analyses, cycle, costs),
        [each, *a_night(idle, costs)],
        counted=counted_at(costs),
    )


_ALL = {1: "One robot", 2: "Both robots"}


def _sentence_of(checks: Sequence[Finding], analyses: Mapping[str, Analysis]) -> str:
    """The verdict over all checks, with what was found between the robots: those of a robot, whose
    names begin with it, stand on its own page.
    """
    between = [check for check in checks if check.name.partition(":")[0] not in analyses]
    found = ", ".join(f"{each.name} {number(each.measured, each.unit)}" for each in between)
    kind = checked(checks)[1]
    words = f"{kind[0].upper()}{kind[1:]}"
    return f"{words}; {found}." if 0 < len(between) <= _SAID else f"{words}."


_SAID = 4  # checks between robots, in a sentence: more stand in their table


def _picture(analyses: Mapping[str, Analysis], cycle: Production | None, costs: Costs) -> str:
    """A year of all robots, and what rest outside of the shifts saves of it."""
    if cycle is None:
        return ""
    driven = RunNow(DRIVEN, costs.energy_of_year(cycle).value, cycle.origin)
    said = f", {cycles_of_year(cycle.pace, costs)}"
    return Paid(None, 0.0, _idle_of_all(analyses, costs), said, driven=driven).picture(costs)


def _to_do(analyses: Mapping[str, Analysis], cycle: Production, costs: Costs) -> list[str]:
    """What rest outside of the shifts saves, and who waits for the others."""
    idle = _idle_of_all(analyses, costs)
    said = []
    if idle is not None:
        said += first_steps((), idle, costs)
    waits = {name: sum(waited(a).values()) / cycle.cycles for name, a in analyses.items()}
    longest = max(waits, key=lambda name: waits[name])
    if waits[longest] > _LONG_WAIT * cycle.seconds:
        said.append(
            f"Of each cycle of {seconds(cycle.seconds)} {longest} waits "
            f"{seconds(waits[longest])} for signals: it may move slower, or take over work."
        )
    return said


def _idle_of_all(analyses: Mapping[str, Analysis], costs: Costs) -> IdleSaving | None:
    """What hibernation of all saves outside of the shifts; None where it is not known of one."""
    every = list(analyses.values())
    saves = [saved for analysis in every if (saved := rest_saving(analysis)) is not None]
    if len(saves) < len(every):
        return None
    measured = all(map(rest_measured, every))
    return idle_saving(_rests_of_all(analyses), sum_of(saves), costs, measured=measured)


_LONG_WAIT = 0.05  # of a cycle: less is no work worth moving


def _tiles(analyses: Mapping[str, Analysis], cycle: Production | None, costs: Costs) -> list[Tile]:
    """A year, a part, the common peak, and how long they waited for each other."""
    cycles = cycle.cycles if cycle is not None else 1.0
    waits = [f"{name} {seconds(sum(waited(a).values()) / cycles)}" for name, a in analyses.items()]
    shown = []
    if cycle is not None:
        part = cycle.energy / costs.parts_per_cycle
        price = money_of_thousand(part, costs)
        made = f"mean of {counted(round(cycles), 'cycle')} of {seconds(cycle.seconds)}"
        shown = [
            yearly_tile(cycle, costs),
            Tile("energy a part", watt_hours(part), (price, made)),
            _demand(analyses, costs),
        ]
    return [
        *shown,
        Tile("common peak", watts(common_peak(analyses)), ("of a 10 ms reading",)),
        Tile("waited for signals, a cycle", waits[0], tuple(waits[1:])),
    ]


def _demand(analyses: Mapping[str, Analysis], costs: Costs) -> Tile:
    """The largest quarter of an hour of all together, and its price where one is given."""
    rests = _rests_of_all(analyses)
    found = demand_of(common_demand(analyses), rests, costs, planned=False)
    said = (found.words, "mean power of all robots", demand_note(found.watts, costs))
    return Tile("largest quarter of an hour", watts(found.watts), said)


def _rests_of_all(analyses: Mapping[str, Analysis]) -> dict[str, float]:
    """W at rest of all robots together, by power mode that each of them knows."""
    rests = [idle_watts(analysis) for analysis in analyses.values()]
    known = set.intersection(*map(set, rests)) if rests else set()
    return {mode: sum(rest[mode] for rest in rests) for mode in rests[0] if mode in known}


def _table(analyses: Mapping[str, Analysis], cycle: Production | None, costs: Costs) -> str:
    """Each robot and all together: what a part takes, and the whole run."""
    heads = ("robot", ">a part", ">energy", ">predicted", ">time", ">waited for signals", ">peak")
    every = analyses.values()
    span = _whole(analyses)
    parts = [_part(_taken(analysis, span), cycle, costs) for analysis in every]
    rows = [
        (
            f'<a href="{text(robot)}.html">{text(robot)}</a>'
            f"<small>{counted(len(analysis.steps), 'step')}</small>",
            _part_cell(part, costs),
            watt_hours(driven_joules(analysis)),
            watt_hours(predicted_joules(analysis)),
            seconds(program_span(analysis).seconds),
            seconds(sum(waited(analysis).values())),
            watts(analysis.peak_power),
        )
        for (robot, analysis), part in zip(analyses.items(), parts, strict=True)
    ]
    rows.append(
        (
            f"<b>all together</b><small>{sum(len(a.steps) for a in every)} steps</small>",
            _part_cell(sum(parts), costs),
            watt_hours(sum(map(driven_joules, every))),
            watt_hours(sum(map(predicted_joules, every))),
            seconds(span.seconds),
            DASH,
            watts(common_peak(analyses)),
        )
    )
    hint = (
        "A part: the mean of all cycles, with what a robot takes while it waits for the end of the "
        "others. Energy, prediction and time are of the whole run, each robot until its own end; "
        "the peaks of robots come at different times."
    )
    hint = f"{hint} {counted_with(costs)}"
    return f'{table(heads, rows, "Robots")}<p class="hint">{hint}</p>'


def _part(joules: float, cycle: Production | None, costs: Costs) -> float:
    """Joules of a part, of so many of the run; NaN where they aren't known."""
    return np.nan if cycle is None else joules / cycle.cycles / costs.parts_per_cycle


def _part_cell(joules: float, costs: Costs) -> str:
    """Energy and money of a part."""
    if not np.isfinite(joules):
        return DASH
    return f"<b>{watt_hours(joules)}</b><small>{text(money_of_thousand(joules, costs))}</small>"


def program_span(analysis: Analysis) -> Span:
    """From the first step until the last one has ended."""
    steps = [result.step for result in analysis.steps]
    return Span(steps[0].start, steps[-1].end) if steps else Span(0.0, 0.0)


def driven_joules(analysis: Analysis) -> float:
    """Joules at the mains from the first step until the last one has ended, waits included."""
    return _taken(analysis, program_span(analysis))


def _taken(analysis: Analysis, span: Span) -> float:
    """Joules at the mains in a span; NaN without a meter."""
    power = analysis.recording.power
    if power is None:
        return float("nan")
    begin, end = np.interp([span.begin, span.end], power.time, power.energy)
    return float(end - begin)


def common_cycle(analyses: Mapping[str, Analysis]) -> Production | None:
    """The mean cycle of all robots together, from the first step of any until the last one of all
    has ended: who is done sooner waits. None where a robot has no whole cycle of known energy.
    """
    span = _whole(analyses)
    own = [production_of(analysis) for analysis in analyses.values()]
    cycles = min((each.cycles for each in own if each is not None), default=0.0)
    energy = sum(_taken(analysis, span) for analysis in analyses.values())
    if None in own or cycles < 1.0 or not np.isfinite(energy):
        return None
    joules = energy / cycles
    origin = next(iter(analyses.values())).recording.origin
    return Production("all robots", origin, span.seconds / cycles, joules, joules, joules, cycles)


def common_demand(analyses: Mapping[str, Analysis]) -> float:
    """The largest mean power [W] of a quarter of an hour of all robots together, what was driven
    repeated without a pause.
    """
    span = _whole(analyses)
    meters = [a.recording.power for a in analyses.values() if a.recording.power is not None]
    inside, _ = together(meters)
    inside = inside[(inside > span.begin) & (inside < span.end)]
    times = np.concatenate(([span.begin], inside, [span.end]))
    joules = np.sum([np.interp(times, m.time, m.energy) for m in meters], axis=0)
    return largest_quarter(np.diff(times), np.diff(joules))


def predicted_joules(analysis: Analysis) -> float:
    """Joules of the steps, as planned."""
    return sum(result.step.movement.report.energy for result in analysis.steps)


def waited(analysis: Analysis) -> dict[str, float]:
    """Seconds between two steps, by the signals that the second one waited for."""
    found: dict[str, float] = {}
    for before, result in zip(analysis.steps, analysis.steps[1:], strict=False):
        names = " ".join(result.step.movement.wait_for)
        if names:
            late = max(result.step.start - before.step.end, 0.0)
            found[names] = found.get(names, 0.0) + late
    return found


def common_peak(analyses: Mapping[str, Analysis]) -> float:
    """The largest power at the mains of all robots at one time [W]."""
    meters = [a.recording.power for a in analyses.values() if a.recording.power is not None]
    if not meters:
        return float("nan")
    _, total = together(meters)
    return float(total.max(initial=0.0))


def _whole(analyses: Mapping[str, Analysis]) -> Span:
    spans = [program_span(analysis) for analysis in analyses.values() if analysis.steps]
    if not spans:
        return Span(0.0, 0.0)
    return Span(min(span.begin for span in spans), max(span.end for span in spans))


_KINDS = {
    "loaded": "robot moves, or is in a zone",
    "empty": "pause of the program",
    "late": "two robots in one zone",
}


def _both_inside(passes: Mapping[str, Sequence[Span]]) -> list[Bar]:
    """When two robots were in a zone together, which takes turns."""
    (one, spans), (other, its_spans) = passes.items()
    overlaps = (
        Span(max(span.begin, its.begin), min(span.end, its.end))
        for span in spans
        for its in its_spans
    )
    words = f"{one} and {other} together"
    return [("late", each, words) for each in overlaps if each.seconds > STAMPS]


def _figure(analyses: Mapping[str, Analysis]) -> str:
    span = _whole(analyses)
    if span.seconds <= 0.0:
        return '<p class="empty">No program was driven.</p>'
    chart = Gantt(span)
    for robot, analysis in analyses.items():
        chart.lane(robot, [_bar(result) for result in analysis.steps])
        if analysis.recording.power is not None:
            chart.lane("mode", mode_bars(analysis.recording.power, span))
    for signal, passes in zone_passes(analyses).items():
        both = _both_inside(passes)
        for robot, spans in passes.items():
            inside = [("loaded", each, f"{robot} in {signal}") for each in spans]
            chart.lane(f"{signal}: {robot}", [*inside, *both])
    chart.power([a.recording.power for a in analyses.values() if a.recording.power is not None])
    drawn = chart.drawn("robots", "robots, zones and power")
    waits = '<p class="hint">Where nothing is drawn a robot waits for its turn.</p>'
    return f'{waits}{legend(_KINDS)}<figure class="figure">{drawn}</figure>'


def _bar(result: StepResult) -> Bar:
    step = result.step
    style = "empty" if step.movement.is_pause else "loaded"
    return style, Span(step.start, step.end), step.label
