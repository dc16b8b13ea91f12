"""Page of today's program beside the planner's: figures with intervals, changes, both motions."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ir_description import Cell
from ir_msgs_py.savings import BeforeAfter, Side, StepChange, largest_quarter, one_sided
from ir_recorder.analysis.production import (
    DRIVES_ONLY,
    OPEN,
    Amount,
    all_rests_measured,
    home_watts,
    saved_amount,
    saved_at_rest,
)
from ir_recorder.report.cell_scene import cell_scene
from ir_recorder.report.charts import Point, front_part
from ir_recorder.report.cycle_costs import cycles_of_year, share_between
from ir_recorder.report.files import write_output
from ir_recorder.report.money_text import yearly_money, yearly_span
from ir_recorder.report.motion_scene import common_rests, in_step, motion_of, power_curves, rests_of
from ir_recorder.report.nights import IdleSaving, how_to_hibernate, idle_saving
from ir_recorder.report.number_text import (
    DASH,
    ENGLISH,
    joules,
    kilograms,
    kilowatt_hours,
    millimetres,
    seconds,
    span_of,
    text,
    watt_hours,
    watts,
)
from ir_recorder.report.page import PAGE_START, asset, filled, folded
from ir_recorder.report.paid import MOVEMENTS, PAUSES, Before, Paid, Tile, at_night, row_of
from ir_recorder.report.prices import (
    J_PER_KWH,
    Costs,
    assumed_section,
    counted_with,
    following_price,
)
from ir_recorder.report.program_names import COMMON, PLANNED
from ir_recorder.report.quarter_hour import Demand, demand_note, demand_of
from ir_recorder.report.series import long_rests
from ir_recorder.report.shell import badge
from ir_recorder.report.step_table import TableValue, write_columns
from ir_recorder.report.tables import bar, table
from ir_recorder.report.whole_line import line_section, of_saving
from ir_values.files import ANYWHERE, FileRoots

# Joules of a cycle as those of a shift and a year, and as money and CO2, bounds included.


@dataclass(frozen=True)
class Year:
    """A program in production: seconds [s] from one cycle to the next, its cycles, the energy [J]
    of a shift and of a year, and what it saves a year [J]. fit_a_shift: cycles that it can make;
    fewer where it takes longer than those that are counted.
    """

    pace: float
    cycles_a_shift: float
    cycles_a_year: float
    fit_a_shift: float
    shift: Amount
    energy: Amount
    saved: Amount


def year_of(found: BeforeAfter, side: Side, costs: Costs) -> Year:
    """A side in production: as many cycles as today's program makes, or as the line asks for."""
    asked = side.cycle_time if side.cycle_time > 0.0 and side is not found.today else 0.0
    pace = asked or found.today.report.duration
    shift = costs.cycles_per_shift(pace)
    year = costs.cycles_per_year(pace)
    report = side.report
    saving = side.saving
    cycle = Amount(report.energy, report.energy_low, report.energy_high)
    saved = saved_amount(saving)
    fit = costs.cycles_per_shift(max(report.duration, 1e-9))
    return Year(pace, shift, year, fit, cycle.times(shift), cycle.times(year), saved.times(year))


# Figures of today's program and of the planner's as tables: each energy with its 90 % interval.

MODE = 1
WORK = {MODE: "a power mode", 2: "other times on the same path", 3: "another path"}
_MEANINGS = {
    "same cycle time": "the planner's, in the same time",
    "free": "the planner's, as fast as pays (--time-value)",
    "for the line": "the planner's, in the time that the line asks for",
}
Show = Callable[[float], str]
_FIT = 0.999  # of the cycles: fewer are said
_FEW = 100.0  # cycles a shift: fewer are shown with a decimal, as they are counted


