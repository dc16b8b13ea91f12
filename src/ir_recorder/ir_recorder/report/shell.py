"""What pages have in common: their head with title, badges and the button for light and dark."""

from __future__ import annotations

from collections.abc import Sequence

from ir_recorder.report.money_text import with_elements
from ir_recorder.report.number_text import text
from ir_recorder.report.page import asset

_PLAIN = "themes(() => {}, () => {});\nexportButtons();\nfoldOnPhones(FIRST);"
SCRIPTS = ("charts.js", "export.js", "price.js")
"""Of a page without curves."""


def badge(words: str, kind: str) -> str:
    """A verdict beside the title. kind: good, bad or open."""
    return f'<p class="verdict {kind}">{text(words)}</p>'


def source_badge(words: str, kind: str, more: str = "") -> str:
    """What figures of a page are, beside its title. kind: simulated, measured or open."""
    return f'<p class="source {kind}"><b>{text(words)}</b> {text(more)}</p>'


SIMULATED = "Simulated, not measured"


def shell(
    title: str,
    subtitle: str,
    main: str,
    *,
    badges: Sequence[str] = (),
    style: str = "",
    script: str = "",
) -> str:
    """A page as text. main, badges: HTML; style: of this page alone; script: the page's own, which
    answers its button, else it has tables and drawings only.
    """
    own = script or "\n".join([*map(asset, SCRIPTS), _PLAIN])
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{text(title)}</title>\n<style>{asset('page.css')}\n{style}</style>\n</head>\n"
        f"<body>\n<header>\n<div><h1>{text(title)}</h1>"
        f'<p class="subtitle">{text(subtitle)}</p></div>\n'
        f'<div class="badges">{"".join(badges)}</div>\n'
        '<button id="theme" type="button" title="light or dark" aria-label="light or dark">\u25d0'
        f"</button>\n</header>\n<main>\n{with_elements(main)}\n</main>\n<script>{own}</script>\n</body>\n</html>\n"
    )
