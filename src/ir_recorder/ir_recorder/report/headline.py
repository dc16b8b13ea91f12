"""The top of the page: the source of the figures, the verdict, and what people look for first."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from datetime import UTC, datetime, timedelta

from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.savings import ProgramSavings, one_sided
from ir_recorder.analysis import Analysis, Finding, ProgramTotals, Share, Verdict, summary
from ir_recorder.analysis.production import (
    DRIVES_ONLY,
    PREDICTED,
    Amount,
    Production,
    deviation,
    driven_and_predicted,
    drives_only,
    levers,
    planned_clearance,
    production_of,
    saved_amount,
)
from ir_recorder.format.contents import OWN_FACTS, VERSION
from ir_recorder.reading.recording import Recording
from ir_recorder.report.answer import Answer
from ir_recorder.report.cycle_costs import cycles_of_year, money_of_thousand
from ir_recorder.report.methods import counted
from ir_recorder.report.money_text import yearly_money
from ir_recorder.report.nights import IdleSaving, recorded_idle_saving
from ir_recorder.report.number_text import (
    interval,
    kilograms,
    kilowatt_hours,
    millimetres,
    modes_as_words,
    number,
    percent,
    seconds,
    share,
    span_of,
    text,
    watts,
)
from ir_recorder.report.paid import (
    MOVEMENTS,
    PAUSES,
    Before,
    Paid,
    RunNow,
    Tile,
    a_night,
    between_of,
    counted_at,
    first_steps,
    reached_saving,
)
from ir_recorder.report.prices import Costs
from ir_recorder.report.program_names import (
    COMMON,
    DRIVEN,
    PLANNED,
    computed_words,
    driven_detail,
    origin_of,
)
from ir_recorder.report.quarter_hour import demand_note, recorded_demand

_STYLES = {Verdict.HOLDS: "good", Verdict.FAILS: "bad", Verdict.NOT_CHECKED: "open"}


_PREDICTED = "predicted, not driven"


def subtitle(analysis: Analysis) -> str:
    """File, start, length and energy of the whole recording."""
    recording = analysis.recording
    start = started(recording)
    version = recording.fact(VERSION)
    supply = f"({DRIVES_ONLY})" if drives_only(analysis) else "at the mains"
    length = f", recorded {seconds(recording.duration)}, {kilowatt_hours(analysis.energy)} {supply}"
    if recording.never_driven:
        length = ""
    return text(
        f"{recording.path.name}, {start:%Y-%m-%d %H:%M:%S} UTC{length}"
        + (f", recorder {version}" if version else "")
    )


def started(recording: Recording) -> datetime:
    """When a recording begins, by the clock of its nodes."""
    return datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=recording.start_ns * 1e-9)


def plant_of(analysis: Analysis) -> str:
    """Whether the figures are simulated or measured, and the plant's name."""
    plant = analysis.recording.plant
    saved = not analysis.steps and not analysis.recording.hardware and analysis.savings is not None
    if analysis.recording.only_planned or saved:
        return _PREDICTED
    return f"{analysis.recording.origin}, plant {plant}" if plant else analysis.recording.origin


def source(analysis: Analysis) -> str:
    """Whether the figures are simulated, and by which plant."""
    hardware = analysis.recording.hardware
    if not hardware and (
        analysis.recording.only_planned or (not analysis.steps and analysis.savings is not None)
    ):
        return '<p class="source open"><b>Predicted</b> a plan that was not driven</p>'
    if not hardware:
        return '<p class="source open">plant not recorded</p>'
    style = analysis.recording.origin
    kind = "Simulated, not measured" if style == "simulated" else "Measured"
    what = hardware.removesuffix(", simulated")
    plant = analysis.recording.plant
    what += f", plant {plant}" if plant else ""
    return f'<p class="source {style}"><b>{kind}</b> {text(what)}</p>'


def checked(checks: Sequence[Finding], analysis: Analysis | None = None) -> tuple[Verdict, str]:
    """The verdict over all checks in a sentence; of a plan that was not driven, what was proved."""
    if analysis is not None and only_proved(checks, analysis):
        proved = analysis.recording.planned_certified
        kind = Verdict.HOLDS if proved else Verdict.NOT_CHECKED
        return (
            kind,
            f"{'' if proved else 'not '}proved: no collision, within limits, at every instant",
        )
    return summary(tuple(checks))


_NAMED = 3  # of failing checks, beside the verdict