def paid_row(found: BeforeAfter, cell: Cell, costs: Costs) -> str:
    """What those who pay ask first, of the side that the changes lead to; a year as a picture."""
    side = found.planned
    year = year_of(found, side, costs)
    paid = _paid(found, cell, costs)
    steps = [
        (saved_amount(saving).times(year.cycles_a_year).of(costs.money), words)
        for words, saving in ((MOVEMENTS, side.moving), (PAUSES, side.resting))
    ]
    each = 1.0 / costs.parts_per_cycle
    part = (side.saving.common * each, side.report.energy * each)
    return paid.answer(costs, steps, part).html() + paid.picture(costs)


def _paid(found: BeforeAfter, cell: Cell, costs: Costs) -> Paid:
    side = found.planned
    year = year_of(found, side, costs)
    today = side.saving.common * year.cycles_a_year
    counted = f", {cycles_of_year(year.pace, costs)}"
    idle = _idle(found, cell, costs)
    before = program_before(found)
    return Paid(year.saved, today, idle, counted, before, proved=side.certified)


def tiles(found: BeforeAfter, cell: Cell, costs: Costs) -> str:
    """The year's saving in its parts and the cycle in figures, of the side that the changes lead
    to.
    """
    side = found.planned
    report = side.report
    today = found.today.report
    saving = side.saving
    word, cycle = saved_amount(saving).gain()
    quarter, quarter_before = (_demand_of(found, each, cell, costs) for each in (side, found.today))
    before = program_before(found)
    return row_of(
        [
            Tile(
                f"{word} a cycle",
                kilowatt_hours(cycle.value),
                (
                    saving.change,
                    share_between(cycle, saving.common),
                    "" if saving.certain else OPEN,
                ),
            ),
            Tile(
                "cycle time",
                seconds(report.duration),
                (f"{before} {seconds(today.duration)}", f"{seconds(_standing(side))} of it pauses"),
            ),
            Tile(
                "largest quarter of an hour",
                watts(quarter.watts),
                (
                    quarter.words,
                    f"{before} {watts(quarter_before.watts)}: {quarter_before.words}",
                    demand_note(quarter.watts, costs),
                ),
            ),
            Tile(
                "peak power",
                watts(report.peak_power),
                (
                    f"90 % interval {span_of(*side.peak, watts)}",
                    one_sided(report.peak_power, *side.peak),
                    f"{before} {watts(today.peak_power)}",
                    "of a 10 ms reading",
                ),
            ),
        ]
    )


def program_before(found: BeforeAfter) -> Before:
    """What the planned program is held against."""
    return Before.COMMON if found.kind == COMMON else Before.TODAY


def shown_name(found: BeforeAfter, side: Side) -> str:
    """A side as all pages call it: the program before, the planned one that changes lead to, and
    others by what they are asked for.
    """
    if side is found.today:
        return program_before(found)
    return PLANNED if side is found.planned else f"{PLANNED}, {side.name}"


def _standing(side: Side) -> float:
    """Seconds of its pauses."""
    return sum(hop.seconds for hop in side.hops if hop.is_pause)


def figure_table(found: BeforeAfter, cell: Cell, costs: Costs) -> str:
    """Every figure, a column for each program."""
    sides = [found.today, *(side for side in found.sides if not _alike(found, side))]
    years = [year_of(found, side, costs) if side.found else None for side in sides]
    rows = [
        ("the program is", text(found.name), *(_meaning(side) for side in sides[1:])),
        ("cycle time", *(_of(side, seconds(side.report.duration)) for side in sides)),
        ("energy a cycle", *(_energy(side, kilowatt_hours) for side in sides)),
        *_a_part(sides, costs),
        (
            f"against the {program_before(found)}",
            *(_saved(side, side is found.today) for side in sides),
        ),
        ("cycles a shift", *(_cycles(year) for year in years)),
        (
            "energy a shift",
            *(_amount(year.shift if year else None, kilowatt_hours) for year in years),
        ),
        (
            "energy a year, in shifts",
            *(_amount(year.energy if year else None, kilowatt_hours) for year in years),
        ),
        (
            "costs a year, in shifts",
            *(_cost(year.energy if year else None, costs) for year in years),
        ),
        (
            "saved a year, in shifts",
            *(_cost(year.saved if year and k else None, costs) for k, year in enumerate(years)),
        ),
        ("CO2 a year, in shifts", *(_co2(year, costs) for year in years)),
        (
            "largest quarter of an hour",
            *(_demand(found, side, cell, costs) for side in sides),
        ),
        (
            "peak power",
            *(
                _of(side, watts(side.report.peak_power), span_of(*side.peak, watts))
                for side in sides
            ),
        ),
        ("least clearance", *(_of(side, millimetres(side.report.min_clearance)) for side in sides)),
        ("clearance and limits", *(_proof(side) for side in sides)),
    ]
    alike = [side.name for side in found.sides if _alike(found, side)]
    left_out = (
        f'<p class="hint">Left out, as energy and time of a cycle differ by less than 1 % from '
        f"the {PLANNED}: {text(', '.join(alike))}.</p>"
        if alike
        else ""
    )
    return table(_heads(found, sides), rows, "Figures") + left_out


