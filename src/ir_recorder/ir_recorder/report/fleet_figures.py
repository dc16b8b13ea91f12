"""Figures of a fleet: joules of a year by robot, mode, movement and measure, what is saved, reached
and still left, and the largest quarter of an hour.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ir_recorder.analysis.production import (
    PREDICTED,
    Amount,
    mean_of,
    sum_of,
)
from ir_recorder.report.fleet_members import Member
from ir_recorder.report.methods import counted
from ir_recorder.report.money_text import (
    NOTHING,
)
from ir_recorder.report.nights import IdleSaving, idle_saving
from ir_recorder.report.paid import (
    reached_saving,
)
from ir_recorder.report.prices import Costs
from ir_recorder.report.program_names import COMMON
from ir_recorder.report.quarter_hour import Demand, demand_of
from ir_recorder.report.whole_line import WholeLine, of_whole_line


@dataclass(frozen=True)
class Robot:
    """All members of one robot: recordings, mean seconds and joules of a cycle; joules of a year,
    and those that its plans save of the common program's, each with its 90 % interval; common [J]:
    of that program, None where nobody knows it. drives_only: they are those of drives and tool, and
    no part of a sum at the mains.
    """

    name: str
    cell: str
    origins: tuple[str, ...]
    recordings: int
    seconds: float
    joules: float
    yearly: Amount
    saved: Amount | None
    common: float | None
    drives_only: bool = False

    @property
    def driven(self) -> bool:
        """Whether all of its files are of runs, none of a plan that nobody drove."""
        return PREDICTED not in self.origins

    @property
    def before(self) -> float:
        """Joules of a year of the common program; of a robot whose files don't say it those of its
        files.
        """
        return self.yearly.value if self.common is None else self.common

    @property
    def now(self) -> Amount:
        """Joules of a year as it is today: as driven, and where nobody drove its plan those of the
        common program.
        """
        if self.driven or self.common is None:
            return self.yearly
        return Amount.of_value(self.common)

    @property
    def reached(self) -> Amount | None:
        """How much less than the common program was driven [J]; None where nothing was, or nobody
        knows it.
        """
        if not self.driven or self.saved is None or self.common is None:
            return None
        return reached_saving(self.saved, self.common, self.yearly.value)

    @property
    def above(self) -> float:
        """Joules of a year that were driven above the plan; 0 where no plan was driven."""
        reached = self.reached
        if reached is None or self.saved is None:
            return 0.0
        return self.saved.value - reached.value


def robots_of(members: Sequence[Member], costs: Costs) -> list[Robot]:
    """The robots, those that take most first. Several recordings of a robot (shifts) are
    averaged.
    """
    found = []
    for name in dict.fromkeys(member.robot for member in members):
        own = [member for member in members if member.robot == name]
        savings = [costs.saving_of_year(member.cycle) for member in own]
        saved = [amount for amount in savings if amount is not None]
        years = [costs.common_of_year(member.cycle) for member in own]
        common = [year for year in years if year is not None]
        found.append(
            Robot(
                name,
                ", ".join(dict.fromkeys(member.cell for member in own if member.cell)),
                tuple(dict.fromkeys(member.cycle.origin for member in own)),
                len(own),
                sum(member.cycle.seconds for member in own) / len(own),
                sum(member.cycle.energy for member in own) / len(own),
                mean_of([costs.energy_of_year(member.cycle) for member in own]),
                mean_of(saved) if saved else None,
                sum(common) / len(common) if common else None,
                any(member.cycle.drives_only for member in own),
            )
        )
    return sorted(found, key=lambda robot: -robot.now.value)


def own_members(members: Sequence[Member], robot: Robot) -> list[Member]:
    """The recordings of a robot."""
    return [member for member in members if member.robot == robot.name]


def at_mains(members: Sequence[Member]) -> list[Member]:
    """Those of robots whose energy at the mains is known."""
    apart = {member.robot for member in members if member.cycle.drives_only}
    return [member for member in members if member.robot not in apart]


def saved_and_common(members: Sequence[Member], costs: Costs) -> tuple[Amount | None, float]:
    """Joules of a year that all plans together save, and those of the programs that they are held
    against; None where no recording says it. Several recordings of a robot are averaged.
    """
    robots = robots_of(at_mains(members), costs)
    saved = [robot.saved for robot in robots if robot.saved is not None]
    common = sum(robot.common for robot in robots if robot.common is not None)
    return (sum_of(saved) if saved else None), common


def fleet_of_line(members: Sequence[Member], costs: Costs) -> WholeLine | None:
    """What all plans together save in a year, as a share of the line and of the factory; None where
    no recording says it, or it is open whether anything is saved.
    """
    saved, common = saved_and_common(members, costs)
    if saved is None or saved.doubt:
        return None
    return of_whole_line(saved, common, costs)


def by_mode(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year by robot and power mode."""
    return _summed(
        members,
        ((m, s.name, s.energy) for m in members for s in m.cycle.modes.values()),
        costs,
    )