def failing(checks: Sequence[Finding]) -> str:
    """The first checks that fail, each with what was found and what is allowed; "" without one."""
    failed = [check for check in checks if check.verdict is Verdict.FAILS]
    if not failed:
        return ""
    items = [
        f"{modes_as_words(check.name)}: {number(check.measured, check.unit)}, allowed "
        f"{interval(check.low, check.high, check.unit)}"
        for check in failed[:_NAMED]
    ]
    if len(failed) > _NAMED:
        items.append(f"{len(failed) - _NAMED} more below, at Checks")
    listed = "".join(f"<li>{text(item)}</li>" for item in items)
    head = "The check that fails" if len(failed) == 1 else "Checks that fail"
    return f'<div class="problems"><b>{head}</b><ul>{listed}</ul></div>'


def verdict(checks: Sequence[Finding], analysis: Analysis | None = None) -> str:
    """The verdict over all checks; green only where every check was made and holds, or a plan that
    was not driven is proved.
    """
    kind, sentence = checked(checks, analysis)
    if kind is Verdict.HOLDS and analysis is not None and analysis.program is not None:
        simulated = analysis.recording.origin == "simulated"
        where = "driven in simulation" if simulated else "driven"
        sentence = f"{where}: {len(checks)} checks of safety, time and energy hold"
    words = sentence[0].upper() + sentence[1:]
    place = "steps" if analysis is not None and only_proved(checks, analysis) else "checks"
    return f'<p class="verdict {_STYLES[kind]}"><a href="#{place}">{text(words)}</a></p>'


def only_proved(checks: Sequence[Finding], analysis: Analysis) -> bool:
    """Whether a plan was not driven, so that there is its proof and nothing to check."""
    made = any(check.verdict is not Verdict.NOT_CHECKED for check in checks)
    return analysis.recording.only_planned and not made


def notes(analysis: Analysis) -> str:
    """Facts of this run from the recorder's parameter, as shortened transitions."""
    facts = [(key, value) for key, value in analysis.recording.facts if key not in OWN_FACTS]
    if not facts:
        return ""
    items = "".join(
        f"<li>{text(key.replace('_', ' '))} <b>{text(value)}</b></li>" for key, value in facts
    )
    return f'<ul class="notes"><li class="head">Settings of this run</li>{items}</ul>'


def tiles(analysis: Analysis, costs: Costs | None = None) -> str:
    """A year, the cycle and its peak; those of the program where one was executed."""
    program = analysis.program
    prices = costs or Costs()
    cycle = production_of(analysis)
    paid: list[Tile] = []
    if cycle is not None:
        paid += [yearly_tile(cycle, prices), _demand(analysis, cycle, prices)]
    if analysis.recording.only_planned and program is None:
        return _html([*paid, *driven_tiles(analysis)])
    if program is None:
        none = Tile("program", "none executed", ("figures of the whole recording only",))
        return _html([*paid, none, *driven_tiles(analysis)])
    whole = _unshortened(program, cycle) or _whole(analysis, program)
    return _html([*paid, whole, _peak(analysis)])


def _demand(analysis: Analysis, cycle: Production, costs: Costs) -> Tile:
    found = recorded_demand(analysis, cycle, costs)
    return Tile(
        "largest quarter of an hour",
        watts(found.watts),
        (found.words, demand_note(found.watts, costs), origin_of(cycle), cycle.supply),
    )


def driven_tiles(analysis: Analysis) -> list[Tile]:
    """What was driven: its energy with what was predicted, its peak, and its least clearance; of a
    plan that was not driven what is predicted.
    """
    program = analysis.program
    if analysis.recording.only_planned and program is None:
        return _planned(analysis)
    energy = _recorded(analysis) if program is None else _whole(analysis, program)
    return [energy, _peak(analysis), _clearance(analysis)]


def _peak(analysis: Analysis) -> Tile:
    origin = analysis.recording.origin
    return Tile("peak power", watts(analysis.peak_power), (f"of a 10 ms reading, {origin}",))


