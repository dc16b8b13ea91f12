"""What pages call the programs of a year, and what a figure of one of them is: simulated, measured,
predicted, or computed in part.
"""

from __future__ import annotations

from ir_recorder.analysis.production import (
    Amount,
    Production,
)
from ir_recorder.report.number_text import (
    kilowatt_hours,
    seconds,
    share,
)

TODAY = "today's program"


COMMON = "common program"


PLANNED = "planned program"
"""The programs that are compared, on every page by the same name: today's, what stands for it where
nobody gave it, and the planner's.
"""


DRIVEN = "as driven"
"""What a year of a cycle that was driven is called."""


ON_BRAKES = "on closed brakes"
"""How a robot rests outside of the shifts where nobody puts it into another mode."""


def computed_words(*cycles: Production) -> str:
    """How much of cycles that were driven nobody drove, and what that is from; "" where all of it
    was.
    """
    rests = [cycle.computed for cycle in cycles if cycle.computed is not None]
    if not rests:
        return ""
    part = share(sum(rest.energy for rest in rests), sum(cycle.energy for cycle in cycles))
    bases = dict.fromkeys(cycle.basis for cycle in cycles if cycle.computed is not None)
    return f"{part} of it computed: {rests[0].name}, {' and '.join(bases)}"


def origin_of(cycle: Production) -> str:
    """Whether a cycle was simulated, measured or predicted, and what of it was computed."""
    computed = computed_words(cycle)
    return f"{cycle.origin}, {computed}" if computed else cycle.origin


def driven_detail(cycle: Production) -> str:
    """What such a year is of; its full pauses are named, where nobody drove them."""
    pauses = "" if cycle.computed is None else ", full pauses computed"
    return f"{cycle.origin}{pauses}"


def own_pace(cycle: Production | None) -> str:
    """That a plan's steps are those of the program as fast as pays, where its money is of the same
    stops in the common program's time, and how far they are apart; "" elsewhere.
    """
    if cycle is None or cycle.own is None:
        return ""
    sooner = seconds(cycle.seconds - cycle.own.seconds)
    word, energy = Amount.of_value(cycle.energy - cycle.own.energy).gain()
    less = "less" if word == "saved" else "more"
    return (
        f"Steps, motion and charts are of the planned program as fast as pays: {sooner} sooner "
        f"and {kilowatt_hours(energy.value)} {less} a cycle than in the common program's time, "
        "which all money is of."
    )