def _alike(found: BeforeAfter, side: Side) -> bool:
    """Whether a side is nearly the one that the changes lead to."""
    other = found.planned
    if side is other or not side.found or side.certified != other.certified:
        return False
    own = side.report
    planned = other.report
    return (
        abs(own.energy - planned.energy) < _NEAR * planned.energy
        and abs(own.duration - planned.duration) < _NEAR * planned.duration
    )


_NEAR = 0.01  # of energy and time: programs that differ by less are one column


def quarter_of(side: Side) -> float:
    """The largest mean power [W] of a quarter of an hour of cycles of a side, one directly after
    the other, each movement and pause at its mean power.
    """
    steps = side.movements
    seconds_of = np.array([step.duration for step in steps])
    return largest_quarter(seconds_of, np.array([step.report.energy for step in steps]))


def _demand_of(found: BeforeAfter, side: Side, cell: Cell, costs: Costs) -> Demand:
    """That of all hours: what runs today rests on closed brakes at night, as in its year."""
    rests = _rests(found, cell)
    return demand_of(quarter_of(side), rests, costs, planned=side is not found.today)


def _demand(found: BeforeAfter, side: Side, cell: Cell, costs: Costs) -> str:
    if not side.found:
        return DASH
    demand = _demand_of(found, side, cell, costs)
    return _cell(watts(demand.watts), demand.words, demand_note(demand.watts, costs))


def _rests(found: BeforeAfter, cell: Cell) -> dict[str, float]:
    """W at rest outside of the shifts, by power mode; empty where it isn't known."""
    controller = cell.robot.controller
    if not controller.counted:
        return {}
    return home_watts(cell, found.planned.movements[-1].load, controller)


def _idle(found: BeforeAfter, cell: Cell, costs: Costs) -> IdleSaving | None:
    """What rest saves outside of the shifts, where the controller's power is known."""
    controller = cell.robot.controller
    if not controller.counted:
        return None
    load = found.planned.movements[-1].load
    saves = saved_at_rest(cell, load, controller)
    return idle_saving(_rests(found, cell), saves, costs, measured=all_rests_measured(controller))