def by_movement(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year by robot and movement or pause."""
    return _summed(
        members, ((m, s.name, s.energy) for m in members for s in m.cycle.steps.values()), costs
    )


def by_measure(members: Sequence[Member], costs: Costs) -> dict[str, dict[str, float]]:
    """Joules of a year that each measure could save at most, by robot."""
    return _summed(
        members, ((m, name, joules) for m in members for name, joules in m.measures.items()), costs
    )


def _summed(
    members: Sequence[Member], rows: Iterator[tuple[Member, str, float]], costs: Costs
) -> dict[str, dict[str, float]]:
    """Joules of a year by name, then by robot; largest names first."""
    count = {m.robot: sum(other.robot == m.robot for other in members) for m in members}
    found: dict[str, dict[str, float]] = {}
    for member, name, energy in rows:
        cycles = costs.cycles_per_year(member.cycle.pace) / count[member.robot]
        own = found.setdefault(name, {})
        own[member.robot] = own.get(member.robot, 0.0) + energy * cycles
    return dict(sorted(found.items(), key=lambda item: -sum(item[1].values())))


def stands(robot: Robot) -> bool:
    """Whether the common program stands for what a robot takes today."""
    return not robot.driven and robot.common is not None


def as_now(robots: Sequence[Robot]) -> str:
    """What the energies of today are of: of runs that were driven, of common programs, of plans
    that nobody holds against one, or of several of these.
    """
    kinds = (
        ("as driven", any(robot.driven for robot in robots)),
        ("as planned", any(not r.driven and r.common is None for r in robots)),
        (f"{COMMON} where no plan was driven", any(stands(robot) for robot in robots)),
    )
    return ", ".join(name for name, some in kinds if some)


def demand_today(members: Sequence[Member], robot: Robot, costs: Costs) -> Demand:
    """The largest quarter of an hour as the robot is today, on the basis of its bill."""
    own = own_members(members, robot)
    common = stands(robot)
    shifts = max((common and member.common_demand) or member.demand for member in own)
    rests: dict[str, float] = {}
    for member in own:
        rests |= {mode: max(power, rests.get(mode, 0.0)) for mode, power in member.idle.items()}
    return demand_of(shifts, rests, costs, planned=not robot.driven and not common)


def sum_of_demands(demands: Sequence[Demand]) -> Demand:
    """That of robots together, as if their largest quarters came at once."""
    total = demands[0]
    for each in demands[1:]:
        total = total.plus(each)
    return total


def idle_of_robots(members: Sequence[Member], costs: Costs) -> IdleSaving | None:
    """What hibernation saves outside of the shifts, of all robots whose rest is known."""
    rests: dict[str, dict[str, float]] = {}
    for member in members:
        own = rests.setdefault(member.robot, {}) if member.idle else {}
        own.update({mode: max(power, own.get(mode, 0.0)) for mode, power in member.idle.items()})
    modes = set.intersection(*(set(rest) for rest in rests.values())) if rests else set()
    watts_of_all = {mode: sum(rest[mode] for rest in rests.values()) for mode in modes}
    measured = all(member.rest_measured for member in members if member.idle)
    saves = {member.robot: member.rest_saves for member in members}
    known = [saved for saved in saves.values() if saved is not None]
    return idle_saving(watts_of_all, sum_of(known), costs, measured=measured)


def parts_left(
    robots: Sequence[Robot], idle: IdleSaving | None, costs: Costs
) -> list[tuple[Amount, str]]:
    """What rest outside of the shifts, plans that nobody drove and runs at their plan's energy
    would save, each with its words.
    """
    plans = [r.saved for r in robots if not r.driven and r.saved is not None]
    open_plans = sum_of(plans).of(costs.money) if plans else None
    parts = []
    if idle is not None:
        parts.append((idle.money, "at night"))
    if open_plans is not None and open_plans.value > 0.0 and not open_plans.doubt:
        parts.append((open_plans, "by its plan" if len(robots) == 1 else "by plans"))
    above = costs.money(sum(robot.above for robot in robots))
    if abs(above) >= NOTHING:
        parts.append(
            (Amount.of_value(above), "above its plan" if len(robots) == 1 else "above plans")
        )
    return parts


def computed_sentence(members: Sequence[Member]) -> str:
    """What nobody drove of the cycles that count as driven, in a sentence; "" where all was."""
    bases = dict.fromkeys(m.cycle.basis for m in members if m.cycle.computed is not None)
    if not bases:
        return ""
    return f"Pauses that runs shortened count at full length: computed, {' and '.join(bases)}."


UNDRIVEN = "plans that nobody drove: as planned"
"""Of figures that have no common program's beside them."""


_NAMED = 5  # robots in a sentence


def names_of(robots: Sequence[Robot]) -> str:
    """Robots in a sentence, at most some of them by name."""
    names = ", ".join(robot.name for robot in robots[:_NAMED])
    return f"{names} and {len(robots) - _NAMED} more" if len(robots) > _NAMED else names


def origins_of(members: Sequence[Member]) -> str:
    """How many runs of which origin, and how many plans."""
    counts = Counter(member.cycle.origin for member in members)
    return ", ".join(
        counted(count, "plan" if origin == PREDICTED else f"{origin} run")
        for origin, count in counts.items()
    )
