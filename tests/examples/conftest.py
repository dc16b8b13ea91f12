"""Where the tests of pages find what reads a page."""

from __future__ import annotations

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.append(str(Path(__file__).parent))  # _pages.py


@pytest.fixture(autouse=True)
def no_plan_is_cut(monkeypatch: pytest.MonkeyPatch) -> None:
    """Offline commands plan as long as it takes: what their clock cuts on a busy machine is another
    plan.
    """
    monkeypatch.setattr("ir_cli.planning.time", SimpleNamespace(monotonic=lambda: 0.0))
