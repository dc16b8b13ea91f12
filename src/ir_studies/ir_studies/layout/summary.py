"""What follows from a layout study, in sentences."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence

from ir_recorder.report.number_text import joules, percent
from ir_studies.layout.finals import Final, mean_cost
from ir_studies.layout.placement import Known
from ir_studies.layout.search import BATCH
from ir_studies.layout.settings import LayoutSettings

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
    free = f"J (energy of the drives + {settings.time_value:g} W x seconds of the movements)"
    timed = "joules at the mains per cycle"
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
    by = f", by more than {100 * settings.margin:g} % of these" if settings.margin > 0.0 else ""
    if settings.in_cycles:
        return (
            "One of the others can be the best only if it lies further below the line of joules "
            f"over what coarse movements cost than each of the {planned} that were planned{by}."
        )
    return (
        "One of the others can be the best only if its plan costs less above its coarse "
        f"movements than each of the {planned} that were planned{by}."
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
    within = best.interval
    worse = given is not None and best.mean("cost_j") > given.mean("cost_j")
    name = "Best of the others" if worse else "Best"
    said = (
        f"{name} ({best.placement.key}; {best.condition.text}): {joules(best.mean())} at the "
        f"mains per cycle, predicted, 90 % interval {joules(within.low)} to {joules(within.high)}"
    )
    if len(best.rows) > 1:
        said += f", {joules(best.spread())} between {len(best.rows)} seeds"
    return f"{said}." if given is None else f"{said}; {against(best, given)}"


def against(best: Final, given: Final) -> str:
    """What a placement saves, or takes more than the given one, with its interval."""
    less, saved = best.saving(given)
    does, sign = ("saves", 1.0) if less >= 0.0 else ("takes more:", -1.0)
    low, high = sorted((sign * saved.low, sign * saved.high))
    sure = "" if low > 0.0 else "; zero lies in it: it is open whether anything is saved"
    moving = best.mean("moving_j") / given.mean("moving_j") - 1.0
    return (
        f"the given one {joules(given.mean())}. It {does} {joules(sign * less)}, "
        f"{percent(sign * less / given.mean()).lstrip('+')} (90 % interval {joules(low)} to "
        f"{joules(high)}{sure}); of the movements alone {percent(moving)}. A cycle takes "
        f"{best.mean('duration_s'):.2f} s instead of {given.mean('duration_s'):.2f} s."
    )


def reasons(impossible: Sequence[Known]) -> str:
    """Kinds with their counts in brackets."""
    counts = Counter(one.reason[0] for one in impossible)
    shown = ", ".join(f"{kind} {count}" for kind, count in counts.most_common(SHOWN))
    return f" ({shown})" if shown else ""


def given_reason(known: Sequence[Known]) -> str:
    """Why the given placement is impossible."""
    return known[0].reason[1]
