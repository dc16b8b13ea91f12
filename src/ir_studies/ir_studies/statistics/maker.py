"""What makes the rows of pairs: both timings planned, then driven by the simulated robot and
measured.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ir_description import Cell, data_sheet_of
from ir_msgs_py.options import TIMINGS, PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Goal, MovementPlan, Planner, PlannerError
from ir_recorder.analysis.indirect import IndirectMeter
from ir_recorder.reading.recording import JointSeries
from ir_recorder.traces import Trace
from ir_sim_driver import DriverError, carried
from ir_studies.errors import DrivingError, StudyError
from ir_studies.simulated_run import READING, SimulatedRun
from ir_studies.statistics.places import Pair, pair_of, places_of, read_by
from ir_studies.statistics.settings import StatisticsSettings
from ir_studies.work import Row
from ir_studies.work.read_files import refuse_others

AROUND = 0.5  # s after a movement that the filter of the indirect measurement may look at


def maker(settings: Mapping[str, Any]) -> Callable[[Mapping[str, Any]], Row]:
    """Rows of pairs by their numbers, with the cell and its places loaded once; `read` of the
    settings: what must be the same here. WorkerError where it is not.
    """
    given = settings.get("read", {})
    asked = StatisticsSettings(**{key: value for key, value in settings.items() if key != "read"})
    refuse_others(given, read_by(asked) if given else {})
    planner = Planner(time.monotonic)
    planner.set_cell("", asked.cell)
    try:
        places = places_of(planner, asked.load)
        why = ""
    except (
        StudyError,
        PlannerError,
    ) as error:  # a row says so in words, a process that can't start does not
        places = ()
        why = str(error)

    def row_of(words: Mapping[str, Any]) -> Row:
        if why:
            return {"message": why}
        number = int(words["number"])
        pair = pair_of(places, asked.seed, number, asked.safety_distance)
        own = replace(asked, plant=asked.plant_of(number))
        row: Row = {"start": pair.names[0], "goal": pair.names[1]}
        return row | {timing: one_timing(pair, timing, own, planner) for timing in TIMINGS}

    return row_of


def one_timing(pair: Pair, timing: str, asked: StatisticsSettings, planner: Planner) -> Row:
    """Figures of the movement with one timing; `solved` false, with a sentence, where there is
    none.
    """
    options = PlanOptions(
        planner_id=asked.planner,
        seed=asked.seed,
        timing=timing,
        load=asked.load,
        objective=asked.objective,
        safety_distance=pair.margin,
        max_iterations=asked.max_iterations,
        planning_time=asked.hang_after,
    )
    try:
        plan = planner.plan_regional(pair.start, Goal(configuration=pair.goal), options)
    except PlannerError as error:
        return {"solved": False, "message": str(error)}
    if plan.trajectory is None or not plan.report.certified:
        return {"solved": False, "message": plan.status.message}
    return _planned(plan) | _driven(plan.trajectory, plan.report.load, asked.plant, planner.cell)


def _planned(plan: MovementPlan) -> Row:
    report = plan.report
    trajectory = plan.trajectory
    return {
        "solved": True,
        "message": "",
        "timing": plan.info.timing,
        "trajectory_id": trajectory.trajectory_id if trajectory else "",
        "duration_s": report.duration,
        "predicted_j": report.energy,
        "predicted_low_j": report.energy_low,
        "predicted_high_j": report.energy_high,
        "drives_j": report.energy - report.base_energy,
        "path_m": report.path_length,
        "movement_cost": report.movement_cost,
        "torque_share": float(report.torque_ratio.max(initial=0.0)),
    }


def _driven(trajectory: JointTrajectory, load: str, plant: str, cell: Cell) -> Row:
    """Joules by meter and by positions, peak power [W]; NaN, with a sentence, where it was not
    driven.

    Each movement has a robot of its own, whose gears are as warm as before the other.
    """
    try:
        run = SimulatedRun(cell, plant, load)
        try:
            run.place(np.array(trajectory.positions[0]))
            began, ended = run.drive(trajectory)
            run.advance(AROUND)
            return _measured(run, began, ended)
        finally:
            run.close()
    except (DriverError, DrivingError) as error:
        return {
            "direct_j": math.nan,
            "indirect_j": math.nan,
            "peak_w": math.nan,
            "message": str(error),
        }


def _measured(run: SimulatedRun, began: float, ended: float) -> Row:
    trace = run.trace()
    cell = run.cell
    energy = trace.columns["energy"]
    time_s = trace.time
    inside = (time_s >= began - 0.5 * READING) & (time_s <= ended + 0.5 * READING)
    direct = float(np.diff(np.interp([began, ended], time_s, energy))[0])
    indirect = _meter(trace, cell).energy(
        began, ended, carried(cell, run.simulation.load.text).loads
    )
    peak = float((np.diff(energy[inside]) / READING).max(initial=0.0))
    return {"direct_j": direct, "indirect_j": indirect, "peak_w": peak}


def _meter(trace: Trace, cell: Cell) -> IndirectMeter:
    """The indirect measurement of the report over the positions of a trace."""
    names = cell.robot.joint_names
    q = np.stack([trace.columns[name] for name in names], axis=1)
    unknown = np.full_like(q, math.nan)
    stamps = np.rint(1e9 * trace.time).astype(np.int64)
    joints = JointSeries(tuple(names), stamps, trace.time, q, unknown, unknown)
    data = cell.robot.controller
    parameters = data_sheet_of(cell.robot, data)
    return IndirectMeter(joints, cell.robot, cell.base_pose, data.dc_link, parameters)