def answer(analysis: Analysis, costs: Costs) -> str:
    """What those who pay ask first, as on every page, and a year as a picture; "" where no whole
    cycle is known.
    """
    cycle = production_of(analysis)
    if cycle is None:
        return ""
    paid = _paid(analysis, costs)
    if cycle.savings is None:
        shown = _without_saving(analysis, cycle, paid, costs).html()
        return shown + paid.picture(costs)
    total = cycle.savings.total
    count = costs.cycles_per_year(cycle.pace)
    steps = [
        (saved_amount(saving).times(count).of(costs.money), words)
        for words, saving in (
            (MOVEMENTS, cycle.savings.movements),
            (PAUSES, cycle.savings.pauses),
        )
    ]
    each = 1.0 / costs.parts_per_cycle
    then = total.planned if analysis.program is None else cycle.energy
    part = (total.common * each, then * each)
    return paid.answer(costs, steps, part).html() + paid.picture(costs)


def _without_saving(analysis: Analysis, cycle: Production, paid: Paid, costs: Costs) -> Answer:
    """What a year costs, where nobody knows what a plan saves of it."""
    energy = costs.energy_of_year(cycle)
    taken = f"{kilowatt_hours(energy.value)}, {kilograms(costs.co2(energy.value))} CO2"
    count = costs.cycles_per_year(cycle.pace)
    steps = [
        (Amount.of_value(costs.money(lever.joules * count)), f"{lever.name}, at most")
        for lever in levers(analysis)
    ]
    do = first_steps(steps, paid.idle, costs)
    if analysis.recording.only_planned:
        do.append(NO_COMPARISON)
    part = money_of_thousand(cycle.energy / costs.parts_per_cycle, costs)
    tending = analysis.tending
    beside = ""
    if tending is not None:
        parts = tending.steady or tending.parts
        planned = sum(part.planned_joules for part in parts) / len(parts)
        beside = (
            f"A part takes {kilowatt_hours(cycle.energy)}, as predicted {kilowatt_hours(planned)}."
        )
    elif analysis.program is not None:
        beside = _of_run(analysis, cycle)
    name = f"{cycle.name[0].upper()}{cycle.name[1:]}"
    origin = f"{name}." if cycle.origin in cycle.name else f"{name}, {cycle.origin}."
    limit = f"{cycle.supply[0].upper()}{cycle.supply[1:]}." if cycle.supply else ""
    return Answer(
        *year_in_words(energy, paid.idle, taken, costs, planned=analysis.program is None),
        [each for each in (origin, beside, limit, _nights_rest_on(paid.idle)) if each],
        do,
        [f"Parts: {part}", *a_night(paid.idle, costs)],
        _between_shifts(energy, paid.idle, costs),
        counted=counted_at(costs),
    )


def _between_shifts(energy: Amount, idle: IdleSaving | None, costs: Costs) -> str:
    """The 90 % interval of a year of energy [J] in shifts; "" without one."""
    between = between_of(energy.of(costs.money), costs)
    return f"in shifts: {between}" if between and idle is not None else between


NO_COMPARISON = (
    "No comparison in this file: ir plan CELL --saving -o FILE or ir compare CELL holds it against "
    "the common program, and counts as many cycles a year as that makes"
)


def year_in_words(
    energy: Amount, idle: IdleSaving | None, taken: str, costs: Costs, *, planned: bool = False
) -> tuple[str, str]:
    """What a year of energy [J] in shifts costs, nights and weekends with it where they are known:
    in a few words, and its parts. planned: a plan rests in its deepest mode outside of shifts, a
    robot that was driven on closed brakes.
    """
    shifts = costs.money(energy.value)
    if idle is None:
        nights = "Nights and weekends aren't known" if costs.idle_hours > 0.0 else "No nights"
        return f"{yearly_money(shifts, costs.currency)} a year", f"In shifts: {taken}. {nights}."
    rest, how = (
        (idle.deepest, f"in {idle.mode}") if planned else (idle.left_alone, "on closed brakes")
    )
    inside, outside = (yearly_money(each, costs.currency) for each in (shifts, rest))
    return (
        f"{yearly_money(shifts + rest, costs.currency)} a year",
        f"{inside} in shifts ({taken}), {outside} at night and at weekends, {how}.",
    )


def _nights_rest_on(idle: IdleSaving | None) -> str:
    return "" if idle is None else f"Nights and weekends: {idle.basis}."


