"""Statistics for studies.py: the documented studies, judged by figures of their own from the rows
alone.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean, median, stdev
from typing import Any

import numpy as np
from _results import Claim, at_least, at_most, line_of
from scipy.integrate import quad
from scipy.optimize import brentq

from ir_recorder.analysis.intervals import alike, mean_of
from ir_studies import Means
from ir_studies.statistics import EXAMPLE, StatisticsSettings, run_statistics
from ir_studies.statistics.findings import Comparison
from ir_studies.statistics.runs import FinishedStatistics
from ir_studies.statistics.settings import DRAWN
from ir_studies.studies import study_of
from ir_studies.work.results import NAME
from ir_values.arrays import FloatArray

STATISTICS_PARTS = ("statistics",)
QUICK = 8  # pairs
SAMPLES = 10_000
COUNTS = (10, 20, 30, 60, 100)  # pairs of a sample
COLUMNS = (
    "duration_s",
    "predicted_j",
    "direct_j",
    "indirect_j",
    "peak_w",
    "path_m",
    None,
    "torque_share",
)
# samples of a distribution, and values in each
SIMULATED = 20_000
SIZES = (10, 20, 60, 200)
HELD = 80.0  # %: of robots drawn for 60 pairs 90 % +- 10 % lie in a 90 % interval


def statistics_claims(parts: Collection[str], out: Path | None, *, quick: bool) -> list[Claim]:
    """Claims about the study that `ir study statistics --example` asks for, the same with a robot
    of its own for each pair, and one for the fastest; quick: the first alone, with few pairs.
    """
    if "statistics" not in parts:
        return []
    asked: StatisticsSettings = study_of(EXAMPLE).settings
    asked = replace(asked, pairs=QUICK) if quick else asked
    with tempfile.TemporaryDirectory() as place:
        folder = (out or Path(place)) / "statistics"
        one = made(asked, folder / "example")
        if quick:
            return recomputed(one, folder / "example")
        drawn = made(replace(asked, plant=DRAWN), folder / "drawn")
        fastest = made(
            replace(asked, objective="time", pairs=min(asked.pairs, 20)), folder / "time"
        )
        claims = [*recomputed(one, folder / "example"), *held(drawn), *never_slower(fastest)]
    resampled(one)
    simulated()
    return claims


def made(settings: StatisticsSettings, folder: Path) -> FinishedStatistics:
    """Run a study and print what it says."""
    finished = run_statistics(settings, folder, Means())
    print(
        f"{settings.objective}, plant {settings.plant}: {finished.summary}\n{finished.summed_up}",
        flush=True,
    )
    return finished


def recomputed(finished: FinishedStatistics, folder: Path) -> list[Claim]:
    """Figures of the study against those computed here from the lines of its results."""
    rows = [json.loads(line) for line in (folder / NAME).read_text().splitlines()]
    rows = sorted((row for row in rows if "key" in row), key=lambda row: int(row["key"]))
    own = [row for row in rows if both(row) and row["asynchronous"]["timing"] == "asynchronous"]
    off = [
        largest(each, [[(row["asynchronous"][name], row["synchronous"][name])] for row in own])
        for each, name in zip(finished.findings.comparisons, COLUMNS, strict=True)
        if name is not None
    ]
    for each, name in zip(finished.findings.agreements, ("predicted_j", "indirect_j"), strict=True):
        by_pair = [[(one[name], one["direct_j"]) for one in movements(row)] for row in rows]
        off.append(largest(each, [sides for sides in by_pair if sides]))
    return [at_most("statistics: page against figures computed from its rows", max(off), "%", 1e-6)]


def both(row: dict[str, Any]) -> bool:
    """Whether both timings have a movement."""
    return all(row.get(timing, {}).get("solved") for timing in ("synchronous", "asynchronous"))


def movements(row: dict[str, Any]) -> list[dict[str, Any]]:
    """The measured movements of a pair that are not the same one."""
    found = {
        one["trajectory_id"]: one
        for one in row.values()
        if isinstance(one, dict) and one.get("solved")
    }
    return [one for one in found.values() if math.isfinite(one["direct_j"])]


def percent(first: float, second: float) -> float:
    """By how much the first is more."""
    return 100.0 * (first - second) / second


def largest(each: Comparison, pairs: Sequence[Sequence[tuple[float, float]]]) -> float:
    """The largest difference [%] of a comparison's mean, interval and median from those of the
    movements of pairs, each with both of its figures.
    """
    values = [fmean(percent(*sides) for sides in own) for own in pairs]
    first, second = ([fmean(sides[k] for sides in own) for own in pairs] for k in (0, 1))
    ratio = sum(first) / sum(second)
    scale = 100.0 / fmean(second)
    linear = [
        100.0 * (ratio - 1.0) + scale * (a - ratio * b) for a, b in zip(first, second, strict=True)
    ]
    if len(values) < 2 or max(values) - min(values) < 1e-6:
        return 0.0
    mean = 100.0 * (ratio - 1.0)
    expected = (mean, *ends(linear, t_quantile(0.95, len(values) - 1)), median(values))
    found = (each.mean.value, each.mean.low, each.mean.high, each.median.value)
    return max(abs(a - b) for a, b in zip(found, expected, strict=True))


def ends(values: Sequence[float], t: float) -> tuple[float, float]:
    """Of the interval of a mean: the union of Student's and of Hall's, whose cubic is solved
    here.
    """
    count = len(values)
    mean = fmean(values)
    spread = stdev(values)
    third = fmean([(value - mean) ** 3 for value in values]) / spread**3
    k = third * count**2 / ((count - 1) * (count - 2)) / math.sqrt(count) if count > 2 else 0.0

    def solved(wanted: float) -> float:
        return float(
            brentq(lambda x: x + k * (2 * x * x + 1) / 6 + k * k * x**3 / 27 - wanted, -1e4, 1e4)
        )

    error = spread / math.sqrt(count)
    return mean - error * max(t, solved(t)), mean - error * min(-t, solved(-t))


def t_quantile(level: float, freedom: int) -> float:
    """Of Student's t, by integrating its density."""
    scale = math.exp(math.lgamma((freedom + 1) / 2) - math.lgamma(freedom / 2)) / math.sqrt(
        freedom * math.pi
    )

    def missing(x: float) -> float:
        below = quad(
            lambda u: scale * (1 + u * u / freedom) ** (-(freedom + 1) / 2), 0.0, x, epsabs=1e-13
        )
        return float(0.5 + below[0] - level)

    return float(brentq(missing, 0.0, 100.0, xtol=1e-12))