def change_table(found: BeforeAfter, cell: Cell, costs: Costs) -> str:
    """Rest outside of the shifts, then the changes that save most, the least work first."""
    cycles = year_of(found, found.planned, costs).cycles_a_year
    priced = [
        (saved_amount(change.saving).times(cycles).of(costs.money), _change(change))
        for change in found.changes
    ]
    idle = _idle(found, cell, costs)
    if idle is not None:
        words = f"{at_night(idle)}, which the controller closes by itself today"
        where = f"at night and at weekends<small>{WORK[MODE]}, {idle.basis}</small>"
        priced.insert(0, (idle.money, (where, text(words), DASH)))
    most = max((price.value for price, _ in priced), default=0.0)
    whole_year = _paid(found, cell, costs).year(costs).money
    rest = whole_year.value - sum(price.value for price, _ in priced)
    rows = [
        (f"{k}. {where}", *cells, _price(price, costs), bar(price.value, most, "planned"))
        for k, (price, (where, *cells)) in enumerate(priced, start=1)
    ]
    if priced and whole_year.value > 0.0:
        other = text(yearly_money(rest, costs.currency))
        saved = found.planned.saving.saved
        left = saved - sum(change.saving.saved for change in found.changes)
        cells = (text(watt_hours(left)), other, bar(rest, most, "planned"))
        rows.append(("all other movements and pauses", "", *cells))
        cells = (_cell(watt_hours(saved)), _price(whole_year, costs), "")
        rows.append(("<b>together</b>", "", *cells))
    none = "" if found.changes else '<p class="empty">No change saves as much as a joule.</p>'
    heads = ("where", "what to do", ">saved a cycle", ">saved a year", "")
    return none + (table(heads, rows, "Changes") if rows else "")


def _price(amount: Amount, costs: Costs) -> str:
    """Money of a year with its interval."""
    ends = f"{yearly_span(amount.low, amount.high, costs.currency)} {costs.currency}"
    value = yearly_money(amount.value, costs.currency)
    return _cell(value, ends if amount.high > amount.low else "")


def _change(change: StepChange) -> tuple[str, ...]:
    saving = change.saving
    between = span_of(saving.saved_low, saving.saved_high, watt_hours)
    return (
        f"{text(change.name)}<small>{text(WORK[change.work])}{_long(change)}</small>",
        text(change.words),
        _cell(watt_hours(saving.saved), between, "" if saving.certain else OPEN),
    )


def _long(change: StepChange) -> str:
    """How long a pause is, which tells it from others at its place."""
    return f", pause of {_round(change.seconds[0])}" if change.work == MODE else ""


def _round(value: float) -> str:
    """Seconds, whole minutes as such: "30 min", "3 min"."""
    minutes = value / 60.0
    whole_ones = minutes >= 1.0 and abs(minutes - round(minutes)) < _SECOND / 60.0
    return f"{minutes:.0f} min" if whole_ones else seconds(value)


_SECOND = 0.01  # s: as seconds are shown


def hop_table(found: BeforeAfter) -> str:
    """Seconds and joules of every movement and pause, matched by their stops."""
    alike = (side for side in found.sides if side.found and not _alike(found, side))
    sides = [found.today, *alike]
    keyed = [dict(_keyed(side)) for side in sides]
    keys = list(dict.fromkeys(key for own in keyed for key in own))
    rows = [(_numbered(*key), *(own.get(key, DASH) for own in keyed)) for key in keys]
    return table(_heads(found, sides), rows, "Movements and pauses")


def _heads(found: BeforeAfter, sides: Sequence[Side]) -> tuple[str, ...]:
    """A column for each program."""
    return ("", *(f">{shown_name(found, side)}" for side in sides))


def _numbered(name: str, which: int) -> str:
    """A movement or pause; from the second of a name on with its number."""
    return text(name if which == 1 else f"{name}, number {which}")


def _keyed(side: Side) -> Sequence[tuple[tuple[str, int], str]]:
    times: dict[str, int] = {}
    found = []
    for hop in side.hops:
        if hop.seconds <= 0.0:  # it is where it has to go
            continue
        times[hop.name] = times.get(hop.name, 0) + 1
        mode = hop.power_mode.replace(">", ", ").replace("_", " ").lower()
        between = span_of(hop.energy_low, hop.energy_high, joules)
        cell = _cell(
            joules(hop.energy), between, f"{seconds(hop.seconds)}{f', {mode}' if mode else ''}"
        )
        found.append(((hop.name, times[hop.name]), cell))
    return found


def assumptions(costs: Costs) -> str:
    """What the amounts of money and their intervals mean, where they stand."""
    said = "A 90 % interval holds the true figure in nine of ten cases."
    link = '<a class="screen" href="#basis">What the figures rest on.</a>'
    return f'<p class="hint">{counted_with(costs)} {said} {link}</p>'


