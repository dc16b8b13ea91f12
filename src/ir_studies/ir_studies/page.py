"""The pages of studies: one shell, styled as the report, around what each kind of study has to
show.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

from ir_recorder.report.answer import Answer
from ir_recorder.report.number_text import text
from ir_recorder.report.shell import badge, shell
from ir_recorder.report.tables import table


@dataclass(frozen=True)
class Head:
    """The head of a study's page. answer: None where nothing was found; verdict: beside the title,
    "" without one; good: whether it is green; source: what its figures are, as a badge (HTML).
    """

    title: str
    subtitle: str
    answer: Answer | None = None
    verdict: str = ""
    good: bool = False
    source: str = ""


def page(kind: str, head: Head, parts: Mapping[str, str], script: str = "") -> str:
    """The page of a kind of study as text. parts: HTML by the names in its page.html; a script of
    its own answers the button for light and dark.
    """
    own = files("ir_studies") / kind
    first = head.answer.html() if head.answer is not None else ""
    main = _filled((own / "page.html").read_text("utf-8"), parts)
    verdict = badge(head.verdict, "good" if head.good else "open")
    return shell(
        head.title,
        head.subtitle,
        first + main,
        badges=[head.source, verdict] if head.verdict else [head.source],
        style=(own / "page.css").read_text("utf-8"),
        script=script,
    )


def settings_table(settings: Mapping[str, Any]) -> str:
    """The settings of a study by their names in its file; those that are left empty are left
    out.
    """
    rows = [
        (f"<code>{text(name).replace('_', '_<wbr>')}</code>", text(_words(value)))
        for name, value in settings.items()
        if value not in ("", (), [], {})
    ]
    return table(("setting", ">value"), rows, "Settings")


def _words(value: Any) -> str:
    """A value, a list or names with their values, as people read them."""
    if isinstance(value, Mapping):
        return "; ".join(f"{name}: {_words(one)}" for name, one in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_words, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


def _filled(template: str, parts: Mapping[str, str]) -> str:
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], template)
