"""How surely does cyclic coordinate descent with set-back find configurations at the interaction
point?
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from _paper_result import (
    FAILS,
    HOLDS,
    Experiment,
    Row,
    Statement,
    finished,
    interval,
    mean,
    mean_difference,
    panels,
    percent,
    share,
)
from _paper_stations import CELLS, MARGIN, Place, cells_of, difference, of_reading, places

from ir_planner.configurations import InteractionSettings
from ir_planner.configurations.ccd_search import descend
from ir_planner.configurations.interaction_point import distinct_configurations, random_starts
from ir_planner.request import Work

# per station and reading
STARTS = 40
QUICK_STARTS = 16
# of each cell and seed, with every reading
VARIANTS = 5
QUICK_VARIANTS = 1
MORE = 50  # variants with the two readings of (5) alone, which differ by little and cost little
NUMBERS = (1, 2, 4, 8, 16, 32)  # starts whose success is compared
# starts from which on a free configuration should be known, at so many % of stations
ASKED = 32
FOUND = 95.0
# where nothing but sweeps brings the tool there: to 1 mm or 2 mrad
MANY_SWEEPS = 80
COARSE = 1e-6
POINTS = 2.0  # percentage points of starts from which on a difference is worth having
NEAR = 1e-3  # rad: a configuration that was found is one of the complete set


DEFAULT = "as read"
PRINTED = "(5) as printed"
GAIN = "(5) by metres"
FREE = "no set-back"
UNIFORM = "(1) uniform"
SWEPT = "no Newton finish"
FREE_SWEPT = "no Newton finish, no set-back"
_SWEEPS = InteractionSettings(newton_steps=0, sweeps=MANY_SWEEPS, finish_every=8, xi=COARSE)
READINGS = {
    DEFAULT: InteractionSettings(),
    PRINTED: InteractionSettings(set_back="printed"),
    GAIN: InteractionSettings(set_back="gain"),
    FREE: InteractionSettings(set_back="none"),
    SWEPT: _SWEEPS,
    "no Newton finish, (5) as printed": replace(_SWEEPS, set_back="printed"),
    "no Newton finish, (5) by metres": replace(_SWEEPS, set_back="gain"),
    FREE_SWEPT: replace(_SWEEPS, set_back="none"),
    UNIFORM: InteractionSettings(distribution="uniform"),
}


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per station and reading: starts, those that ended free, processor time, configurations
    found.
    """
    rows = []
    cells, variants, more = (CELLS[:2], QUICK_VARIANTS, 0) if quick else (CELLS, VARIANTS, MORE)
    whole = {place.scene.cell.name for place in places(cells, seed, variants)}
    for number, place in enumerate(places(cells, seed, variants + more)):
        for name in READINGS if place.scene.cell.name in whole else (DEFAULT, PRINTED):
            rng = np.random.default_rng([seed, number])
            found = tried(place, READINGS[name], rng, QUICK_STARTS if quick else STARTS)
            rows.append(place.words | {"reading": name} | found)
    return rows


def tried(place: Place, settings: InteractionSettings, rng: np.random.Generator, count: int) -> Row:
    """What becomes of so many starts at a place."""
    robot = place.scene.cell.robot
    starts = random_starts(
        robot.position_min, robot.position_max, count, settings.distribution, rng
    )
    work = Work(10**9, np.inf, time.monotonic)
    begin = time.process_time()
    found = descend(place.station.pose, starts, place.scene, place.threshold, settings, work)
    seconds = time.process_time() - begin
    own = distinct_configurations(found.q)
    known = (
        sum(bool((np.abs(own - q).max(axis=1) < NEAR).any()) for q in place.q) if len(own) else 0
    )
    return {
        "starts": count,
        "free": len(found.q),
        "colliding": sum(
            n for reason, n in found.rejected.items() if reason.startswith("at the pose")
        ),
        "seconds": seconds,
        "known": known,
        "complete": len(place.q),
        "closed_form": len(place.scene.inverse_kinematics.solve(place.station.pose[None]).q),
        "sweeps": found.sweeps,
    }


def chance(starts: int, successes: int, drawn: int) -> float:
    """Chance that one of `drawn` starts succeeds, unbiased, where `successes` of `starts` did."""
    if starts - successes < drawn:
        return 1.0
    return 1.0 - math.comb(starts - successes, drawn) / math.comb(starts, drawn)


def chance_of(row: Row, drawn: int) -> float:
    return chance(row["starts"], row["free"], drawn)


