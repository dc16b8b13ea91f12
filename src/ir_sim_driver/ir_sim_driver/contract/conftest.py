"""Markers of the contract's tests, where they run outside of the repository."""

from __future__ import annotations

import pytest


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marker of tests that run for minutes."""
    config.addinivalue_line("markers", "long: runs for minutes")
