"""Programs as texts, followed and driven in a bundled cell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from ir_krl import Followed, follow, parse
from ir_planner import Planner
from ir_planner.krl import tool_in_flange


@pytest.fixture(scope="session")
def planner() -> Planner:
    return Planner("open", clock=lambda: 0.0)  # a clock that cuts no plan of a busy machine


@pytest.fixture
def followed(planner: Planner) -> Callable[..., Followed]:
    """Follows the lines of a routine, with the lines of a data list."""

    def run(lines: str, data: str = "", **choices: object) -> Followed:
        texts = [parse(f"DEF TEST( )\n{lines}\nEND\n", "test.src")]
        if data:
            texts.append(parse(f"DEFDAT TEST\n{data}\nENDDAT\n", "test.dat"))
        cell = planner.cell
        return follow(texts, cell.machine_home, tool_in_flange(cell.tcp), **choices)  # type: ignore[arg-type]

    return run


@pytest.fixture
def home(planner: Planner) -> np.ndarray:
    return planner.cell.machine_home


@pytest.fixture(autouse=True)
def few_statements(monkeypatch: pytest.MonkeyPatch) -> None:
    """A loop that never ends is named sooner."""
    monkeypatch.setattr("ir_krl.run.control_flow.STATEMENTS_MAX", 5_000)
