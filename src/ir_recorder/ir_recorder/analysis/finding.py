"""One check of a recording: what was measured, the interval in which it has to lie, and why
there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

NAN = float("nan")
INF = float("inf")


class Verdict(StrEnum):
    """What came of a check; nothing to compare is `not checked`, never `holds`."""

    HOLDS = "holds"
    FAILS = "fails"
    NOT_CHECKED = "not checked"


@dataclass(frozen=True)
class Finding:
    """A check of the cell or of the run.

    measured, low and high have the same unit; low or high is infinite for a one-sided bound.
    expected: the planned or listed value, NaN where there is only a bound. reason: why the bound is
    where it is. note: what else the reader may want to know.
    """

    name: str
    measured: float
    low: float
    high: float
    unit: str
    reason: str
    expected: float = NAN
    note: str = ""
    applies: bool = True

    @property
    def verdict(self) -> Verdict:
        """Whether the measured value lies within its bounds; a value that is missing was not
        checked.
        """
        if (
            not self.applies
            or math.isnan(self.measured)
            or math.isnan(self.low)
            or math.isnan(self.high)
        ):
            return Verdict.NOT_CHECKED
        return Verdict.HOLDS if self.low <= self.measured <= self.high else Verdict.FAILS

    @property
    def ok(self) -> bool:
        """Whether it was checked and holds."""
        return self.verdict is Verdict.HOLDS


def near(
    name: str,
    measured: float,
    expected: float,
    bound: float,
    unit: str,
    reason: str,
    note: str = "",
) -> Finding:
    """The measured value within `bound` of the expected one."""
    return Finding(name, measured, expected - bound, expected + bound, unit, reason, expected, note)


def at_most(
    name: str, measured: float, bound: float, unit: str, reason: str, note: str = ""
) -> Finding:
    """The measured value not above the bound."""
    return Finding(name, measured, -INF, bound, unit, reason, NAN, note)


def at_least(
    name: str, measured: float, bound: float, unit: str, reason: str, note: str = ""
) -> Finding:
    """The measured value not below the bound."""
    return Finding(name, measured, bound, INF, unit, reason, NAN, note)


def unchecked(name: str, why: str) -> Finding:
    """A check that this recording doesn't allow."""
    return Finding(name, NAN, NAN, NAN, "", "", NAN, why, applies=False)


def summary(findings: tuple[Finding, ...]) -> tuple[Verdict, str]:
    """The verdict over all checks with a sentence: it holds only where every check was made and
    holds.
    """
    failed = sum(check.verdict is Verdict.FAILS for check in findings)
    missing = sum(check.verdict is Verdict.NOT_CHECKED for check in findings)
    held = len(findings) - failed - missing
    if failed:
        return (
            Verdict.FAILS,
            f"{failed} of {len(findings)} checks {'fails' if failed == 1 else 'fail'}",
        )
    if not held:
        return Verdict.NOT_CHECKED, "nothing was checked"
    if missing:
        verb = "holds" if held == 1 else "hold"
        return (
            Verdict.NOT_CHECKED,
            f"{held} of {len(findings)} checks {verb}, {missing} not checked",
        )
    return Verdict.HOLDS, f"all {held} checks hold"
