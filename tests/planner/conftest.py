"""Cells, scenes and budgets that the planner's tests share; scenes never change: one per session
will do.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_description import Cell, PowerData, load_cell, load_power_data
from ir_msgs_py.options import PlanOptions
from ir_planner.planner import Planner
from ir_planner.request.context import Work
from ir_planner.request.goals import Goal
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with

sys.path.insert(0, str(Path(__file__).parent))  # asking.py


@pytest.fixture(scope="session")
def power() -> PowerData:
    return load_power_data()


@pytest.fixture(scope="session")
def demo_cell() -> Cell:
    return load_cell("demo")


@pytest.fixture(scope="session")
def demo_scene(demo_cell: Cell, power: PowerData) -> PlanningScene:
    """The demonstration cell with the gripper (155 kg)."""
    return scene_with(demo_cell, load_text(demo_cell), power)


@pytest.fixture(scope="session")
def scene_of(power: PowerData) -> Callable[[str], PlanningScene]:
    """Scene of a bundled cell with its tool."""

    def build(name: str) -> PlanningScene:
        cell = load_cell(name)
        return scene_with(cell, load_text(cell), power)

    return build


@pytest.fixture
def budget() -> Work:
    return Work(60_000, 1.0, lambda: 0.0)


@pytest.fixture
def planner(demo_cell: Cell, power: PowerData) -> Planner:
    return Planner(
        "demo", clock=lambda: 0.0, power=power
    )  # a clock that cuts no plan of a busy machine


@pytest.fixture(scope="session")
def options() -> PlanOptions:
    return PlanOptions(planning_time=60.0)


@pytest.fixture(scope="session")
def degrees() -> Callable[..., Any]:
    """Joint values in rad from degrees."""
    return lambda *angles: np.radians(np.array(angles, dtype=float))


@pytest.fixture(scope="session")
def to_configuration() -> Callable[..., Goal]:
    return lambda q: Goal(configuration=np.asarray(q))
