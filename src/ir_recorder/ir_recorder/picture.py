"""A picture of power and motion, for people who don't open a page. matplotlib is asked for only here."""

from __future__ import annotations

from pathlib import Path

from ir_recorder.analysis import Analysis
from ir_recorder.errors import RecorderError


def write_picture(analysis: Analysis, path: str | Path) -> Path:
    raise RecorderError("not yet")
