"""The answer that stands above all figures of a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ir_recorder.report.number_text import text

Said = str | Sequence[str]


@dataclass(frozen=True)
class Answer:
    """What a page says first: the result in a few large words and a sentence, its 90 % interval in
    words, how sure it is, what to do (in words, or several with the first first), and what a part
    and a night cost; "" and () where there is nothing to say. reached: what was saved already, of
    which `do` is not; counted: what the amounts rest on (HTML); bills: what a
    year costs, by the names of the programs, today's first.
    """

    result: str
    words: str
    sure: Said = ""
    do: Said = ""
    costs: Sequence[str] = ()
    between: str = ""
    reached: Sequence[str] = ()
    counted: str = ""
    bills: Sequence[tuple[str, str]] = ()

    def html(self) -> str:
        """As the first section of a page."""
        between = f'<p class="between">{text(self.between)}</p>' if self.between else ""
        words = f"<p>{text(self.words)}</p>" if self.words else ""
        parts = [
            f'<div class="result"><h2>Result</h2><b>{text(self.result)}</b>{between}'
            f"{self._bills()}{words}</div>"
        ]
        left = "Still to save" if self.reached else "What to do"
        todo = ""
        for head, said in (("Reached: keep driving it", self.reached), (left, self.do)):
            if said:
                todo += f"<h2>{head}</h2>{_said(said, 'ol')}"
        if todo:
            parts.append(f'<div class="do">{todo}</div>')
        if self.costs:
            costs = _said(self.costs, "ul")
            parts.append(f'<div class="costs"><h2>What energy costs</h2>{costs}</div>')
        if self.sure:
            parts.append(f'<div class="sure"><h2>How sure</h2>{_said(self.sure, "ul")}</div>')
        if self.counted:
            parts.append(f'<p class="counted">{self.counted}</p>')
        return f'<section id="answer">{"".join(parts)}</section>\n'

    def _bills(self) -> str:
        """The bills of a year beside each other; "" without one."""
        if not self.bills:
            return ""
        each = "".join(
            f"<div><dt>{text(name)}</dt><dd>{_amount_of(price)}</dd></div>"
            for name, price in self.bills
        )
        return f'<dl class="bills">{each}</dl>'


def _amount_of(price: str) -> str:
    """An amount, and of what it is in small letters: "558 EUR", "a year"."""
    amount, apart, of = price.partition(" a ")
    return f"{text(amount)} <small>a {text(of)}</small>" if apart else text(price)


def _said(words: Said, kind: str) -> str:
    if isinstance(words, str):
        return f"<p>{text(words)}</p>"
    return f"<{kind}>{''.join(f'<li>{text(each)}</li>' for each in words)}</{kind}>"
