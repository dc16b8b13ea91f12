"""The section of the page: one figure for each log, with its sentence."""

from __future__ import annotations

from collections.abc import Iterator

from ir_description import Cell
from ir_msgs_py.search_log import ConfigurationLog, CorrectionLog, SearchLog, WithdrawalLog
from ir_recorder.analysis import Analysis
from ir_recorder.report.methods import configurations, correction, withdrawal
from ir_recorder.report.words import text

_MOST = 24  # figures
_KEY = (
    '<p class="hint">Black: the path that was found. Blue: what is driven, optimised from there. '
    "Dashed: the straight movement. Green: kept or accepted. Red: dropped, rejected or colliding. Grey: "
    "bodies of the machines, those that are not near the drawn plane as outlines. Paths are those of the "
    "tool centre point.</p>"
)


def methods_section(analysis: Analysis) -> str:
    """What the paper's methods did for the recorded program; "" where none was asked for."""
    logs, cell = analysis.recording.searches, analysis.cell
    figures = "".join(_figures(logs[:_MOST], cell))
    if not figures:
        return ""
    if len(logs) > _MOST:
        figures += f'<p class="hint">{_MOST} of {len(logs)} are shown.</p>'
    head = "<h2>What the paper's methods did</h2>"
    return f'<section id="methods">{head}{_KEY}<div class="methods">{figures}</div></section>'


def _figures(logs: tuple[SearchLog, ...], cell: Cell | None) -> Iterator[str]:
    for number, log in enumerate(logs):
        words, drawn = _shown(log, cell, number)
        yield f"<figure>{drawn}<figcaption>{text(words)}</figcaption></figure>"


def _shown(log: SearchLog, cell: Cell | None, number: int) -> tuple[str, str]:
    """Sentence and drawing of a log; no drawing without the cell."""
    if isinstance(log, WithdrawalLog):
        return withdrawal.sentence(log), withdrawal.picture(log, cell, number) if cell else ""
    if isinstance(log, ConfigurationLog):
        return configurations.sentence(log), configurations.picture(log, cell, number) if cell else ""
    assert isinstance(log, CorrectionLog)
    return correction.sentence(log), correction.picture(log, cell, number) if cell else ""
