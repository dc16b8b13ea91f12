"""The page of a fleet: tables with sums, and bars of each robot's year."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ir_msgs_py.file_roots import ANYWHERE, FileRoots
from ir_recorder.report.costs import SETTINGS, Costs
from ir_recorder.report.files import write_output
from ir_recorder.report.fleet.members import Member
from ir_recorder.report.fleet.totals import Robot, by_measure, by_mode, by_movement, robots_of
from ir_recorder.report.money import money
from ir_recorder.report.page import PAGE_START, asset
from ir_recorder.report.tables import table
from ir_recorder.report.words import joules, kilowatt_hours, number, seconds, text

_ROWS = 40  # of movements: the rest is one row
REST = "all others"


def write_fleet(
    members: Sequence[Member],
    path: str | Path,
    left_out: Sequence[str] = (),
    costs: Costs | None = None,
    roots: FileRoots = ANYWHERE,
) -> Path:
    """Writes the page below `roots`; its absolute path. PathError when it can't be written."""
    return write_output(path, fleet_html(members, left_out, costs).encode(), PAGE_START, roots)


def fleet_html(
    members: Sequence[Member], left_out: Sequence[str] = (), costs: Costs | None = None
) -> str:
    """The page as text; left_out: a sentence for each file that could not be used."""
    prices = costs or Costs()
    robots = robots_of(members, prices)
    sections = [
        _section("Robots", _robots(robots, prices)),
        _section("By power mode", _matrix("mode", by_mode(members, prices), robots)),
        _section("What could be saved, by measure", _potential(members, robots, prices)),
        _section(
            "By movement and pause", _matrix("movement", by_movement(members, prices), robots)
        ),
    ]
    title = f"{len(robots)} robots, {len(members)} recordings"
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    )
    return (
        f'<!doctype html><html lang="en"><head>{head}<title>{text(title)}</title>'
        f"<style>{asset('page.css')}</style></head><body><header><div><h1>{text(title)}</h1>"
        f'<p class="subtitle">{text(_origins(members))}; a year of each robot, one cycle after '
        "the other</p>"
        f"</div></header><main>{_problems(left_out)}{''.join(sections)}{_assumptions(prices)}</main>"
        f"<script>{asset('export.js')}\nexportButtons();</script></body></html>"
    )


def _robots(robots: Sequence[Robot], costs: Costs) -> str:
    most = max((robot.yearly for robot in robots), default=1.0) or 1.0
    rows = [
        (
            f"{text(robot.name)}<small>{text(robot.cell)}</small>",
            text(", ".join(robot.origins)),
            str(robot.recordings),
            seconds(robot.seconds),
            text(joules(robot.joules)),
            f"<b>{text(kilowatt_hours(robot.yearly))}</b>",
            text(money(costs.money(robot.yearly), costs.currency)),
            text(number(costs.co2(robot.yearly), "kg")),
            f'<i class="bar" style="width:{100.0 * robot.yearly / most:.1f}%"></i>',
        )
        for robot in robots
    ]
    whole = sum(robot.yearly for robot in robots)
    sums = (text(kilowatt_hours(whole)), text(money(costs.money(whole), costs.currency)))
    rows.append(
        (
            "<b>all</b>",
            "",
            str(sum(r.recordings for r in robots)),
            "",
            "",
            f"<b>{sums[0]}</b>",
            sums[1],
            text(number(costs.co2(whole), "kg")),
            "",
        )
    )
    heads = (
        "robot",
        "origin",
        ">recordings",
        ">cycle",
        ">energy",
        ">a year",
        ">costs",
        ">CO2",
        "share",
    )
    return table(heads, rows, "Robots")


def _matrix(what: str, found: Mapping[str, Mapping[str, float]], robots: Sequence[Robot]) -> str:
    """Rows by name, a column for each robot and one for all."""
    if not found:
        return '<p class="empty">No recording says it.</p>'
    names = list(found)
    rows = [_row(name, found[name], robots) for name in names[:_ROWS]]
    if len(names) > _ROWS:
        rest = {r.name: sum(found[name].get(r.name, 0.0) for name in names[_ROWS:]) for r in robots}
        rows.append(_row(REST, rest, robots))
    return table(
        (what, *(f">{robot.name}" for robot in robots), ">all"), rows, f"kWh a year by {what}"
    )


def _row(name: str, own: Mapping[str, float], robots: Sequence[Robot]) -> tuple[str, ...]:
    shown = name.replace("_", " ").lower() if name.isupper() else name
    cells = (text(kilowatt_hours(own[robot.name])) if robot.name in own else "" for robot in robots)
    return (text(shown), *cells, f"<b>{text(kilowatt_hours(sum(own.values())))}</b>")


def _potential(members: Sequence[Member], robots: Sequence[Robot], costs: Costs) -> str:
    found = by_measure(members, costs)
    if not found:
        return '<p class="empty">No recording says it.</p>'
    rows = [
        (*_row(name, own, robots), text(money(costs.money(sum(own.values())), costs.currency)))
        for name, own in found.items()
    ]
    heads = ("measure", *(f">{robot.name}" for robot in robots), ">all", ">a year, at most")
    hint = (
        "Upper bounds, each by itself: together they count some joules twice. What a plan "
        "saves is predicted."
    )
    return f'<p class="hint">{hint}</p>{table(heads, rows, "kWh a year by measure")}'


def _section(title: str, content: str) -> str:
    return f"<section><h2>{text(title)}</h2>{content}</section>"


def _origins(members: Sequence[Member]) -> str:
    counts = {
        origin: sum(m.origin == origin for m in members)
        for origin in dict.fromkeys(m.origin for m in members)
    }
    return ", ".join(f"{count} {origin}" for origin, count in counts.items())


def _problems(left_out: Sequence[str]) -> str:
    if not left_out:
        return ""
    items = "".join(f"<li>{text(sentence)}</li>" for sentence in left_out)
    return f'<div class="problems"><b>Mind</b><ul>{items}</ul></div>'


def _assumptions(costs: Costs) -> str:
    shown = (
        f"{each.name.replace('_', ' ')} {getattr(costs, each.name)} {each.unit}".strip()
        + ("" if each.name in costs.given else " (assumed)")
        for each in SETTINGS
    )
    return f'<p class="hint">{text(", ".join(shown))}.</p>'
