"""Sums over the members of a fleet, in production: joules of a year by robot, mode, movement and
measure.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ir_recorder.report.costs import Costs
from ir_recorder.report.fleet.members import Member


@dataclass(frozen=True)
class Robot:
    """All members of one robot: recordings, mean seconds and joules of a cycle, joules of a
    year.
    """

    name: str
    cell: str
    origins: tuple[str, ...]
    recordings: int
    seconds: float
    joules: float
    yearly: float


def robots_of(members: Sequence[Member], costs: Costs) -> list[Robot]:
    """The robots, those that take most first. Several recordings of a robot (shifts) are
    averaged.
    """
    found = []
    for name in dict.fromkeys(member.robot for member in members):
        own = [member for member in members if member.robot == name]
        seconds, joules = (
            sum(values) / len(own) for values in ([m.seconds for m in own], [m.joules for m in own])
        )
        yearly = sum(yearly_of(member, costs) for member in own) / len(own)
        origins = tuple(dict.fromkeys(member.origin for member in own))
        cells = ", ".join(dict.fromkeys(member.cell for member in own if member.cell))
        found.append(Robot(name, cells, origins, len(own), seconds, joules, yearly))
    return sorted(found, key=lambda robot: -robot.yearly)


def yearly_of(member: Member, costs: Costs) -> float:
    """Joules of a year, one cycle after the other."""
    return member.joules * costs.cycles_per_year(member.seconds) if member.seconds > 0.0 else 0.0


def by_mode(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year by robot and mode: a recording's modes share its year as they share its
    joules.
    """
    return _summed(
        members,
        ((m, s.name, s.energy) for m in members for s in m.modes.values()),
        costs,
        share=True,
    )


def by_movement(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year by robot and movement or pause."""
    return _summed(
        members, ((m, s.name, s.energy) for m in members for s in m.movements.values()), costs
    )


def by_measure(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year that each measure could save at most, by robot."""
    return _summed(
        members, ((m, name, joules) for m in members for name, joules in m.measures.items()), costs
    )


def _summed(
    members: Sequence[Member],
    rows: Iterator[tuple[Member, str, float]],
    costs: Costs,
    share: bool = False,
) -> dict[str, dict[str, float]]:
    """By name, then by robot; largest names first."""
    count = {m.robot: sum(other.robot == m.robot for other in members) for m in members}
    found: dict[str, dict[str, float]] = {}
    for member, name, joules in rows:
        whole = sum(one.energy for one in member.modes.values()) if share else member.joules
        if whole <= 0.0:
            continue
        yearly = joules / whole * yearly_of(member, costs) / count[member.robot]
        own = found.setdefault(name, {})
        own[member.robot] = own.get(member.robot, 0.0) + yearly
    return dict(sorted(found.items(), key=lambda item: -sum(item[1].values())))
