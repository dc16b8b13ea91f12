"""The reference page says what the interface files say."""

from __future__ import annotations

import importlib.util
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def test_the_page_is_written_from_the_files_as_they_are() -> None:
    spec = importlib.util.spec_from_file_location(
        "interface_reference", ROOT / "tools" / "interface_reference.py"
    )
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    assert (ROOT / "docs" / "interface_reference.md").read_text(encoding="utf-8") == tool.page(), (
        "run `make docs`"
    )
