"""Tables of a fleet's page: robots, months, measures, peak and rest, energy by mode and by
movement.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ir_recorder.analysis.production import (
    DRIVES_ONLY,
    LEFT_ALONE,
    Amount,
    deviation,
    sum_of,
)
from ir_recorder.report.cycle_costs import money_of_thousand
from ir_recorder.report.fleet_figures import (
    UNDRIVEN,
    Robot,
    as_now,
    by_measure,
    computed_sentence,
    demand_today,
    idle_of_robots,
    names_of,
    origins_of,
    own_members,
    parts_left,
    stands,
    sum_of_demands,
)
from ir_recorder.report.fleet_members import Member
from ir_recorder.report.methods import counted
from ir_recorder.report.money_text import (
    NOTHING,
    yearly_money,
    yearly_span,
)
from ir_recorder.report.nights import IdleSaving, idle_money, idle_sentence
from ir_recorder.report.number_text import (
    DASH,
    kilowatt_hours,
    modes_as_words,
    percent,
    significant,
    text,
    watts,
    yearly_kilowatt_hours,
)
from ir_recorder.report.page import folded
from ir_recorder.report.paid import (
    between_of,
)
from ir_recorder.report.prices import Costs, counted_with
from ir_recorder.report.program_names import COMMON, computed_words
from ir_recorder.report.quarter_hour import DEMAND_LEAVES_OUT, Demand, demand_note
from ir_recorder.report.tables import COMPACT, bar, table

_ROBOT_HEADS = (
    "robot", ">costs in shifts a year", ">reached a year", ">still to save a year",
    "change first",
)  # fmt: skip


_MOST_ROBOTS = 8  # of the first table, those that cost most: the rest is one row there


def robots_table(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    """Those that cost most, each with what to change first; the others in one row."""
    rest = robots[_MOST_ROBOTS:]
    others = [robot for robot in rest if not robot.drives_only]
    rows = [_robot_row(robot, members, costs) for robot in robots[:_MOST_ROBOTS]]
    if others:
        without = len(rest) - len(others)
        name = counted(len(rest), "other robot")
        name += f"<small>{without} of them in no sum</small>" if without else ""
        rows.append((name, *_sums(others, members, costs), DASH))
    summed = [robot for robot in robots if not robot.drives_only]
    if len(summed) > 1:
        recordings = counted(sum(robot.recordings for robot in summed), "file")
        name = f"<b>all</b><small>{recordings}</small>"
        rows.append((name, *_sums(summed, members, costs), DASH))
    hint = (
        "Reached: the common program (the same stations by PTP at full speed with the controller's "
        "own timers, predicted), less what was driven. Where nobody drove a plan the common "
        "program stands for today. Still to save: what nobody did yet. "
        "Small: 90 % intervals, which add up as if all were wrong alike."
    )
    if any(robot.saved is not None and robot.saved.doubt for robot in robots):
        hint += " Open: zero lies in the interval."
    hint = f"{text(hint)} {counted_with(costs)} {apart_sentence(robots)}"
    return f'{table(_ROBOT_HEADS, rows, "Robots")}<p class="hint">{hint}</p>'


def other_robots(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    """Every robot, folded; "" where the first table has them."""
    if len(robots) <= _MOST_ROBOTS:
        return ""
    rows = [_robot_row(robot, members, costs) for robot in robots[_MOST_ROBOTS:]]
    name = f"The other {counted(len(rows), 'robot')}"
    return folded(section(name, table(_ROBOT_HEADS, rows, name)))


def _robot_row(robot: Robot, members: Sequence[Member], costs: Costs) -> tuple[str, ...]:
    own = own_members(members, robot)
    idle = None if robot.drives_only else idle_of_robots(own, costs)
    part = robot.joules / costs.parts_per_cycle
    made = ", ".join((robot.cell, origins_of(own), *([DRIVES_ONLY] if robot.drives_only else ())))
    how = "" if robot.driven else " as planned"
    each = f"a part{how} {kilowatt_hours(part)}, {money_of_thousand(part, costs)}"
    computed = computed_words(*(member.cycle for member in own))
    each += f"; {computed}" if computed else ""
    today = f"<small>{COMMON}, predicted</small>" if stands(robot) else ""
    return (
        f"{text(robot.name)}<small>{text(made)}</small><small>{text(each)}</small>",
        f"{_yearly(robot.now, costs)}{today}",
        _saved(robot.reached, costs),
        _left([robot], idle, costs),
        text(_first_lever(robot, own, idle, costs)),
    )


def _first_lever(robot: Robot, own: Sequence[Member], idle: IdleSaving | None, costs: Costs) -> str:
    """What saves most: rest outside of the shifts, its plan, or, without a plan, a measure."""
    found: list[tuple[float, str]] = []
    if idle is not None:
        found.append((idle.saved, f"{idle.mode} at night"))
    saves = robot.saved is not None and robot.saved.value > 0.0 and not robot.saved.doubt
    if robot.saved is not None and saves and not robot.driven:
        found.append((costs.money(robot.saved.value), "drive its plan"))
    if robot.saved is None:
        found += [
            (costs.money(sum(each.values())), f"{name} (at most)")
            for name, each in by_measure(own, costs).items()
        ]
    return max(found)[1] if found else DASH


def _sums(robots: Sequence[Robot], members: Sequence[Member], costs: Costs) -> tuple[str, ...]:
    """Costs, energy and savings of several robots."""
    reached = [robot.reached for robot in robots if robot.reached is not None]
    known = [member for robot in robots for member in own_members(members, robot)]
    return (
        _yearly(sum_of([robot.now for robot in robots]), costs),
        _saved(sum_of(reached) if reached else None, costs),
        _left(robots, idle_of_robots(known, costs), costs),
    )


def _left(robots: Sequence[Robot], idle: IdleSaving | None, costs: Costs) -> str:
    """The same together, and each."""
    parts = parts_left(robots, idle, costs)
    if not parts:
        return DASH
    whole = sum_of([money for money, _ in parts])
    named = [f"{yearly_money(money.value, costs.currency)} {words}" for money, words in parts]
    each = "".join(f"<small>{text(words)}</small>" for words in named)
    return f"{_money(whole, costs)}{each}"


def apart_sentence(robots: Sequence[Robot]) -> str:
    """Which robots are in no sum, and why; "" where all are."""
    apart = [robot for robot in robots if robot.drives_only]
    if not apart:
        return ""
    return text(
        f"In no sum, as their energy at the mains isn't known ({DRIVES_ONLY}), nor what they take "
        f"at rest: {names_of(apart)}."
    )


def clock_table(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    """The largest quarter of an hour, and what rest outside of the shifts takes, by robot."""
    modes = list(dict.fromkeys(mode for member in members for mode in member.idle))
    rows = []
    demands: list[Demand] = []
    idle: dict[str, list[float]] = {mode: [] for mode in modes}
    for robot in robots:
        own = [member for member in members if member.robot == robot.name]
        demand = demand_today(members, robot, costs)
        if not robot.drives_only:
            demands.append(demand)
        energies = []
        for mode in modes:
            known = [member.idle[mode] for member in own if mode in member.idle]
            energy = max(known) * costs.idle_hours * 3600.0 if known else float("nan")
            energies.append(energy)
            if not robot.drives_only:
                idle[mode].append(energy)
        rows.append(_clock_row(_named(robot), demand, energies, costs))
    sums = [sum(idle[mode]) for mode in modes]
    if demands:
        rows.append(_clock_row("<b>all</b>", sum_of_demands(demands), sums, costs))
    heads = ("robot", ">largest quarter of an hour", *(f">{_rest_head(mode)}" for mode in modes))
    saves = idle_of_robots(members, costs)
    hint = (
        f"{significant(costs.idle_hours, 6)} hours a year lie outside of the shifts; the columns "
        "of modes say what rest takes in them, by the data. The peak of all robots is the sum of "
        f"theirs: as if all came at once; it is on the basis of the bill ({as_now(robots)}). "
        f"{DEMAND_LEAVES_OUT} {idle_sentence(saves, costs)}"
    )
    return f'<p class="hint">{text(hint)}</p>{table(heads, rows, "Peak and rest")}'


def _rest_head(mode: str) -> str:
    return f"{_shown(mode)} (today, if left alone)" if mode == LEFT_ALONE else _shown(mode)


def _named(robot: Robot) -> str:
    limit = f"<small>{DRIVES_ONLY}</small>" if robot.drives_only else ""
    return f"{text(robot.name)}{limit}"


def _clock_row(
    name: str, demand: Demand, energies: Sequence[float], costs: Costs
) -> tuple[str, ...]:
    lines = (demand.words, demand_note(demand.watts, costs))
    small = "".join(f"<small>{text(line)}</small>" for line in lines if line)
    cells = (
        f"{text(idle_money(energy, costs))}<small>{text(kilowatt_hours(energy))}</small>"
        for energy in energies
    )
    return (name, f"<b>{watts(demand.watts)}</b>{small}", *cells)


def months_table(members: Sequence[Member]) -> str:
    """What was driven in each month, beside what was predicted of it."""
    known = [member for member in members if math.isfinite(member.driven - member.predicted)]
    if not known:
        return '<p class="empty">No recording holds a program that was driven and its plan.</p>'
    kinds = dict.fromkeys((m.month, m.cycle.origin) for m in sorted(known, key=lambda m: m.month))
    rows = []
    for month, origin in kinds:
        own = [m for m in known if (m.month, m.cycle.origin) == (month, origin)]
        driven, predicted = (sum(getattr(m, name) for m in own) for name in ("driven", "predicted"))
        shares = [deviation(m.driven, m.predicted) for m in own]
        made = f"{origin}, {counted(len({m.robot for m in own}), 'robot')}"
        if len(own) > 1:
            made += f", {counted(len(own), 'recording')}"
        least = percent(min(shares)).removesuffix(" %")
        ends = f"<small>{least} to {percent(max(shares))}</small>"
        rows.append(
            (
                f"{text(month)}<small>{text(made)}</small>",
                f"<b>{kilowatt_hours(driven)}</b>",
                kilowatt_hours(predicted),
                f"<b>{percent(deviation(driven, predicted))}</b>{ends if len(own) > 1 else ''}",
            )
        )
    heads = ("month", ">driven", ">predicted", ">difference")
    shortened = any(_shortened(member) for member in known)
    pauses = "pauses shortened, " if shortened else ""
    single = "; small: of single recordings" if len(known) > len(kinds) else ""
    hint = (
        f"Runs as they were driven: {pauses}waiting between steps included, which no plan contains"
        f"{single}. A difference that grows is a robot, a tool or a program that has changed."
    )
    return f'{table(heads, rows, "Month by month", COMPACT)}<p class="hint">{hint}</p>'


def _shortened(member: Member) -> bool:
    """Whether a cycle counts more than what was driven: pauses at full length."""
    return member.cycle.energy * member.cycle.cycles > 1.001 * member.driven


def _shown(name: str) -> str:
    """A mode as people read it; names of movements as they are."""
    return name.replace("_", " ").lower() if name.isupper() else modes_as_words(name)


def _yearly(amount: Amount, costs: Costs) -> str:
    """Price of a year with its interval, and its energy."""
    energy = f"<small>{text(kilowatt_hours(amount.value))}</small>"
    return f"{_money(amount.of(costs.money), costs)}{energy}"


def _money(price: Amount, costs: Costs) -> str:
    value = yearly_money(price.value, costs.currency)
    return f"<b>{text(value)}</b>{_small_ends(price, costs)}"


def _small_ends(price: Amount, costs: Costs) -> str:
    if price.low >= price.high:
        return ""
    ends = yearly_span(price.low, price.high, costs.currency)
    return f"<small>{text(ends)} {text(costs.currency)}</small>"


def _saved(amount: Amount | None, costs: Costs) -> str:
    """What is saved, with its interval; where zero lies in it, that it is open."""
    if amount is None:
        return DASH
    word, amount = amount.gain()
    between = _small_ends(amount.of(costs.money), costs)
    if amount.doubt:
        return f'<span title="{text(amount.doubt)}">open</span>{between}'
    price = yearly_money(costs.money(amount.value), costs.currency)
    energy = f"{kilowatt_hours(amount.value)}{' more' if word == 'more' else ''}"
    return f"<b>{text(price)}</b><small>{text(energy)}</small>{between}"


_ROWS = 40  # of movements: the rest is one row


_COLUMNS = 5  # of robots, those that take most: the rest is one column; the table has them all


REST = "all others"


def basis_sentence(members: Sequence[Member], robots: Sequence[Robot]) -> str:
    """What energies by mode and by movement are of, in sentences; "" where all was driven."""
    computed = computed_sentence(members)
    if not any(stands(robot) for robot in robots):
        return computed
    planned = f"{UNDRIVEN[0].upper()}{UNDRIVEN[1:]}, not the {COMMON}."
    return f"{computed} {planned}".strip()


def matrix(
    what: str,
    found: Mapping[str, Mapping[str, float]],
    robots: Sequence[Robot],
    basis: str,
) -> str:
    """Rows by name, a column for each of the first robots, one for the others and one for all;
    basis: a sentence that limits them.
    """
    if not found:
        return '<p class="empty">No recording says it.</p>'
    names = list(found)
    rows = [_row(name, found[name], robots) for name in names[:_ROWS]]
    if len(names) > _ROWS:
        rest = {r.name: sum(found[name].get(r.name, 0.0) for name in names[_ROWS:]) for r in robots}
        rows.append(_row(REST, rest, robots))
    hint = f'<p class="hint">{text(basis)}</p>' if basis else ""
    return table((what, *_robot_heads(robots), ">all"), rows, f"kWh a year by {what}") + hint


def _robot_heads(robots: Sequence[Robot]) -> list[str]:
    heads = [f">{robot.name}" for robot in robots[:_COLUMNS]]
    return [*heads, ">other robots"] if len(robots) > _COLUMNS else heads


def _row(name: str, own: Mapping[str, float], robots: Sequence[Robot]) -> tuple[str, ...]:
    shown = [own.get(robot.name) for robot in robots[:_COLUMNS]]
    if len(robots) > _COLUMNS:
        shown.append(sum(own.get(robot.name, 0.0) for robot in robots[_COLUMNS:]))
    cells = (DASH if value is None else text(yearly_kilowatt_hours(value)) for value in shown)
    return (text(_shown(name)), *cells, f"<b>{text(yearly_kilowatt_hours(sum(own.values())))}</b>")


_LITTLE = 0.01  # of the largest measure: less is only named


def measures_table(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    """Measures by what they save at most, and the robot at which each saves most."""
    found: list[tuple[float, str, Mapping[str, float]]] = [
        (costs.money(sum(own.values())), text(_shown(name)), own)
        for name, own in by_measure(members, costs).items()
    ]
    found += [*_night(members, robots, costs), *_of_plans(robots, costs)]
    if not found:
        return '<p class="empty">No recording says it.</p>'
    found.sort(key=lambda measure: -measure[0])
    most = max(found[0][0], 1e-9)
    rows = [
        (
            f"{name}{_most_at(own)}",
            f"<b>{text(yearly_money(price, costs.currency))}</b>"
            f"<small>{text(yearly_kilowatt_hours(sum(own.values())))}</small>",
            bar(price, most, "planned"),
        )
        for price, name, own in found
        if price >= _LITTLE * most
    ]
    heads = ("what", ">a year", "")
    hint = "Upper bounds, each by itself: together they count some joules twice."
    undriven = [robot for robot in robots if not robot.driven]
    if undriven:
        hint += f" Of plans that nobody drove no movement is counted: {text(names_of(undriven))}."
    little = [name for price, name, _ in found if price < _LITTLE * most]
    if little:
        hint += f" Less than {100.0 * _LITTLE:g} % of the largest: {', '.join(little)}."
    return f'{table(heads, rows, "What could still be saved", COMPACT)}<p class="hint">{hint}</p>'


_MORE = 1.05  # times what the next one saves: else none saves most


def _most_at(own: Mapping[str, float]) -> str:
    """The robot at which a measure saves most, in small letters; "" where none stands out."""
    first, *others = sorted(own.items(), key=lambda each: -each[1])
    if not others or first[1] < _MORE * others[0][1]:
        return ""
    return f"<small>most at {text(first[0])}</small>"


def _night(
    members: Sequence[Member], robots: Sequence[Robot], costs: Costs
) -> list[tuple[float, str, Mapping[str, float]]]:
    """Rest outside of the shifts as a measure; none where it saves nothing."""
    nights = idle_of_robots(members, costs)
    if nights is None:
        return []
    own = {robot.name: idle_of_robots(own_members(members, robot), costs) for robot in robots}
    energies = {name: idle.energy.value for name, idle in own.items() if idle is not None}
    ends = f"{yearly_span(nights.money.low, nights.money.high, costs.currency)} {costs.currency}"
    basis = f"{nights.mode} instead of closed brakes, {nights.basis}, 90 % interval {ends}"
    name = f"at night and at weekends<small>{text(basis)}</small>"
    return [(nights.saved, name, energies)]


def _of_plans(
    robots: Sequence[Robot], costs: Costs
) -> list[tuple[float, str, Mapping[str, float]]]:
    """Plans that nobody drove, and what runs took above theirs, as measures; none that saves
    nothing.
    """
    undriven = {r.name: r.saved for r in robots if not r.driven and r.saved is not None}
    found: list[tuple[float, str, Mapping[str, float]]] = []
    if undriven:
        plans = sum_of(list(undriven.values()))
        words = "driven instead of the common programs, predicted"
        words += f", {between_of(plans.of(costs.money), costs)}" if plans.low < plans.high else ""
        if plans.value > 0.0 and not plans.doubt:
            energies = {name: saved.value for name, saved in undriven.items()}
            name = f"plans that nobody drove<small>{text(words)}</small>"
            found.append((costs.money(plans.value), name, energies))
    above = {robot.name: robot.above for robot in robots if robot.reached is not None}
    total = costs.money(sum(above.values()))
    if total >= NOTHING:
        found.append((total, "what runs took above their plans", above))
    return found


def section(title: str, content: str, name: str = "") -> str:
    """A part of the page (HTML) below its title; name: what links to it."""
    called = f' id="{name}"' if name else ""
    return f"<section{called}><h2>{text(title)}</h2>{content}</section>"