def share_free(row: Row) -> float:
    """Of the starts, those that end free at the pose."""
    return float(row["free"] / row["starts"])


def _known(row: Row) -> float:
    return float(row["known"] / row["complete"])


def colliding(rows: Sequence[Row], places: str) -> Statement:
    """Which part of the closed form's configurations collides."""
    parts = [1.0 - row["complete"] / row["closed_form"] for row in rows]
    found = percent(share(parts, [(row["seed"], row["cell"]) for row in rows]))
    says = "for comparison: configurations of the closed form that collide"
    return Statement(says, "share of all at a pose, mean", *found, len(rows), places, "%")


def pays(rows: Sequence[Row], places: str) -> Statement:
    """Successes per second with the set-back over those without."""
    a = of_reading(rows, DEFAULT)
    b = of_reading(rows, FREE)
    both = [key for key in a if key in b]
    longer = [a[k]["seconds"] / b[k]["seconds"] for k in both]
    shares = ([share_free(one[k]) for k in both] for one in (a, b))
    rate = interval(
        lambda longer, a, b: float((a.sum() / b.sum()) / np.mean(longer)),
        longer, *shares, groups=cells_of(both),
    )  # fmt: skip
    figure = "successes per second, with over without"
    return Statement("the set-back pays for its time", figure, *rate, len(both), places, "", 1.0)


def gain(
    rows: Sequence[Row],
    says: str,
    what: str,
    one: str,
    other: str,
    by: Callable[[Row], float],
    places: str,
) -> Statement:
    """What one reading has more of than the other."""
    some, keys = difference(rows, one, other, by)
    means = mean_difference(some, cells_of(keys))
    return Statement(
        says, f"{what}, {one} less {other}", *means, len(some), places, "points", POINTS
    )


def judge(rows: Sequence[Row]) -> list[Statement]:
    """Success of the search, and what each of its parts adds."""
    by_station = of_reading(rows, DEFAULT)
    default = list(by_station.values())
    cells = cells_of(by_station)
    starts = min(ASKED, default[0]["starts"])
    sure = percent(share([chance_of(row, starts) for row in default], cells))
    complete = interval(mean, [100.0 * _known(row) for row in default], groups=cells)
    first = f"{starts} starts find a free configuration"
    several = f"{starts} starts reach more stations with the set-back, where no Newton finishes it"
    bare = "Newton's finish lets more starts arrive where nothing is set back"
    spread = "the normal distribution of (1) finds more of the complete set"
    whole = "the search finds the complete set"
    known = "of all free configurations"

    def more(
        says: str,
        one: str,
        other: str,
        what: str = "starts that succeed",
        by: Callable[[Row], float] = share_free,
    ) -> Statement:
        return gain(rows, says, what, one, other, by, "stations")

    return [
        Statement(first, "chance, mean of the "
"stations", *sure, len(default), "stations", "%", FOUND),
        more("the set-back of (5) lets more starts end free", DEFAULT, FREE),
        more("the same where no Newton finishes it", SWEPT, FREE_SWEPT),
        more("(5) as read, a secant, does better than as printed", DEFAULT, PRINTED),
        more("Newton's finish lets more starts arrive", DEFAULT, SWEPT),
        more("the normal distribution of (1) does better than a uniform one", DEFAULT, UNIFORM),
        more(several, SWEPT, FREE_SWEPT, "chance of a free one", lambda row: chance_of(row, starts)),  # noqa: E501
        pays(rows, "stations"),
        Statement(whole, f"{known} found by {default[0]['starts']} starts, mean", *complete,
                  len(default), "stations", "%", FOUND),
        more(bare, FREE, FREE_SWEPT),
        more(spread, DEFAULT, UNIFORM, known, _known),
        colliding(default, "stations"),
    ]  # fmt: skip


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    sure, back, alone, printed, newton, normal, hard, rate, complete, swept, spread, blocked = (
        statements
    )
    works = {HOLDS: "The search works", FAILS: "The search is not sure"}.get(
        sure.verdict, "Whether the search is sure enough is open"
    )
    drop = "lets more starts end free" if back.low > 0.0 else "lets no more starts end free"
    drop = "costs more starts than it keeps" if back.high < 0.0 else drop
    pays = {
        HOLDS: "it pays for its time",
        FAILS: "it does not pay for its time, for more starts, sorted out at the end, are cheaper",
    }.get(rate.verdict, "whether it pays is open")
    helps = {HOLDS: "it helps", FAILS: "it does not help"}.get(hard.verdict, "it may help")
    where = (
        "No configuration of the closed form collides at these stations: what sorting out at the "
        "end would lose is measured in the next chapter."
        if blocked.value == 0.0
        else f"{blocked.value:.1f} % of the closed form's configurations collide here."
    )
    return (
        f"{works}: a free configuration is known from {ASKED} starts at {sure.value:.1f} % of "
        f"the stations. The set-back {drop} ({back.value:+.1f} points; {alone.value:+.1f} "
        f"without Newton's finish), at {1.0 / rate.value:.1f} times the time per success: "
        f"{pays}. Where sweeps alone must arrive, without Newton's finish, {helps}: the chance "
        f"of {ASKED} starts changes by {hard.value:+.1f} points. {where} Reading (5) as a secant "
        f"changes {printed.value:+.1f} points, Newton's finish {newton.value:+.1f} with the "
        f"set-back and {swept.value:+.1f} without (against {MANY_SWEEPS} sweeps), the normal "
        f"distribution {normal.value:+.1f} of single starts and {spread.value:+.1f} of the "
        f"complete set. {complete.value:.0f} % of the complete set are found; the planner's "
        "default is the closed form, which has all of it; arms without one have a search of "
        "their own, and CCD is asked for by name."
    )