def basis_section(found: BeforeAfter, cell: Cell) -> str:
    """How the figures are made, a sentence for each choice; it is unfolded on paper."""
    parameters = found.today.report.power_parameters or "the data sheet"
    supply = " at the mains" if cell.robot.controller.counted else f" ({DRIVES_ONLY})"
    said = (
        f"All energies are predicted{supply}, for every program by the same model.",
        f"Their intervals follow from the uncertainty of the power parameters ({parameters}). "
        "Those of the data sheet lie mostly above their values: losses that it puts at zero can "
        "only add.",
        "The interval of what is saved is narrower than those of the programs suggest: every "
        "robot that is drawn from the uncertain parameters drives both programs.",
        "A year has as many cycles for every program as today's can make; in the column for the "
        "line as many as the line asks for, and there today's program waits at its end as well. "
        "A cycle that a shift's end cuts goes on in the next shift, so a shift has parts of one.",
    )
    items = "".join(f"<li>{text(one)}</li>" for one in said)
    return (
        '<details class="part listed paper"><summary><h2>What the figures rest on</h2>'
        f'</summary><ul id="basis">{items}</ul></details>'
    )


def _meaning(side: Side) -> str:
    return text(_MEANINGS.get(side.name, DASH))


def _cell(value: str, *smaller: str) -> str:
    return f"<b>{text(value)}</b>" + "".join(
        f"<small>{text(line)}</small>" for line in smaller if line
    )


def _of(side: Side, shown: str, *smaller: str) -> str:
    return _cell(shown, *smaller) if side.found else DASH


def _energy(side: Side, show: Show) -> str:
    report = side.report
    return _amount(
        Amount(report.energy, report.energy_low, report.energy_high) if side.found else None, show
    )


def _a_part(sides: Sequence[Side], costs: Costs) -> list[tuple[str, ...]]:
    """A row, where a cycle does not make one part."""
    if costs.parts_per_cycle == 1.0:
        return []
    parts = [
        Amount(r.energy, r.energy_low, r.energy_high).times(1.0 / costs.parts_per_cycle)
        if side.found
        else None
        for side in sides
        for r in (side.report,)
    ]
    return [("energy a part", *(_amount(part, kilowatt_hours) for part in parts))]


def _saved(side: Side, own: bool) -> str:
    if own or not side.found:
        return DASH
    saving = side.saving
    _, amount = saved_amount(saving).gain()
    between = share_between(amount, saving.common)
    doubt = "" if saving.certain else OPEN
    return _cell(saving.change, between, kilowatt_hours(amount.value), doubt)


def _cycles(year: Year | None) -> str:
    if year is None:
        return DASH
    few = year.fit_a_shift < _FIT * year.cycles_a_shift
    return _cell(
        _count(year.cycles_a_shift),
        f"only {_count(year.fit_a_shift)} fit: it is slower" if few else "",
    )


def _count(cycles: float) -> str:
    return f"{cycles:,.{1 if cycles < _FEW else 0}f}".replace(",", " ")


def _amount(amount: Amount | None, show: Show) -> str:
    if amount is None:
        return DASH
    return _cell(show(amount.value), span_of(amount.low, amount.high, show))


def _cost(energy: Amount | None, costs: Costs) -> str:
    if energy is None:
        return DASH
    return _cell(yearly_money(costs.money(energy.value), costs.currency), _money(energy, costs))


def _co2(year: Year | None, costs: Costs) -> str:
    return _amount(year.energy.of(costs.co2) if year else None, kilograms)


def _money(energy: Amount, costs: Costs) -> str:
    amount = energy.of(costs.money)
    return (
        f"{yearly_span(amount.low, amount.high, costs.currency)} {costs.currency}"
        if amount.high > amount.low
        else ""
    )


