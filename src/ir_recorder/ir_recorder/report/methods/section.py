"""The section of the page: one figure for each search, with its sentence; equal ones are
counted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ir_description import Cell
from ir_msgs_py.search_log import ConfigurationLog, CorrectionLog, SearchLog, WithdrawalLog
from ir_recorder.analysis import Analysis
from ir_recorder.report.methods import configurations, correction, withdrawal
from ir_recorder.report.words import text

_MOST = 24  # figures
_KEY = (
    '<p class="hint">Black: the path that was found. Blue: what is driven, optimised from there. '
    "Dashed: the straight movement. Green: kept or accepted. Red: dropped, rejected or "
    "colliding. Grey: "
    "bodies of the machines, those that are not near the drawn plane as outlines. Paths are "
    "those of the "
    "tool centre point.</p>"
)


def methods_section(analysis: Analysis) -> str:
    """What the paper's methods did for the recorded program; "" where none was asked for."""
    logs = analysis.recording.searches
    cell = analysis.cell
    alike: dict[str, list[SearchLog]] = {}
    for log in logs:
        alike.setdefault(_sentence(log), []).append(log)
    figures = "".join(_figures(list(alike.items())[:_MOST], cell))
    if not figures:
        return ""
    if len(alike) > _MOST:
        figures += f'<p class="hint">{_MOST} of {len(alike)} are shown.</p>'
    head = "<h2>What the paper's methods did</h2>"
    return f'<section id="methods">{head}{_KEY}<div class="methods">{figures}</div></section>'


def _figures(alike: Sequence[tuple[str, Sequence[SearchLog]]], cell: Cell | None) -> Iterator[str]:
    for number, (sentence, logs) in enumerate(alike):
        drawn = _picture(logs[0], cell, number) if cell else ""
        words = f"{sentence} {_times(logs)}".rstrip()
        yield f"<figure>{drawn}<figcaption>{text(words)}</figcaption></figure>"


def _times(logs: Sequence[SearchLog]) -> str:
    """How often it was the same; "" for once."""
    if len(logs) == 1:
        return ""
    what = {WithdrawalLog: "visits", ConfigurationLog: "programs", CorrectionLog: "movements"}
    return f"This holds for {len(logs)} {what[type(logs[0])]}."


def _sentence(log: SearchLog) -> str:
    if isinstance(log, WithdrawalLog):
        return withdrawal.sentence(log)
    return (
        configurations.sentence(log)
        if isinstance(log, ConfigurationLog)
        else correction.sentence(log)
    )


def _picture(log: SearchLog, cell: Cell, number: int) -> str:
    if isinstance(log, WithdrawalLog):
        return withdrawal.picture(log, cell, number)
    if isinstance(log, ConfigurationLog):
        return configurations.picture(log, cell, number)
    return correction.picture(log, cell, number)
