"""The pages of studies: one shell, styled as the report, around what each kind of study has to
show.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib.resources import files

from ir_recorder.report.page import asset

BUTTON = (
    '<button id="theme" type="button" title="light or dark" aria-label="light or '
    'dark">\u25d0</button>'
)
"""For pages whose scripts answer it."""


def page(kind: str, parts: Mapping[str, str], button: str = "") -> str:
    """The page of a kind of study as text. parts: HTML by the names in its page.html, title and
    subtitle.
    """
    own = files("ir_studies") / kind
    shell = (files("ir_studies") / "page.html").read_text("utf-8")
    inner = {
        "style": asset("page.css"),
        "own_style": (own / "page.css").read_text("utf-8"),
        "main": _filled((own / "page.html").read_text("utf-8"), parts),
    }
    return _filled(shell, {"button": button, **parts, **inner})


def _filled(template: str, parts: Mapping[str, str]) -> str:
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], template)
