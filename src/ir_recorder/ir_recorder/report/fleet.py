"""The page of many robots and shifts: a year of all and what to do about it, then each robot with
what to change first, then sums.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ir_recorder.analysis.production import (
    DRIVES_ONLY,
    PREDICTED,
    sum_of,
)
from ir_recorder.report.answer import Answer
from ir_recorder.report.cycle_costs import payback
from ir_recorder.report.files import write_output
from ir_recorder.report.fleet_figures import (
    Robot,
    as_now,
    at_mains,
    by_mode,
    by_movement,
    computed_sentence,
    demand_today,
    fleet_of_line,
    idle_of_robots,
    names_of,
    origins_of,
    own_members,
    robots_of,
    saved_and_common,
    stands,
    sum_of_demands,
)
from ir_recorder.report.fleet_members import Member
from ir_recorder.report.fleet_tables import (
    apart_sentence,
    basis_sentence,
    clock_table,
    matrix,
    measures_table,
    months_table,
    other_robots,
    robots_table,
    section,
)
from ir_recorder.report.methods import counted
from ir_recorder.report.money_text import (
    yearly_money,
)
from ir_recorder.report.nights import IdleSaving
from ir_recorder.report.number_text import (
    kilograms,
    kilowatt_hours,
    text,
    watts,
)
from ir_recorder.report.page import PAGE_START, folded
from ir_recorder.report.paid import (
    ABOVE,
    ABOVE_LEAST,
    Before,
    Paid,
    RunNow,
    Tile,
    a_night,
    at_night,
    between_of,
    counted_at,
    row_of,
    with_span,
)
from ir_recorder.report.prices import Costs, assumed_section, following_price
from ir_recorder.report.quarter_hour import demand_note
from ir_recorder.report.shell import SIMULATED, badge, shell, source_badge
from ir_recorder.report.whole_line import line_section
from ir_values.files import ANYWHERE, FileRoots

# bars as wide as their section, and none on a telephone, where robots stand column below column
_STYLE = """
@media screen and (min-width: 701px) {
  section#first table.compact { max-width: none; } #first td:has(> .bar) { width: 45%; }
}
@media (max-width: 700px) {
  #first tr > :nth-child(3) { display: none; }
  #robots table.cards td.no:not(:last-child) { display: block; }
  #robots table.cards tr:has(> td.n) { grid-template-columns: repeat(3, minmax(0, 1fr)); }
}
"""


def write_fleet(
    members: Sequence[Member],
    path: str | Path,
    left_out: Sequence[str] = (),
    costs: Costs | None = None,
    roots: FileRoots = ANYWHERE,
) -> Path:
    """Writes the page below `roots`; its absolute path. RecorderError when it can't be written."""
    return write_output(path, fleet_html(members, left_out, costs).encode(), PAGE_START, roots)


def fleet_html(
    members: Sequence[Member], left_out: Sequence[str] = (), costs: Costs | None = None
) -> str:
    """The page as text; left_out: a sentence for each file that could not be used."""
    prices = following_price(costs or Costs())
    robots = robots_of(members, prices)
    known = at_mains(members)
    summed = [robot for robot in robots if not robot.drives_only]
    paid = _paid(known, prices)
    basis = basis_sentence(known, summed)
    sections = [
        section(
            "Robots, those that cost most first", robots_table(members, robots, prices), "robots"
        ),
        section(
            "What could still be saved, each by itself",
            measures_table(known, summed, prices),
            "first",
        ),
        section("Month by month: driven and predicted", months_table(members), "months"),
        _problems([each for each in left_out if DRIVES_ONLY not in each]),  # the table says it
        other_robots(members, robots, prices),
        folded(
            section("Peak, and when nobody works", clock_table(members, robots, prices)),
            paper=True,
        ),
        folded(line_section(fleet_of_line(members, prices), prices)),
        folded(
            section("By power mode", matrix("mode", by_mode(known, prices), summed, basis)),
            paper=True,
        ),
        folded(
            section(
                "By movement and pause",
                matrix("movement", by_movement(known, prices), summed, basis),
            ),
        ),
        assumed_section(prices),
    ]
    first = _answer(paid, robots, prices).html()
    year = paid.picture(prices)
    shown = [tile for tile in _tiles(paid, known, robots, prices) if tile is not None]
    return shell(
        f"{_title(robots)}: {origins_of(members)}",
        "a year of each robot, one cycle after the other",
        f"{first}{year}{row_of(shown) if shown else ''}{''.join(sections)}",
        badges=[*_simulated(members), _badge(paid, prices)],
        style=_STYLE,
    )


