"""What follows from the statistics in words, and what does not."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ir_recorder.report.words import DASH
from ir_studies.statistics.figures import Comparison, Findings

FEW = 10  # pairs below which a mean says little
_SAID = ("duration", "energy, direct", "energy, predicted")


def sentences(found: Findings) -> list[str]:
    """Sentences for people, the counts first."""
    return [*_counts(found), *_timings(found), *_measurements(found), *_limits(found)]


def _counts(found: Findings) -> Iterator[str]:
    own = found.solved - found.same
    yield (
        f"{found.solved} of {found.pairs} pairs have a certified movement with both timings; in "
        f"{found.same} of them the asynchronous answer is the synchronous one, so {own} are compared."
    )


def _timings(found: Findings) -> Iterator[str]:
    for each in found.comparisons:
        if each.name in _SAID and each.count:
            yield f"Asynchronous against synchronous, {each.name}: {difference(each)}."


def _measurements(found: Findings) -> Iterator[str]:
    for each in found.agreements:
        if each.count:
            said = difference(each, "movements")
            yield f"Energy, {each.name}: {said}; single movements spread by {each.spread:.1f} %."
    if found.driven:
        yield (
            f"The predicted 90 % interval holds the directly measured energy of "
            f"{100.0 * found.covered:.0f} % of {found.driven} movements."
        )


def _limits(found: Findings) -> Iterator[str]:
    own = found.solved - found.same
    if 0 < own < FEW:
        yield f"With {own} pairs these means say little: ask for more pairs."
    elif own:
        yield (
            f"Of {len(found.comparisons)} comparisons at 90 % one in ten shows a difference by chance alone."
        )
    yield (
        "It holds for movements between these places, drawn alike, of this simulated robot; nothing follows "
        "for other cells, nor for a real robot, whose power no meter has read here."
    )


def difference(each: Comparison, what: str = "pairs") -> str:
    """A mean with its interval, whether a difference is shown, and how large it is beside its spread."""
    if math.isnan(each.mean.low):
        return f"{signed(each.mean.value)}, one of the {what}"
    shown = "a difference" if each.shown else "no difference"
    size = f", {effect_words(each.effect)}" if each.shown and math.isfinite(each.effect) else ""
    interval = f"{signed(each.mean.low)} to {signed(each.mean.high)} with 90 % confidence"
    return f"{signed(each.mean.value)} ({interval}, {each.count} {what}): {shown} is shown{size}"


def signed(value: float) -> str:
    """Percent with its sign; zero has none."""
    shown = f"{value:+.2f}"
    return f"{shown.lstrip('+-') if float(shown) == 0.0 else shown} %" if math.isfinite(value) else DASH


def effect_words(effect: float) -> str:
    """An effect size in the words that are usual for Cohen's d."""
    size = abs(effect)
    word = "small" if size < 0.5 else "medium" if size < 0.8 else "large"
    return f"{word} beside its spread (d = {effect:.2f})"