def _badge(found: BeforeAfter) -> str:
    """What is proved of the planned program, at the head of the page."""
    side = found.planned
    if not side.certified:
        return badge("Not proved: see Notes", "bad")
    kept = [step.report.safety_distance for step in side.movements if not step.is_pause]
    apart = max(kept, default=0.0)
    least = f", safety distance {millimetres(apart)} kept" if apart > 0.0 else ""
    return badge(f"Proved: no collision{least}, within limits", "good")


def _proof(side: Side) -> str:
    if not side.found:
        return text(f"none: {side.problem}")
    return '<b class="good">proved</b>' if side.certified else '<b class="bad">not certified</b>'


# One HTML file: today's program and the planner's, for those who pay and for those who change
# programs.

SCRIPTS = (
    "charts.js",
    "axes.js",
    "renderer.js",
    "motion.js",
    "player.js",
    "export.js",
    "price.js",
    "before_after.js",
)


def write_before_after(
    found: BeforeAfter,
    cell: Cell,
    path: str | Path,
    costs: Costs | None = None,
    roots: FileRoots = ANYWHERE,
) -> Path:
    """Writes the page below `roots`; its absolute path. RecorderError when it can't be written."""
    return write_output(path, before_after_html(found, cell, costs).encode(), PAGE_START, roots)


def before_after_html(found: BeforeAfter, cell: Cell, costs: Costs | None = None) -> str:
    """The page as text; without `costs` with those that are assumed."""
    prices = following_price(costs or Costs())
    there = [found.today, *(side for side in found.sides if side.found and not _alike(found, side))]
    data = {
        "end": max(side.report.duration for side in there),
        "cell": cell_scene(cell),
        "sides": [motion_of(side, cell) for side in there],
        "planned": found.towards,
        "before": program_before(found),
        "axes": [{**power_curves(there), "names": [shown_name(found, each) for each in there]}],
        "curves": {"end": max(each.end for each in in_step(there)), "rests": common_rests(there)},
        "rests": long_rests([rests_of(side) for side in there]),
    }
    parts = {
        "title": text(f"{cell.name}: {program_before(found)} and the plan compared"),
        "subtitle": text(
            f"{PLANNED} against {program_before(found)} ({found.name}, {found.kind}), same stops"
            if found.kind != COMMON
            else f"{PLANNED} against {COMMON} ({found.name}), same stops"
        ),
        "problems": _problems(found, cell),
        "proof": _badge(found),
        "how": text(how_to_hibernate(cell)),
        "paid": paid_row(found, cell, prices),
        "tiles": tiles(found, cell, prices),
        "figures": figure_table(found, cell, prices),
        "assumptions": assumptions(prices),
        "basis": basis_section(found, cell),
        "line": _line(found, cell, prices),
        "assumed": assumed_section(prices),
        "changes": change_table(found, cell, prices),
        "hops": hop_table(found),
        "front": front_part(_points(found, there)),
        "before": text(program_before(found)),
        "choices": "".join(_choice(found, side) for side in there[1:]),
        "style": asset("page.css") + asset("before_after.css"),
        "data": json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
        "script": "\n".join(asset(script) for script in SCRIPTS),
    }
    return filled(asset("before_after.html"), parts)


def _line(found: BeforeAfter, cell: Cell, costs: Costs) -> str:
    if not cell.robot.controller.counted:
        return ""
    return folded(line_section(of_saving(found.planned.saving, costs), costs))


def _problems(found: BeforeAfter, cell: Cell) -> str:
    items = [
        *([] if cell.robot.controller.counted else [f"all energies and costs: {DRIVES_ONLY}"]),
        *found.notes,
        *(f"{side.name}: {side.problem}" for side in found.sides if not side.found),
    ]
    if not items:
        return ""
    listed = "".join(f"<li>{text(item)}</li>" for item in items)
    return f'<div class="problems calm"><b>Notes</b><ul>{listed}</ul></div>'


def _points(found: BeforeAfter, sides: Sequence[Side]) -> list[Point]:
    """The programs, today's first."""
    points: list[Point] = []
    for side in sides:
        report = side.report
        points.append(Point(shown_name(found, side), report.duration, report.energy, "predicted"))
    return points


