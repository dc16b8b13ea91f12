"""The pages of studies: one shell, styled as the report, around what each kind of study has to
show.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

from ir_recorder.report.number_text import text
from ir_recorder.report.page import asset
from ir_recorder.report.tables import table

_BUTTON = (
    '<button id="theme" type="button" title="light or dark" aria-label="light or '
    'dark">\u25d0</button>'
)


def page(kind: str, parts: Mapping[str, str]) -> str:
    """The page of a kind of study as text. parts: HTML by the names in its page.html, title and
    subtitle; where they have a script, it answers the button for light and dark.
    """
    own = files("ir_studies") / kind
    shell = (files("ir_studies") / "page.html").read_text("utf-8")
    scripts = f"{asset('charts.js')}\n{asset('export.js')}"
    plain = f"<script>{scripts}\nthemes(() => {{}}, () => {{}});\nexportButtons();</script>\n"
    inner = {
        "button": _BUTTON,
        "export": "" if "script" in parts else plain,
        "style": asset("page.css"),
        "own_style": (own / "page.css").read_text("utf-8"),
        "badge": "",
        "lead": "",
        "main": _filled((own / "page.html").read_text("utf-8"), parts),
    }
    return _filled(shell, {**inner, **parts})


def badge(words: str, *, good: bool) -> str:
    """The verdict of a study beside its title: green, or open."""
    style = "good" if good else "open"
    return f'<div class="badges"><p class="verdict {style}">{text(words)}</p></div>'


def lead(words: str) -> str:
    """What a study found, in plain words above all figures."""
    return f'<section id="lead"><p>{text(words)}</p></section>\n'


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
