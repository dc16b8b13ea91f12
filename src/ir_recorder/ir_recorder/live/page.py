"""The page of the live view: the report's styles, charts and 3D view, and what feeds them."""

from __future__ import annotations

import re
import secrets
from functools import cache

from ir_recorder.report.page import asset

SCRIPTS = (
    "charts.js",
    "renderer.js",
    "motion.js",
    "export.js",
    "live_motion.js",
    "live_panel.js",
    "live.js",
)
NONCE = secrets.token_urlsafe(18)
"""Of this process: only the page's own script and style run."""


@cache
def live_page() -> str:
    """The page as text; it holds nothing of the cell."""
    parts = {
        "nonce": NONCE,
        "style": asset("page.css") + asset("live.css"),
        "script": "\n".join(asset(script) for script in SCRIPTS),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], asset("live.html"))
