"""What makes the jobs of a layout study: a look at a placement, and its program planned in full.

A look says what is impossible and why, and what coarse movements would cost that meet nothing. Both
are pure
functions of the job: they give the same bytes in every process.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ir_description import Cell, DescriptionError, cell_from_yaml
from ir_msgs_py.errors import MsgsError
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import Status, StatusCode
from ir_planner import PlannerError, PlannerSettings, ProgramPlan, RequestError
from ir_planner.program import ProgramRequest, Spreads, outlook, plan_program, with_intervals
from ir_planner.request import Work
from ir_studies.layout.freedom import Placing
from ir_studies.layout.overlap import deeper, overlaps
from ir_studies.work import Row

NEVER = 1e9  # s: work ends a plan, not the clock
_KINDS = {
    StatusCode.NO_IK_SOLUTION: "out of reach",
    StatusCode.GOAL_IN_COLLISION: "collision",
    StatusCode.START_STATE_IN_COLLISION: "collision",
    StatusCode.START_STATE_INVALID: "beyond limits",
    StatusCode.INVALID_GOAL_CONSTRAINTS: "too slow",
}


def maker(settings: Mapping[str, Any]) -> Callable[[Mapping[str, Any]], Row]:
    """What makes the row of a job. settings: cell_yaml and what LayoutSettings.budget holds."""
    return Maker(settings).row


class Maker:
    """Knows the given cell, and which of its bodies overlap already."""

    def __init__(self, settings: Mapping[str, Any]) -> None:
        self._given = cell_from_yaml(settings["cell_yaml"])
        self._budget = settings
        self._placing = Placing(tuple(settings["carried"]))
        self._overlapping = overlaps(self._given)

    def row(self, words: Mapping[str, Any]) -> Row:
        """The row of a job: stage (look or plan), values, payloads or payload, cycle_time, seed."""
        try:
            if words["stage"] == "look":
                return self._look(words["values"], words["payloads"])
            return self._plan(words)
        except RequestError as error:
            return refused(error.status)
        except (PlannerError, MsgsError, DescriptionError) as error:
            return {"solved": False, "kind": "beyond limits", "message": str(error)}

    def _look(self, values: Mapping[str, float], payloads: list[Mapping[str, float]]) -> Row:
        """The cost of coarse movements for every payload, or the first reason against."""
        costs = []
        for payload in payloads:
            cell = self._placing.cell(self._given, values, payload)
            new = sorted(deeper(overlaps(cell), self._overlapping).items())
            if new:
                pairs = [
                    f"{one} and {other} by {1e3 * depth:.1f} mm" for (one, other), depth in new[:3]
                ]
                said = f"machines overlap more than as given: {', '.join(pairs)}"
                return {"solved": False, "kind": "overlap", "message": said}
            request = self._request(cell, PlanOptions())
            found = outlook(request, work_of(request))
            if not found.status.ok:
                return refused(found.status)
            if not math.isfinite(found.cost):
                return {
                    "solved": False,
                    "kind": "no path",
                    "message": "no chain connects the stations",
                }
            costs.append(found.cost)
        return {"solved": True, "coarse": costs}

    def _plan(self, words: Mapping[str, Any]) -> Row:
        cell = self._placing.cell(self._given, words["values"], words["payload"])
        cycle = float(words["cycle_time"])
        objective = "energy" if cycle > 0.0 else "time_and_energy"
        request = self._request(cell, PlanOptions(objective=objective, seed=words["seed"]), cycle)
        plan = plan_program(request, work_of(request))
        if not plan.status.ok:
            return refused(plan.status)
        spreads = Spreads(request)
        row = figures(with_intervals(plan, spreads), self._budget["time_value"], cycle)
        if words.get("robots"):
            row["robots"] = [
                round(float(one), 3) for one in np.sum(spreads.of(plan.movements), axis=0)
            ]
        return row

    def _request(self, cell: Cell, options: PlanOptions, cycle_time: float = 0.0) -> ProgramRequest:
        budget = self._budget
        settings = PlannerSettings()
        options = replace(
            options,
            planning_time=NEVER,
            max_iterations=budget["max_iterations"],
            safety_distance=budget["safety_distance"],
            time_value=budget["time_value"],
        )
        power = settings.drives.power(cell.robot.controller)
        stations = tuple(budget["stations"])
        return ProgramRequest(cell, power, stations, cell.park, options, cycle_time, settings)


def work_of(request: ProgramRequest) -> Work:
    """As much as the planner gives a program of so many stops, in one thread: processes share the
    cores.
    """
    stops = max(len(request.stations or request.cell.program), 1)
    settings = request.settings
    most = (request.options.max_iterations or settings.max_iterations) * stops
    better = request.options.max_iterations or settings.improvement_iterations
    return Work(most, time.monotonic() + NEVER, time.monotonic, improvement=better, threads=1)


def refused(status: Status) -> Row:
    """The row of a placement that is impossible."""
    kind = _KINDS.get(StatusCode(status.code), "no path")
    return {"solved": False, "kind": kind, "message": status.message}


def figures(plan: ProgramPlan, time_value: float, cycle_time: float) -> Row:
    """What a certified program costs: J of its movements, within a cycle time its joules at the
    mains.
    """
    report = plan.report
    moves = [step.report for step in plan.movements if not step.is_pause]
    seconds = sum(move.duration for move in moves)
    drives = sum(move.energy - move.base_energy for move in moves)
    return {
        "solved": report.certified,
        "cost_j": report.energy if cycle_time > 0.0 else drives + time_value * seconds,
        "energy_j": report.energy,
        "energy_low_j": report.energy_low,
        "energy_high_j": report.energy_high,
        "duration_s": report.duration,
        "moving_j": sum(move.energy for move in moves),
        "moving_s": seconds,
        "drives_j": drives,
        "clearance_m": report.min_clearance,
        "certified": report.certified,
        "program_id": plan.program_id,
    }