def _title(robots: Sequence[Robot]) -> str:
    """How many robots, and how many of them are in the sums."""
    summed = sum(not robot.drives_only for robot in robots)
    of = f", {summed} in the sums" if summed < len(robots) else ""
    return f"{counted(len(robots), 'robot')}{of}"


def _answer(paid: Paid, robots: Sequence[Robot], costs: Costs) -> Answer:
    """What all robots together save in a year, how sure that is, and in which order."""
    summed = [robot for robot in robots if not robot.drives_only]
    if not summed:
        return Answer("The costs of a year are not known", apart_sentence(robots))
    yearly = sum_of([robot.now for robot in summed])
    price = yearly.of(costs.money)
    taken = f"{kilowatt_hours(yearly.value)}, {kilograms(costs.co2(yearly.value))} of CO2"
    if paid.saved is None and paid.idle is None:
        return Answer(
            f"{yearly_money(price.value, costs.currency)} a year",
            f"for the energy of {counted(len(summed), 'robot')} in shifts: {taken}.",
            between=between_of(price, costs),
            do="Plan their programs (ir plan CELL --saving -o plan.mcap) and name these files as "
            "well: no recording says what a plan saves.",
            counted=counted_at(costs),
        )
    year = paid.year(costs)
    less = "less" if year.money.gain()[0] == "saved" else "more"
    than = paid.before if paid.saved is not None else "closed brakes at night"
    result = f"{paid.gain_words(costs)} a year {less} than {than}"
    if paid.saved is not None and paid.saved.doubt:
        result = f"Open whether anything is saved: {result}"
    reached = paid.has_reached
    if reached is not None:
        result = paid.reached_words(costs)
    saved = year.with_energy(costs)
    parts = [
        f"{counted(len(summed), 'robot')}{' together' if len(summed) > 1 else ''}",
        paid.share_words(costs) if paid.saved is not None and paid.common > 0.0 else "",
        f"{saved} {less}" if saved else "",
        payback(year.money, costs),
    ]
    words = "; ".join(part for part in parts if part)
    todo, done = _steps(paid, robots, costs)
    return Answer(
        result,
        f"{words}.",
        paid.sure(costs, _above(robots, costs)),
        todo or ["Keep the programs as they are."],
        a_night(paid.idle, costs),
        paid.between_words(costs),
        done,
        counted_at(costs),
        paid.bills(costs),
    )


def _steps(paid: Paid, robots: Sequence[Robot], costs: Costs) -> tuple[list[str], list[str]]:
    """What is to do, what saves most first; and what was done already."""
    found: list[tuple[float, str]] = []
    if paid.idle is not None:
        price = with_span(paid.idle.money, costs)
        resting = at_night(paid.idle)
        several = sum(not robot.drives_only for robot in robots) > 1
        words = f"All together in {resting}" if several else f"{resting[0].upper()}{resting[1:]}"
        words = f"{words}: {price} a year."
        found.append((paid.idle.saved, words))
    done = []
    for driven in (True, False):
        own = [robot for robot in robots if robot.driven == driven and not robot.drives_only]
        savings = [robot.reached if driven else robot.saved for robot in own]
        gains = [saved for saved in savings if saved is not None]
        if not gains or paid.saved is None or paid.saved.doubt:
            continue
        saved = sum_of(gains).of(costs.money)
        if saved.value <= 0.0:
            continue
        words = f"{_plans(own)}: {with_span(saved, costs)} a year."
        if driven:
            done.append(words)
        else:
            found.append((saved.value, words))
    above = _above(robots, costs)
    if done and above >= ABOVE_LEAST * costs.money(paid.common):
        words = f"{ABOVE[0].upper()}{ABOVE[1:]}: {yearly_money(above, costs.currency)} a year."
        found.append((above, words))
    return [words for _, words in sorted(found, reverse=True)], done


def _above(robots: Sequence[Robot], costs: Costs) -> float:
    """Money of a year that runs took more than their plans."""
    return costs.money(sum(robot.above for robot in robots if not robot.drives_only))


def _plans(robots: Sequence[Robot]) -> str:
    """Whose plans to drive: those of robots that save, the one that saves most first; whose were
    driven, where all were.
    """
    known = [robot for robot in robots if not robot.drives_only]
    savings = {robot: robot.reached if robot.driven else robot.saved for robot in known}
    gains = {robot: saved.value for robot, saved in savings.items() if saved is not None}
    saving = sorted((robot for robot in gains if gains[robot] > 0.0), key=lambda r: -gains[r])
    if len(saving) == 1:
        of = f'the plan of "{saving[0].name}" instead of its common program'
    else:
        of = f'the plans, that of "{saving[0].name}" first, instead of common programs'
    driven = all(robot.driven for robot in saving)
    return f"{of[0].upper()}{of[1:]}" if driven else f"Drive {of}"