def _with_all_readings(rows: Sequence[Row], name: str) -> list[Row]:
    """Rows of a reading at the stations where every reading was tried."""
    mine = of_reading(rows, name)
    others = [of_reading(rows, other) for other in READINGS]
    return [row for key, row in mine.items() if all(key in other for other in others)]


def chances(rows: Sequence[Row]) -> Row:
    """Of a free configuration, by the number of starts: mean of the places."""
    found = {}
    for number in NUMBERS:
        some = [chance_of(row, number) for row in rows if row["starts"] >= number]
        found[f"{number}"] = f"{100.0 * np.mean(some):.1f} %" if some else ""
    return found


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Success by number of starts, for each reading."""
    found = []
    for name in READINGS:
        mine = _with_all_readings(rows, name)
        milliseconds = [1e3 * row["seconds"] / row["starts"] for row in mine]
        line = {"reading": name, **chances(mine), "ms per start": f"{np.median(milliseconds):.2f}"}
        found.append(line)
    return {"Chance that so many starts find a free configuration, mean of the stations": found}


def draw(rows: Sequence[Row], file: Path) -> None:
    """Success over the number of starts, and over processor time."""
    figure, (axes, over_time) = panels(2, width=4.4, height=3.4)
    for name in READINGS:
        mine = _with_all_readings(rows, name)
        numbers = [n for n in NUMBERS if n <= mine[0]["starts"]]
        chances = [100.0 * np.mean([chance_of(r, n) for r in mine]) for n in numbers]
        each = 1e3 * float(np.mean([row["seconds"] / row["starts"] for row in mine]))
        axes.plot(numbers, chances, "o-", ms=3, label=name)
        over_time.plot([n * each for n in numbers], chances, "o-", ms=3)
    axes.set(xscale="log", xlabel="starts", ylabel="chance of a free configuration [%]")
    axes.set_xticks(NUMBERS, [str(n) for n in NUMBERS])
    over_time.set(xscale="log", xlabel="processor time of the starts [ms]")
    axes.legend(fontsize=8)
    finished(figure, file)


EXPERIMENT = Experiment(
    "ccd",
    "CCD with set-back from many starts, eqs. (1) to (6)",
    "Goal configurations at the interaction point are found by cyclic coordinate descent (3) "
    "from p random starts (1); a joint whose step ends in collision is set back in proportion to "
    "the metric distance (5); what is near enough and free is accepted (6).",
    f"All stations of {', '.join(CELLS)} and of {2 * VARIANTS - 1} mirrored, turned and jittered "
    f"variants of each; {STARTS} starts per station for each reading: (5) as a secant or as "
    "printed, none at all (collisions sorted out at the end), all three also without Newton's "
    f"finish but {MANY_SWEEPS} sweeps and arrived at 1 mm, (1) uniform; {2 * MORE} further "
    "variants of each with both readings of (5) only. Only stations where the closed form has a "
    f"free configuration. {MARGIN}",
    measure,
    judge,
    follows,
    tables,
    draw,
    "Chance of a free configuration over the number of starts (left) and over their processor "
    "time (right).",
)