def _paid(analysis: Analysis, costs: Costs) -> Paid:
    cycle = production_of(analysis)
    idle = None
    if cycle is not None:
        idle = recorded_idle_saving(analysis, costs)
    saved = costs.saving_of_year(cycle) if cycle is not None else None
    driven = None
    if cycle is not None:
        energy = costs.energy_of_year(cycle).value
        driven = RunNow(PLANNED, energy, is_planned=True)
        if analysis.program is not None:
            driven = RunNow(DRIVEN, energy, driven_detail(cycle))
    if cycle is None or cycle.savings is None or saved is None:
        counted = "" if cycle is None else f", {cycles_of_year(cycle.pace, costs)}"
        return Paid(None, 0.0, idle, counted, driven=driven)
    total = cycle.savings.total
    common = total.common * costs.cycles_per_year(cycle.pace)
    said = f", {cycles_of_year(cycle.pace, costs)}"
    run = ""
    more = more_parts(cycle.savings, cycle.pace)
    if analysis.program is not None:
        run = _of_run(analysis, cycle)
    else:
        driven = None
    proved = analysis.recording.only_planned and analysis.recording.planned_certified
    reached = reached_saving(saved, common, driven.energy) if driven is not None else None
    return Paid(
        *(saved, common, idle, said, Before.COMMON, driven, cycle.supply, proved, run, more),
        reached=reached,
    )


def _of_run(analysis: Analysis, cycle: Production) -> str:
    """What was driven against what was predicted of it, and what of its cycle nobody drove."""
    found, predicted = driven_and_predicted(analysis)
    origin = analysis.recording.origin
    said = f"The run took {kilowatt_hours(found)} ({origin})"
    if math.isfinite(predicted):
        said += (
            f", {percent(deviation(found, predicted))} against the {kilowatt_hours(predicted)} "
            "predicted of it, waits between steps included"
        )
    computed = computed_words(cycle)
    if computed:
        said += f". A cycle takes {kilowatt_hours(cycle.energy)}, {computed}"
    return f"{said}."


def more_parts(savings: ProgramSavings, pace: float) -> str:
    """How many more parts an hour a program with so many seconds [s] from one cycle to the next
    makes than the common program, in words; "" where both make as many.
    """
    if savings.common_seconds <= 0.0:
        return ""
    more = 100.0 * (savings.common_seconds / pace - 1.0)
    return (
        f"{abs(more):.1f} % {'more' if more >= 0.0 else 'fewer'} parts an hour, one cycle each "
        f"{seconds(pace)} instead of {seconds(savings.common_seconds)}"
    )


def run_tiles(analysis: Analysis) -> str:
    """The figures of the run, for engineers; "" where no program was executed."""
    program = analysis.program
    if program is None:
        return ""
    parts = _parts(program, analysis.recording.origin)
    own = _html([_whole(analysis, program), *parts, _clearance(analysis)])
    return (
        '<details class="part paper" id="run"><summary><h2>This run in figures</h2></summary>'
        f'<div class="tiles">{own}</div></details>'
    )


def _html(shown: Sequence[Tile | None]) -> str:
    return "".join(tile.html() for tile in shown if tile is not None)


def _planned(analysis: Analysis) -> list[Tile]:
    """Figures of a plan that was not driven, all predicted."""
    steps = analysis.recording.planned
    tiles = []
    cycle = production_of(analysis)
    if cycle is not None:
        within = (cycle.low, cycle.high)
        known = cycle.low < cycle.high
        spread = f"90 % interval {span_of(*within, kilowatt_hours)}" if known else ""
        why = _says(one_sided(cycle.energy, *within))
        slower = cycle.savings is not None and cycle.seconds > planned_seconds(steps) + _SOONER
        whose = f"the {COMMON}'s " if slower else ""
        said = f"in {whose}{seconds(cycle.seconds)}, predicted"
        tiles.append(Tile("planned program", kilowatt_hours(cycle.energy), (said, spread, why)))
    near = millimetres(planned_clearance(steps))
    proved = analysis.recording.planned_certified
    proof = "proved: free of collision and within all limits" if proved else ""
    lines = ("planned, without pairs that may touch", proof)
    return [*tiles, Tile("least clearance", near, lines)]


def planned_seconds(steps: Sequence[PlannedMovement]) -> float:
    """How long the steps of a plan take [s], as fast as pays."""
    return sum(step.duration for step in steps)


_SOONER = 0.01  # s: as seconds are shown


def _recorded(analysis: Analysis) -> Tile:
    note = f"mean {watts(analysis.mean_power)} over {seconds(analysis.seconds)}"
    if drives_only(analysis):
        return Tile("energy", kilowatt_hours(analysis.energy), (note, DRIVES_ONLY))
    return Tile("energy at the mains", kilowatt_hours(analysis.energy), (note,))