def held(finished: FinishedStatistics) -> list[Claim]:
    """How many movements of robots drawn for each pair lie in the predicted interval."""
    share = 100.0 * finished.findings.covered
    name = f"statistics: {finished.findings.driven} movements within the predicted 90 % interval"
    return [at_least(f"{name}, each pair with a robot of its own", share, "%", HELD)]


def never_slower(finished: FinishedStatistics) -> list[Claim]:
    """Law 4."""
    slower = finished.findings.slower
    return [
        at_most("statistics: slower with joints of their own laws, objective time", slower, "", 0.0)
    ]


def resampled(finished: FinishedStatistics) -> None:
    """How often the interval of the mean holds where pairs are drawn from the differences of a
    study.
    """
    rng = np.random.default_rng(5)
    for each in finished.findings.comparisons:
        if (
            each.name not in ("duration", "energy, direct")
            or each.pairs < 2
            or math.isnan(each.mean.low)
        ):
            continue
        row: dict[str, object] = {"held of 90 %": each.name}
        for count in COUNTS:
            drawn = rng.choice(each.values, (SAMPLES, count))
            t = t_quantile(0.95, count - 1)
            found = [ends(values, t) for values in drawn.tolist() if max(values) > min(values)]
            inside = [low <= each.mean.value <= high for low, high in found]
            row[f"{count} pairs"] = 100.0 * sum(inside) / SAMPLES
        print(line_of(row))


def simulated() -> None:
    """How often the interval of the mean holds that of a distribution, and Student's
    (bracketed).
    """
    rng = np.random.default_rng(1)
    drawn: dict[str, tuple[float, Callable[[tuple[int, int]], FloatArray]]] = {
        "normal": (0.0, lambda size: rng.normal(size=size)),
        "t of 3": (0.0, lambda size: rng.standard_t(3.0, size)),
        "exponential": (1.0, lambda size: rng.exponential(size=size)),
        "lognormal": (math.exp(0.5), lambda size: rng.lognormal(size=size)),
        "a third zeros": (
            2 / 3,
            lambda size: rng.exponential(size=size) * (rng.random(size) > 1 / 3),
        ),
        "three quarters zeros": (
            0.25,
            lambda size: rng.exponential(size=size) * (rng.random(size) < 0.25),
        ),
    }
    for name, (truth, draw) in drawn.items():
        row: dict[str, object] = {"held of 90 %": name}
        for count in SIZES:
            samples = [values for values in draw((SIMULATED, count)) if not alike(values)]
            found = [mean_of(values) for values in samples]
            t = t_quantile(0.95, count - 1)
            halves = [t * values.std(ddof=1) / math.sqrt(count) for values in samples]
            held = fmean(one.low <= truth <= one.high for one in found)
            student = fmean(
                abs(one.value - truth) <= half for one, half in zip(found, halves, strict=True)
            )
            row[f"of {count}"] = f"{100.0 * held:.1f} ({100.0 * student:.1f})"
        print(line_of(row), flush=True)
