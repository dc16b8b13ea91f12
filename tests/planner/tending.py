"""How tests ask for a steady cycle: the movements between the stations of a route are planned once
for all lines that differ only in how long their machines work and how many parts they hold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any
from unittest.mock import patch

from ir_description import Cell, cell_hash
from ir_description.cell import PartRoute
from ir_planner import Planner, SteadyPlan
from ir_planner.flexible import columns, steady_plan
from ir_planner.flexible.columns import TendedRoute
from ir_planner.program import ProgramRequest
from ir_planner.request import Context

LITTLE = 16_000  # max_iterations: movements a little dearer than the cheapest, laws all the same

_known: dict[str, TendedRoute] = {}


def columns_once(request: ProgramRequest, route: PartRoute, context: Context) -> TendedRoute:
    alike = tuple(
        replace(
            machine,
            process=1.0 if machine.process else 0.0,
            process_times=None,
            capacity=1,
            buffer=0,
        )
        for machine in request.cell.equipment
    )
    cell = replace(request.cell, equipment=alike, route=route)
    key = f"{cell_hash(cell)} {route} {request.start.tolist()} {request.options}"
    if key not in _known:
        _known[key] = columns.planned_columns(request, route, context)
    return replace(_known[key], cell=request.cell)


def steady(
    cell: Cell, *, work: int = LITTLE, clock: Callable[[], float] = lambda: 0.0, **asked: Any
) -> SteadyPlan:
    """The cheapest cycle of a cell; work: max_iterations of each movement, 0: all it takes."""
    planner = Planner(cell, clock=clock)
    with patch.object(steady_plan, "planned_columns", columns_once):
        return planner.plan_steady_cycle(max_iterations=work, **asked)
