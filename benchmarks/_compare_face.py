"""The few names of the planner that a comparison needs, wherever a checkout keeps them.

The public face of `ir_planner` first, then the modules of the layout without one.
"""

from __future__ import annotations

import importlib
import inspect
import time
from pathlib import Path
from typing import Any

from ir_msgs_py.options import PlanOptions

_MODULES = {
    "Planner": ("ir_planner", "ir_planner.planner"),
    "Goal": ("ir_planner", "ir_planner.goals"),
    "parse_goal": ("ir_planner", "ir_planner.goals"),
    "Reference": ("ir_planner", "ir_planner.following"),
    "RequestError": ("ir_planner", "ir_planner.errors"),
}


def name_of(name: str) -> Any:
    """The class or function `name` of this checkout's planner. Raises ImportError listing where it
    is not.
    """
    for module in _MODULES[name]:
        try:
            found = getattr(importlib.import_module(module), name, None)
        except ModuleNotFoundError as error:
            if error.name is None or not module.startswith(error.name):
                raise
            continue
        if found is not None:
            return found
    raise ImportError(f"no {name} in {', '.join(_MODULES[name])}")


_POSITIONS: dict[str, dict[str, Any]] = {
    "check_state": {"safety_distance": 0.02, "max_pairs": 5, "load": "", "station": ""},
    "compute_ik": {"method": "analytic", "safety_distance": 0.02, "near": None, "load": ""},
    "evaluate": {"safety_distance": 0.02, "load": "", "station": ""},
    "standby": {"q": None, "load": ""},
    "plan_regional": {"start": None, "goal": None, "options": PlanOptions()},
    "plan_service": {
        "direction": "exit",
        "configuration": None,
        "near": None,
        "max_candidates": 3,
        "options": PlanOptions(),
    },
    "plan_trajectory": {"options": PlanOptions()},
    "plan_cartesian": {"options": PlanOptions()},
    "optimize_trajectory": {"options": PlanOptions()},
    "plan_program": {"stations": (), "cycle_time": 0.0, "options": PlanOptions(), "start": None},
}


class _PositionalPlanner:
    """A planner of a checkout before the keywords, called by keywords."""

    def __init__(self, planner: Any) -> None:
        self._planner = planner

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._planner, name)
        order = _POSITIONS.get(name)
        if order is None:
            return method

        def called(*first: Any, **named: Any) -> Any:
            arguments = [named.pop(key, default) for key, default in order.items()]
            return method(*first, *arguments, **named)

        return called


def planner_of(cell: str) -> Any:
    """A planner with a bundled cell or the cell of a file."""
    make = name_of("Planner")
    if "cell" in inspect.signature(make).parameters:
        return make(cell)
    planner = make(time.monotonic)
    planner.set_cell("", cell)
    return _PositionalPlanner(planner)


def checkout() -> Path:
    """Root of the checkout whose planner is imported."""
    return Path(str(importlib.import_module("ir_planner").__file__)).resolve().parents[3]
