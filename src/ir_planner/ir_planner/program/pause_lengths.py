"""Lengths of a pause: known, equally likely samples, or quantiles; checked once."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError
from ir_values.arrays import FloatArray

PAUSE_MAX = 604_800.0  # s: a week
SAMPLES_MAX = 10_000  # planned in 40 ms of processor time
# equally likely lengths that quantiles are taken as: the mean of a law with jumps to 0.1 %
_BETWEEN = 1000
_NONE: FloatArray = np.zeros(0)


@dataclass(frozen=True, eq=False)
class PauseLengths:
    """likely (n,) [s]: equally likely lengths, sorted. most [s]: no pause is longer. known: there
    is one only.
    """

    likely: FloatArray
    most: float
    known: bool = False

    def less(self, seconds: float) -> "PauseLengths":
        """What is left of each pause when `seconds` are taken from it; nothing is left of shorter
        ones.
        """
        return PauseLengths(
            np.maximum(self.likely - seconds, 0.0), max(self.most - seconds, 0.0), self.known
        )

    def extreme(self, switches: tuple[float, ...]) -> FloatArray:
        """Lengths at which a policy with these switch times [s] may cost most: all that are likely,
        the longest, and where lengths between the likely ones are possible, those just longer than
        a switch.
        """
        if self.most == self.likely[-1]:
            return self.likely
        just = np.nextafter(np.array(switches), np.inf)
        between = just[(just > self.likely[0]) & (just < self.most)]
        return np.concatenate((self.likely, [self.most], between))


def lengths_of(
    pause: float, samples: FloatArray = _NONE, quantiles: FloatArray = _NONE
) -> PauseLengths:
    """Lengths of a request that gives one of the three: pause [s], samples (n,) or quantiles (n,)
    [s]. Raises RequestError for what is no pause.
    """
    given = {"pause_samples": samples, "pause_quantiles": quantiles}
    lists = [name for name, values in given.items() if len(values)]
    if len(lists) + (pause != 0.0) > 1:
        counts = [f"{name} ({len(given[name])} values)" for name in lists]
        named = " and ".join([*([f"pause ({pause:g} s)"] if pause != 0.0 else []), *counts])
        raise _refused(
            f"{named} are given: exactly one of pause, pause_samples and pause_quantiles must be"
        )
    if not lists:
        _check(pause, "pause")
        return PauseLengths(np.array([pause]), pause, known=True)
    (name,) = lists
    values = given[name]
    if len(values) > SAMPLES_MAX:
        raise _refused(f"{name} has {len(values)} values: at most {SAMPLES_MAX} are taken")
    for k, value in enumerate(values):
        _check(float(value), f"{name}[{k}]")
    if name == "pause_samples":
        return PauseLengths(np.sort(values), float(values.max()))
    return _lengths_between(values)


def _lengths_between(quantiles: FloatArray) -> PauseLengths:
    """Equally likely lengths between neighbouring quantiles."""
    if len(quantiles) < 2:
        raise _refused(
            "pause_quantiles has 1 value: at least 2 are needed, those of the levels 0 and 1"
        )
    for k, (a, b) in enumerate(pairwise(quantiles)):
        if b < a:
            raise _refused(
                f"pause_quantiles[{k + 1}] is {b:g} s: it must be at least the one before, {a:g} s"
            )
    parts = max(1, -(-_BETWEEN // (len(quantiles) - 1)))
    share = (np.arange(parts) + 0.5) / parts
    likely = quantiles[:-1, None] + share * np.diff(quantiles)[:, None]
    return PauseLengths(likely.ravel(), float(quantiles[-1]))


def _check(seconds: float, name: str) -> None:
    if not (np.isfinite(seconds) and 0.0 < seconds <= PAUSE_MAX):
        raise _refused(f"{name} is {seconds:g} s: it must be in (0, {PAUSE_MAX:g}] s")


def _refused(sentence: str) -> RequestError:
    return RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, sentence)
