"""Summary of a layout study: the best placements with their intervals, and sentences."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ir_planner.checks import JouleInterval, interval
from ir_recorder.report.number_text import kilowatt_hours, percent, seconds, span_of
from ir_studies.layout.placement import FIRST_SEED, Known, Placement
from ir_studies.layout.search import BATCH, GIVEN, best_of
from ir_studies.layout.settings import LayoutSettings, PlacementCondition
from ir_studies.work import Job, Row

# Error bars: seeds, and what is not known of the robot. The interval of a saving is that of the
# difference over the same drawn robots, as for all savings.


@dataclass(frozen=True)
class Final:
    """A placement under a condition. rows: by seed; robots (ROBOTS,): what the drawn robots add,
    J.
    """

    placement: Placement
    condition: PlacementCondition
    rows: tuple[Row, ...]

    @property
    def solved(self) -> bool:
        """Whether every seed gave a certified program."""
        return all(row.get("solved") for row in self.rows)

    def mean(self, name: str = "energy_j") -> float:
        """Mean of a figure over the seeds."""
        return float(np.mean([row[name] for row in self.rows])) if self.solved else math.nan

    def spread(self, name: str = "energy_j") -> float:
        """Largest less smallest over the seeds."""
        return float(np.ptp([row[name] for row in self.rows])) if self.solved else math.nan

    @property
    def is_given(self) -> bool:
        """Whether everything stands where the cell file has it."""
        return self.placement.key == GIVEN.key

    @property
    def pace(self) -> float:
        """From one cycle to the next [s]: of the given placement as on the page of its plan, which
        counts as many as its common program makes; elsewhere its own.
        """
        return float(self.rows[0].get("common_s", self.mean("duration_s")))

    @property
    def robots(self) -> np.ndarray:
        """What the drawn robots add (ROBOTS,) to its joules."""
        return np.array(self.rows[0]["robots"])

    @property
    def interval(self) -> JouleInterval:
        """The 90 % interval of its joules."""
        return interval(self.mean(), self.robots)

    def saving(self, given: Final) -> tuple[float, JouleInterval]:
        """Joules that it takes less than the given one, with their 90 % interval."""
        less = given.mean() - self.mean()
        return less, interval(less, given.robots - self.robots)


def final_jobs(known: Sequence[Known], settings: LayoutSettings) -> list[Job]:
    """Plans of the best and of the given placement with all seeds; the first seed with the drawn
    robots.
    """
    return [
        job for placement in finalists(known, settings) for _, job in _jobs(placement, settings)
    ]


def finalists(known: Sequence[Known], settings: LayoutSettings) -> list[Placement]:
    """The given placement, then the best of the others."""
    others = [one for one in known if one.placement.key != GIVEN.key]
    best = [one.placement for one in best_of(others, settings.keep)]
    feasible = [
        one.placement
        for one in known
        if one.placement.key == GIVEN.key and math.isfinite(one.coarse)
    ]
    return [*feasible, *best]


def finals(
    known: Sequence[Known], settings: LayoutSettings, rows: Mapping[str, Row]
) -> list[tuple[Final, ...]]:
    """Of each finalist one per condition: the given placement first, then by their mean cost."""
    found = []
    for placement in finalists(known, settings):
        by: dict[PlacementCondition, list[Row]] = {}
        for condition, job in _jobs(placement, settings):
            by.setdefault(condition, []).append(rows[job.key])
        found.append(
            tuple(Final(placement, condition, tuple(own)) for condition, own in by.items())
        )
    return sorted(
        found, key=lambda own: (not own[0].is_given, mean_cost(own), own[0].placement.key)
    )


def mean_cost(own: Sequence[Final]) -> float:
    """Mean cost over conditions and seeds; inf where one is impossible."""
    if not all(one.solved for one in own):
        return math.inf
    return float(np.mean([one.mean("cost_j") for one in own]))


def _jobs(
    placement: Placement, settings: LayoutSettings
) -> Iterator[tuple[PlacementCondition, Job]]:
    for condition in settings.conditions:
        for seed in range(FIRST_SEED, FIRST_SEED + settings.seeds):
            yield condition, placement.plan(condition, seed, robots=seed == FIRST_SEED)


SHOWN = 4  # reasons


def sentences(
    known: Sequence[Known], finals: Sequence[Sequence[Final]], settings: LayoutSettings
) -> Iterator[str]:
    """How many were looked at, what is impossible, and the best against the given placement."""
    impossible = [one for one in known if one.cost == math.inf]
    planned = sum(math.isfinite(one.cost) for one in known)
    yield (
        f"{len(known)} placements looked at: {len(impossible)} impossible{reasons(impossible)}, "
        f"{planned} planned in full."
    )
    if planned and planned + len(impossible) < len(known):
        yield bound_words(sum(one.planned for one in known), settings)
        yield cost_words(settings)
    elif planned and len(known) > 1:
        yield all_words(sum(one.planned for one in known))
        yield cost_words(settings)
    given, best = ends(finals)
    if given is None and best is None:
        yield "No placement is possible."
    if given is None:
        yield "The given placement is impossible itself: " + given_reason(known)
    if given is not None and best is not None and mean_cost(given) <= mean_cost(best):
        yield (
            "The given placement is the best of those that were planned: none of the others "
            "costs less."
        )
    for one in best or ():
        yield words(one, None if given is None else of_condition(given, one))
    if given is not None and best is None:
        others = "None of the others is possible" if len(known) > 1 else "No other was looked at"
        yield f"{others}: the given placement stays."


def cost_words(settings: LayoutSettings) -> str:
    """What placements are compared by."""
    free = f"energy of the drives + {settings.time_value:g} W x seconds of the movements"
    timed = "energy at the mains per cycle"
    kinds = [free] * (not all(settings.cycle_times)) + [timed] * settings.in_cycles
    over = f", mean over {count} conditions" if (count := len(settings.conditions)) > 1 else ""
    by = f"{free} without a cycle time, by {timed} in one" if len(kinds) > 1 else kinds[0]
    return f"Placements are compared by {by}{over}."


def all_words(planned: int) -> str:
    """That the bound left out nothing, so that nothing is learnt of it. planned: how many were."""
    few = f": the first {BATCH} are planned before there is a bound" if planned <= BATCH else ""
    return f"All that a look found possible were planned, the bound left out none{few}."


def bound_words(planned: int, settings: LayoutSettings) -> str:
    """Why the others were not planned. planned: how many were, the impossible among them."""
    if settings.plans and planned >= settings.plans:
        return f"The others were not planned: at most {settings.plans} plans were asked for."
    by = f", less {100 * settings.margin:g} % of that," if settings.margin > 0.0 else ""
    end = f"any of the {planned} planned{by} they would cost more than the best."
    if settings.in_cycles:
        return (
            "The others were not planned in full: even as far below what their coarse movements "
            f"let expect as {end}"
        )
    return (
        "The others were not planned in full: even with the least that planning added to the "
        f"coarse cost of {end}"
    )


def ends(
    finals: Sequence[Sequence[Final]],
) -> tuple[Sequence[Final] | None, Sequence[Final] | None]:
    """The given placement and the best of the others, None where there is none that is possible."""
    possible = [own for own in finals if all(one.solved for one in own)]
    given = next((own for own in possible if own[0].is_given), None)
    best = next((own for own in possible if not own[0].is_given), None)
    return given, best


def of_condition(own: Sequence[Final], like: Final) -> Final:
    """The one of the same condition."""
    return next(one for one in own if one.condition == like.condition)


def words(best: Final, given: Final | None) -> str:
    """The best of the others under a condition, against the given one."""
    between = span_of(best.interval.low, best.interval.high, kilowatt_hours)
    worse = given is not None and best.mean("cost_j") > given.mean("cost_j")
    name = "Best of the others" if worse else "Best"
    said = (
        f"{name} ({best.placement.key}; {best.condition.text}): {kilowatt_hours(best.mean())} at "
        f"the mains per cycle, predicted, 90 % interval {between}"
    )
    if len(best.rows) > 1:
        said += f", {kilowatt_hours(best.spread())} between {len(best.rows)} seeds"
    return f"{said}." if given is None else f"{said}; {against(best, given)}"


def against(best: Final, given: Final) -> str:
    """What a placement saves, or takes more than the given one, with its interval."""
    less, saved = best.saving(given)
    does, sign = ("saves", 1.0) if less >= 0.0 else ("takes more:", -1.0)
    low, high = sorted((sign * saved.low, sign * saved.high))
    between = span_of(low, high, kilowatt_hours)
    sure = "" if low > 0.0 else "; zero lies in it: it is open whether anything is saved"
    moving = 1.0 - best.mean("moving_j") / given.mean("moving_j")
    change = f"{percent(abs(moving)).lstrip('+')} {'less' if moving >= 0.0 else 'more'}"
    faster = given.mean("duration_s") - best.mean("duration_s")
    by = seconds(abs(faster))
    pace = (
        "as long as before"
        if by == seconds(0.0)
        else f"{by} {'less' if faster > 0.0 else 'more'} than before"
    )
    return (
        f"the given one {kilowatt_hours(given.mean())}. It {does} {kilowatt_hours(sign * less)}, "
        f"{percent(sign * less / given.mean()).lstrip('+')} (90 % interval {between}{sure}); the "
        f"movements alone take {change}. A cycle takes {pace}."
    )


def reasons(impossible: Sequence[Known]) -> str:
    """Kinds with their counts in brackets."""
    counts = Counter(one.reason[0] for one in impossible)
    shown = ", ".join(f"{kind} {count}" for kind, count in counts.most_common(SHOWN))
    return f" ({shown})" if shown else ""


def given_reason(known: Sequence[Known]) -> str:
    """Why the given placement is impossible."""
    return known[0].reason[1]
