"""What follows from the statistics in words, and what does not."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ir_recorder.analysis.intervals import ALIKE
from ir_recorder.report.number_text import DASH
from ir_studies.statistics.failures import NO_PAIR, NOT_DRIVEN
from ir_studies.statistics.figures import Comparison, Findings
from ir_studies.statistics.settings import DRAWN, StatisticsSettings

FEW = 30
"""Pairs below which a mean may miss the few that carry it: drawn from the differences of `demo`,
the interval holds their mean in 90 % of samples of 30, in 62 % of samples of 10
(benchmarks/studies.py --only statistics).
"""
_SAID = ("duration", "energy, direct", "energy, predicted")


def sentences(found: Findings, settings: StatisticsSettings) -> list[str]:
    """Sentences for people, the counts first."""
    return [
        *_counts(found),
        *_timings(found),
        *_rule(found, settings),
        *_measurements(found, settings),
        *_limits(found, settings),
    ]


def _counts(found: Findings) -> Iterator[str]:
    own = found.solved - found.same
    again = f", {found.different} of them different" if found.different < own else ""
    have = "has" if found.solved == 1 else "have"
    are = "is" if own == 1 else "are"
    yield (
        f"{found.solved} of {_some(found.pairs, 'pair')} {have} a certified movement with both "
        f"timings; in {found.same} of them the asynchronous answer is the synchronous one, so "
        f"{own} {are} compared{again}."
    )
    for what, of in ((NO_PAIR, "of timings"), (NOT_DRIVEN, "of what is measured")):
        failures = [each for each in found.failures if each.what == what]
        if failures:
            count = sum(each.count for each in failures)
            most = max(failures, key=lambda each: each.count)
            often = "" if most.count == count else f"most often ({most.count}) "
            why = most.example.partition(";")[0].rstrip(".")
            yield f"Left out of comparisons {of}: {_some(count, what)}, {often}since {why}."


def _timings(found: Findings) -> Iterator[str]:
    for each in found.comparisons:
        if each.name in _SAID and each.count:
            yield (
                f"Asynchronous against synchronous, {each.name}: "
                f"{difference(each)}{_of_all(each, found)}."
            )


def _of_all(each: Comparison, found: Findings) -> str:
    if not found.same or each.count != found.solved - found.same:
        return ""
    value = each.mean.value * each.count / found.solved
    return f"; over all {found.solved} pairs, where the same answer counts as 0, {signed(value)}"


def _rule(found: Findings, settings: StatisticsSettings) -> Iterator[str]:
    """What the planner's own rules make of a comparison, which is then no finding."""
    own = found.solved - found.same
    if not own:
        return
    if settings.objective == "time":
        yield (
            "With the objective time the synchronous answer is a candidate of the asynchronous "
            "request, so "
            f"that none may be slower: a rule, no finding. Slower are {found.slower} of {own}."
        )
    elif settings.planner:
        yield (
            f"The planner {settings.planner} gives joints laws of their own wherever it can, "
            f"also where these serve the objective less; {found.slower} of {own} take longer. "
            "With the objective time, or the portfolio, the synchronous answer is a candidate."
        )
    else:
        yield (
            f"Joints have laws of their own only where these are better by {settings.objective} as "
            "predicted: that they are better by it is a rule, no finding."
        )


def _measurements(found: Findings, settings: StatisticsSettings) -> Iterator[str]:
    for each in found.agreements:
        if each.count:
            spread = (
                f"; single movements spread by {each.spread:.1f} %"
                if math.isfinite(each.spread)
                else ""
            )
            yield f"Energy, {each.name}: {difference(each)}{spread}."
    if found.driven and math.isfinite(found.covered):
        robots = (
            "each pair's by a robot drawn for it"
            if settings.plant == DRAWN
            else f"all of one robot, which says little of the interval: with `plant: {DRAWN}` "
            "each pair has a robot of its own"
        )
        yield (
            "The predicted 90 % interval holds the directly measured energy of "
            f"{round(found.covered * found.driven)} of {_some(found.driven, 'movement')}, {robots}."
        )


def _limits(found: Findings, settings: StatisticsSettings) -> Iterator[str]:
    said = [each for each in found.comparisons if each.name in _SAID and each.count]
    if any(0 < each.pairs < FEW for each in (*said, *found.agreements)):
        yield (
            f"Fewer than {FEW} pairs may miss the few that carry a mean, and its interval then "
            "holds less often than 90 %: ask for more pairs."
        )
    elif any(each.skewed for each in said):
        yield (
            "Where few pairs carry a mean its interval may hold less often than 90 %: look at "
            "the dots."
        )
    tested = sum(math.isfinite(each.chance) for each in found.comparisons)
    if tested > 1:
        yield (
            f"What is shown of the timings counts {tested} comparisons together (Holm): by "
            "chance alone any of them would be shown in at most one study of ten."
        )
    if not found.solved and not found.driven:
        yield "Nothing follows from that."
        return
    robots = "these simulated robots" if settings.plant == DRAWN else "this simulated robot"
    yield (
        "Energies are those at the mains, controller and tool included. It holds for movements "
        f"between these places, drawn alike, of {robots}; nothing follows for other cells, nor "
        "for a real robot, whose power no meter has read here."
    )


def difference(each: Comparison) -> str:
    """A mean with its interval, what is shown by it, and how large that is beside its spread."""
    what = _some(each.pairs, "pair")
    if each.count != each.pairs:
        what = f"{_some(each.count, 'movement')} of {what}"
    if math.isnan(each.mean.low):
        alike = "all alike" if each.pairs > 1 else "which says nothing of others"
        return f"{signed(each.mean.value)} in {what}, {alike}"
    interval = f"{signed(each.mean.low)} to {signed(each.mean.high)} with 90 % confidence"
    return f"{signed(each.mean.value)} ({interval}, {what}): {_shown(each)}{_median(each)}"


def _median(each: Comparison) -> str:
    """Where it says more than the mean: most pairs differ in one direction, or few carry a mean."""
    aside = each.median.low > 0.0 or each.median.high < 0.0
    if each.shown == aside or math.isnan(each.median.low):
        return ""
    interval = f"{signed(each.median.low)} to {signed(each.median.high)}"
    return f"; the median is {signed(each.median.value)} ({interval})"


def _shown(each: Comparison) -> str:
    if each.shown:
        carried = ", carried by few" if each.skewed else ""
        return f"a difference is shown, {effect_words(each.effect)}{carried}"
    if each.outside:
        return "zero lies outside, but among so many comparisons it is not shown"
    if each.pairs < FEW:
        return "no difference is shown"
    most = signed(max(abs(each.mean.low), abs(each.mean.high))).lstrip("+")
    return f"no difference is shown, the means are equal within {most}"


def signed(value: float) -> str:
    """Percent with its sign and two decimals, more where it is smaller; zero has no sign."""
    if not math.isfinite(value):
        return DASH
    size = abs(value)
    if size < ALIKE:
        return "0.00 %"
    return f"{value:+.{max(2, math.ceil(-math.log10(size)))}f} %"


def effect_words(effect: float) -> str:
    """An effect size in the words that are usual for Cohen's d."""
    size = abs(effect)
    names = ((0.2, "very small"), (0.5, "small"), (0.8, "medium"), (math.inf, "large"))
    word = next(name for most, name in names if size < most)
    return f"{word} beside its spread (d = {effect:.2f})"


def _some(count: int, what: str) -> str:
    """So many of something, of which the first word is the noun."""
    first, *rest = what.split()
    named = first.removesuffix("s") if count == 1 else f"{first.removesuffix('s')}s"
    return " ".join([str(count), named, *rest])