def _choice(found: BeforeAfter, side: Side) -> str:
    chosen = " selected" if side is found.planned else ""
    shown = shown_name(found, side)
    return f'<option value="{text(side.name)}"{chosen}>{text(shown)}</option>'


# Every movement and pause of all programs as columns of numbers, for CSV, Parquet and pandas: SI
# units.

START = b"program,"


def before_after_columns(
    found: BeforeAfter, costs: Costs | None = None
) -> dict[str, list[TableValue]]:
    """A row for each program, for each of its movements and pauses, and for each change."""
    prices = costs or Costs()
    sides = [side for side in (found.today, *found.sides) if side.found]
    rows = [row for side in sides for row in (_whole(found, side, prices), *_hops(side))]
    rows += _changes(found, prices)
    return {name: [row.get(name, math.nan) for row in rows] for name in rows[0]}


def write_before_after_table(
    found: BeforeAfter,
    path: str | Path,
    costs: Costs | None = None,
    roots: FileRoots = ANYWHERE,
    locale: str = ENGLISH,
) -> Path:
    """Writes the rows as .csv, .xlsx or .parquet below `roots`; RecorderError for another
    ending.
    """
    return write_columns(before_after_columns(found, costs), path, START, roots, locale)


def _whole(found: BeforeAfter, side: Side, costs: Costs) -> Mapping[str, TableValue]:
    report = side.report
    saving = side.saving
    year = year_of(found, side, costs)
    money = year.saved.of(costs.money)
    kwh = year.energy.of(lambda joules: joules / J_PER_KWH)
    return {
        **{"program": side.name, "what": "cycle", "mode": "", "seconds_s": report.duration},
        **{
            "energy_j": report.energy,
            "energy_low_j": report.energy_low,
            "energy_high_j": report.energy_high,
        },
        **{
            "saved_j": saving.saved,
            "saved_low_j": saving.saved_low,
            "saved_high_j": saving.saved_high,
        },
        **{"peak_w": report.peak_power, "peak_low_w": side.peak[0], "peak_high_w": side.peak[1]},
        **{"clearance_m": report.min_clearance, "shift_cycles": year.cycles_a_shift},
        "part_kwh": report.energy / J_PER_KWH / costs.parts_per_cycle,
        **_amounts("shift_kwh", year.shift.of(lambda joules: joules / J_PER_KWH)),
        **_amounts("year_kwh", kwh),
        **_amounts("year_money", year.energy.of(costs.money)),
        **_amounts("year_co2_kg", year.energy.of(costs.co2)),
        **_amounts("year_saved_money", money),
    }


def _amounts(name: str, amount: Amount) -> Mapping[str, TableValue]:
    return {name: amount.value, f"{name}_low": amount.low, f"{name}_high": amount.high}


def _changes(found: BeforeAfter, costs: Costs) -> Sequence[Mapping[str, TableValue]]:
    """The changes in their order, with the seconds that they take then."""
    cycles = year_of(found, found.planned, costs).cycles_a_year
    return [
        {
            **{
                "program": found.towards,
                "what": f"change: {change.name}",
                "mode": change.words,
            },
            **{"seconds_s": change.seconds[1]},
            **{"saved_j": change.saving.saved},
            **{"saved_low_j": change.saving.saved_low, "saved_high_j": change.saving.saved_high},
            **{"year_saved_money": costs.money(change.saving.saved * cycles)},
        }
        for change in found.changes
    ]


def _hops(side: Side) -> Sequence[Mapping[str, TableValue]]:
    return [
        {
            **{
                "program": side.name,
                "what": hop.name,
                "mode": hop.power_mode,
                "seconds_s": hop.seconds,
            },
            **{
                "energy_j": hop.energy,
                "energy_low_j": hop.energy_low,
                "energy_high_j": hop.energy_high,
            },
        }
        for hop in side.hops
    ]