def _whole(
    analysis: Analysis, program: ProgramTotals, show: Callable[[float], str] = kilowatt_hours
) -> Tile:
    whole = program.whole
    shortened = program.unshortened is not None
    _, planned = driven_and_predicted(analysis)
    whole_cycle = production_of(analysis) is not None or not math.isfinite(whole.energy)
    name = "program, one cycle" if whole_cycle else "program, not driven to its end"
    if analysis.tending is not None and whole_cycle:
        name = f"program, {counted(len(analysis.tending.parts), 'part')}"
    return Tile(
        "this run, pauses shortened" if shortened else name,
        show(whole.energy),
        (
            f"in {seconds(whole.seconds)}",
            f"predicted {show(planned)}{_within(analysis, show)}, "
            f"{_against(whole.energy, planned, analysis.recording.origin)}",
            _why(analysis),
        ),
    )


def _within(analysis: Analysis, show: Callable[[float], str]) -> str:
    """The interval of what was predicted: the sum of the steps', as what is unsure is so in all
    alike.
    """
    _, low, high = _sums(analysis)
    return f" (90 % interval {span_of(low, high, show)})" if high > 0.0 else ""


def _why(analysis: Analysis) -> str:
    """Why the interval of what was predicted is one-sided, where it is."""
    return _says(one_sided(*_sums(analysis)))


def _says(why: str) -> str:
    return f"the interval lies {why}" if why else ""


def _sums(analysis: Analysis) -> tuple[float, float, float]:
    reports = [result.step.movement.report for result in analysis.steps]
    return (
        sum(report.energy for report in reports),
        sum(report.energy_low for report in reports),
        sum(report.energy_high for report in reports),
    )


def _unshortened(program: ProgramTotals, cycle: Production | None) -> Tile | None:
    full = program.unshortened
    if full is None:
        return None
    cut = (
        f"pauses in power modes {seconds(full.full_pauses)}, in the run {seconds(full.run_pauses)}"
    )
    if math.isnan(full.energy) or cycle is None:
        return Tile(
            "cycle with full pauses", "not known", ("the pauses of the run don't match the cell's",)
        )
    return Tile(
        "cycle with full pauses",
        kilowatt_hours(full.energy),
        (cut, computed_words(cycle)),
    )


def yearly_tile(cycle: Production, costs: Costs) -> Tile:
    """What a year of such cycles costs in the shifts."""
    energy = costs.energy_of_year(cycle).value
    co2 = f"{kilowatt_hours(energy)}, {kilograms(costs.co2(energy))} CO2"
    price = yearly_money(costs.money(energy), costs.currency)
    made = cycles_of_year(cycle.pace, costs)
    lines = (made, co2, computed_words(cycle), cycle.supply)
    how = "planned" if cycle.origin == PREDICTED else "as driven"
    return Tile(f"costs a year in shifts, {how}", price, lines)


def _parts(program: ProgramTotals, origin: str) -> list[Tile]:
    parts = [
        _part("movements", program.movements, program.planned_movements, program.whole, origin),
        _part("pauses", program.pauses, program.planned_pauses, program.whole, origin),
    ]
    waiting = program.waiting
    of_run = share(waiting.energy, program.whole.energy)
    said = f"{seconds(waiting.seconds)}, {of_run} of the run's energy"
    lines = (said, "signals and answers; in no plan")
    return [*parts, Tile("waiting between steps", kilowatt_hours(waiting.energy), lines)]


def _part(name: str, found: Share, planned: Share, whole: Share, origin: str) -> Tile:
    of_run = share(found.energy, whole.energy)
    compared = _against(found.energy, planned.energy, origin)
    against = f"predicted {kilowatt_hours(planned.energy)}, {compared}"
    return Tile(
        name,
        kilowatt_hours(found.energy),
        (f"{seconds(found.seconds)}, {of_run} of the run's energy", against),
    )


def _against(found: float, planned: float, origin: str) -> str:
    return f"{origin} {percent(deviation(found, planned))}"


def _clearance(analysis: Analysis) -> Tile:
    least = min(
        (r.clearance.least for r in analysis.movements if r.clearance is not None), default=math.nan
    )
    kept = analysis.safety_distance
    bound = (
        "safety distance not recorded"
        if math.isnan(kept)
        else f"safety distance {millimetres(kept)}"
    )
    return Tile(
        "least clearance", millimetres(least), (bound, "executed, without pairs that may touch")
    )
