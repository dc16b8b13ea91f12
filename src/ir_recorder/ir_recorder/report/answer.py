"""The answer that stands above all figures of a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ir_recorder.report.number_text import text


@dataclass(frozen=True)
class Answer:
    """What a page says first: the result in a few large words and a sentence, how sure it is, what
    to do (in words, or several with the first first), and what a part and a night cost; "" and ()
    where there is nothing to say.
    """

    result: str
    words: str
    sure: str = ""
    do: str | Sequence[str] = ""
    costs: Sequence[str] = ()

    def html(self) -> str:
        """As the first section of a page."""
        parts = [f"<div><h2>Result</h2><b>{text(self.result)}</b><p>{text(self.words)}</p></div>"]
        for head, words in (("How sure", self.sure), ("What to do", self.do)):
            if words:
                parts.append(f"<div><h2>{head}</h2>{_said(words)}</div>")
        if self.costs:
            parts.append(f"<div><h2>What energy costs</h2>{''.join(map(_said, self.costs))}</div>")
        return f'<section id="answer">{"".join(parts)}</section>\n'


def _said(words: str | Sequence[str]) -> str:
    if isinstance(words, str):
        return f"<p>{text(words)}</p>"
    return f"<ol>{''.join(f'<li>{text(each)}</li>' for each in words)}</ol>"