def _simulated(members: Sequence[Member]) -> list[str]:
    """That nothing was measured, where all that was driven was simulated."""
    origins = {member.cycle.origin for member in members} - {PREDICTED}
    if origins != {"simulated"}:
        return []
    return [source_badge(SIMULATED, "simulated")]


def _badge(paid: Paid, costs: Costs) -> str:
    if paid.saved is None:
        return badge("No plan's saving known", "open")
    if paid.saved.doubt:
        return badge("Open whether plans save", "open")
    if paid.saved.value < 0.0:
        return badge("The plans take more", "bad")
    if paid.idle is not None and not paid.idle.measured:
        nights = paid.idle.saved / (paid.idle.saved + costs.money(paid.saved.value))
        if nights > _MUCH:
            return badge(
                f"{100.0 * nights:.0f} % of the saving is at night, from the data sheet", "open"
            )
    return badge("The plans save", "good")


_MUCH = 0.5  # of what is saved: what isn't measured then is said beside the title


def _tiles(
    paid: Paid, members: Sequence[Member], robots: Sequence[Robot], costs: Costs
) -> list[Tile | None]:
    """A year of the fleet in shifts as it is today, and its largest quarter of an hour."""
    summed = [robot for robot in robots if not robot.drives_only]
    if not summed:
        return []
    yearly = sum_of([robot.now for robot in summed])
    price = yearly.of(costs.money)
    of = f"{counted(len(summed), 'robot')}, {as_now(summed)}"
    energy = f"{kilowatt_hours(yearly.value)}, {kilograms(costs.co2(yearly.value))} of CO2"
    costs_tile = Tile(
        "costs in shifts a year",
        yearly_money(price.value, costs.currency),
        (between_of(price, costs), energy, of),
    )
    of_all = sum_of_demands([demand_today(members, robot, costs) for robot in summed])
    demand = Tile(
        "largest quarter of an hour",
        watts(of_all.watts),
        (
            f"{of}: {of_all.words}",
            "as if all robots' largest came at once" if len(summed) > 1 else "",
            _unsaid(members, summed),
            _outside(paid.idle),
            demand_note(of_all.watts, costs),
        ),
    )
    return [costs_tile, demand]


def _outside(idle: IdleSaving | None) -> str:
    """What rest would take outside of the shifts."""
    if idle is None:
        return ""
    return f"at night and at weekends {watts(idle.watts_deepest)} in {idle.mode}"


def _unsaid(members: Sequence[Member], robots: Sequence[Robot]) -> str:
    """Whose largest quarter is that of the plan, as its file is of an earlier version."""
    without = [
        robot
        for robot in robots
        if stands(robot) and not all(each.common_demand for each in own_members(members, robot))
    ]
    return f"{UNSAID}: {names_of(without)}" if without else ""


UNSAID = "as planned, as no file says the common program's"
"""Of the largest quarter of an hour of plans that an earlier version wrote."""


def _paid(members: Sequence[Member], costs: Costs) -> Paid:
    """What those who pay ask first, of all robots together."""
    saved, _ = saved_and_common(members, costs)
    idle = idle_of_robots(members, costs)
    robots = robots_of(members, costs)
    if saved is None:
        return Paid(None, 0.0, idle)
    without = [robot for robot in robots if robot.saved is None]
    of = f", {counted(len(robots), 'robot')}"
    if without:
        of += f", {names_of(without)} alike in all: no file says what its plan saves"
    common = sum(robot.before for robot in robots)
    driven = [robot.reached for robot in robots if robot.reached is not None]
    of += f"; today: {as_now(robots)}" if driven else ""
    now = RunNow("today", sum_of([robot.now for robot in robots]).value)
    return Paid(
        saved,
        common,
        idle,
        of,
        Before.COMMONS,
        now if driven else None,
        run=computed_sentence(members),
        reached=sum_of(driven) if driven else None,
    )


def _problems(left_out: Sequence[str]) -> str:
    if not left_out:
        return ""
    items = "".join(f"<li>{text(sentence)}</li>" for sentence in left_out)
    return f'<div class="problems calm"><b>Notes</b><ul>{items}</ul></div>'
