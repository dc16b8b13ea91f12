"""Checks as tables: for each kind the one that is nearest to its bound, then the checks
themselves.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from ir_recorder.analysis import Finding, Verdict
from ir_recorder.report.tables import table
from ir_recorder.report.words import interval, number, text

_KIND = re.compile(
    r"energy of .* from joint states$|energy of |duration of |.*? (?=on \d)|power at rest|Table "
    r"II|goals of"
)
_ORDER = (Verdict.HOLDS, Verdict.FAILS, Verdict.NOT_CHECKED)
_STYLES = {Verdict.HOLDS: "good", Verdict.FAILS: "bad", Verdict.NOT_CHECKED: "open"}
_NAMES = {
    "energy of": "energy against the plan",
    "duration of": "duration against the plan",
    "goals of": "goals",
}


def check_table(findings: Sequence[Finding]) -> str:
    """All checks: by kind, then what fails and what was not checked, and what holds folded away."""
    shown = [f for f in findings if not f.ok]
    held = [f for f in findings if f.ok]
    rows = [_check(f) for f in sorted(shown, key=lambda f: f.verdict is not Verdict.FAILS)]
    heads = ("", "check", ">found", ">allowed", ">expected", "reason of the bound", "note")
    top = table(heads, rows, "Checks that fail or were not made", "checks") if rows else ""
    top = _kinds(findings) + top
    if not held:
        return top or '<p class="empty">Nothing was checked.</p>'
    below = table(heads, [_check(f) for f in held], "Checks that hold", "checks")
    count = f"{len(held)} checks hold" if len(held) > 1 else "1 check holds"
    return f"{top}<details><summary>{count}</summary>{below}</details>"


def _check(finding: Finding) -> tuple[str, ...]:
    return (
        f'<b class="{_STYLES[finding.verdict]}">{finding.verdict}</b>',
        text(finding.name),
        text(number(finding.measured, finding.unit)),
        text(interval(finding.low, finding.high, finding.unit)),
        text(number(finding.expected, finding.unit)),
        text(finding.reason),
        text(finding.note),
    )


def _kinds(findings: Sequence[Finding]) -> str:
    """One row for each kind of check."""
    kinds: dict[str, list[Finding]] = {}
    for finding in findings:
        kinds.setdefault(_kind(finding), []).append(finding)
    if not kinds:
        return ""
    heads = (
        "kind",
        ">hold",
        ">fail",
        ">not checked",
        "nearest to its bound",
        ">found",
        ">allowed",
        "reason of the bound",
    )
    return table(
        heads, [_kind_row(kind, own) for kind, own in kinds.items()], "Checks by kind", "kinds"
    )


def _kind(finding: Finding) -> str:
    found = _KIND.match(finding.name)
    name = found[0].strip() if found else finding.name
    return (
        "energy from joint states" if name.endswith("from joint states") else _NAMES.get(name, name)
    )


def _kind_row(kind: str, own: Sequence[Finding]) -> tuple[str, ...]:
    count = {verdict: sum(f.verdict is verdict for f in own) for verdict in Verdict}
    made = [finding for finding in own if finding.verdict is not Verdict.NOT_CHECKED]
    row = (text(kind), *(_count(count[verdict], verdict) for verdict in _ORDER))
    if not made:
        return (*row, "", "", "", text(own[0].note))
    near = min(made, key=_room)
    allowed = interval(near.low, near.high, near.unit)
    return (
        *row,
        text(near.name),
        text(number(near.measured, near.unit)),
        text(allowed),
        text(near.reason),
    )


def _count(number: int, verdict: Verdict) -> str:
    return f'<b class="{_STYLES[verdict]}">{number}</b>' if number else "0"


def _room(finding: Finding) -> float:
    """How far within its bounds a check lies, as a share of them; negative where it fails."""
    to_bound = min(finding.high - finding.measured, finding.measured - finding.low)
    width = (finding.high - finding.low) / 2.0
    return (
        to_bound / (width if math.isfinite(width) else max(abs(finding.measured), 1e-9))
        if width
        else 0.0
    )
