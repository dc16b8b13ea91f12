"""The few names of the planner that a comparison needs, wherever a checkout keeps them.

The public face of `ir_planner` first, then the modules of the layout without one.
"""

from __future__ import annotations

import importlib
import time
from pathlib import Path
from typing import Any

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


def planner_of(cell: str) -> Any:
    """A planner with a bundled cell or the cell of a file."""
    planner = name_of("Planner")(time.monotonic)
    planner.set_cell("", cell)
    return planner


def checkout() -> Path:
    """Root of the checkout whose planner is imported."""
    return Path(str(importlib.import_module("ir_planner").__file__)).resolve().parents[3]
