"""The statistics from their settings to their files; interrupted, they go on where they ended."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ir_description import Cell, cell_hash, data_sheet_of, load_cell
from ir_msgs_py.options import TIMINGS, PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Goal, MovementPlan, Planner, PlannerError
from ir_recorder.analysis.indirect import IndirectMeter
from ir_recorder.reading.recording import JointSeries
from ir_recorder.traces import Trace
from ir_sim_driver import DriverError
from ir_sim_driver.plant import carried, plant_hash, plant_named
from ir_studies.errors import StudyError
from ir_studies.simulated_run import READING, SimulatedRun
from ir_studies.statistics.findings import Findings, findings_of, solved
from ir_studies.statistics.outputs import summary_of, summed_up, write_outputs
from ir_studies.statistics.settings import StatisticsSettings
from ir_studies.work import Job, Means, Results, Row, StudyJob
from ir_studies.work.results import PLANT, digest_of_tasks, refuse_others
from ir_values.arrays import FloatArray

# Places: ends of the withdrawals from the stations, ends of the tasks, and home.

NEAREST = 0.002  # m that a place keeps
CANDIDATES = 8  # withdrawals of a station, in different configurations
LONGEST = 600.0  # s: work ends a request, not the clock
# of the clearance at the ends of a movement, where that is less than the safety distance
SHARE_OF_ENDS = 0.8


@dataclass(frozen=True, eq=False)
class NamedPlace:
    """A named place, its configurations (K, n) and what each keeps (K,) [m] to the nearest body."""

    name: str
    q: FloatArray
    clearance: FloatArray


@dataclass(frozen=True, eq=False)
class EndPair:
    """From start to goal (n,), with their names; margin [m]: the safety distance that both ends
    allow.
    """

    names: tuple[str, str]
    start: FloatArray
    goal: FloatArray
    margin: float


def places_of(planner: Planner, load: str) -> tuple[NamedPlace, ...]:
    """All places that keep NEAREST. StudyError where there are fewer than two."""
    cell = planner.cell
    named = {"home": np.array(cell.machine_home)[None]}
    for task in cell.tasks:
        first, _, last = task.name.partition("->")
        named |= {
            first: np.array(task.start)[None],
            last or f"{first} goal": np.array(task.goal)[None],
        }
    options = PlanOptions(load=load, planning_time=LONGEST)
    for station in cell.stations:
        found = planner.plan_service(
            station.name, near=cell.machine_home, max_candidates=CANDIDATES, options=options
        )
        outside = [candidate.outside for candidate in found.candidates]
        named[station.name] = np.array(outside).reshape(-1, cell.robot.n)
    places = [_free(planner, name, q, load) for name, q in named.items()]
    kept = tuple(place for place in places if len(place.q))
    if len(kept) < 2:
        raise StudyError(f"the cell {cell.name} has no two places that keep {NEAREST * 1e3:g} mm")
    return kept


def read_by(settings: StatisticsSettings) -> dict[str, str]:
    """Digests of the cell, its tasks and the plant."""
    cell = load_cell(settings.cell)
    plant = plant_named(settings.plant_of(0), cell.robot, cell.robot.controller)
    tasks = digest_of_tasks(settings.cell, cell)
    return {settings.cell: cell_hash(cell), f"{PLANT}{settings.plant}": plant_hash(plant), **tasks}


def _free(planner: Planner, name: str, q: FloatArray, load: str) -> NamedPlace:
    scene = planner.scene(load)
    clearance = scene.collision.min_distance(q).distance if len(q) else np.zeros(0)
    kept = clearance >= NEAREST
    return NamedPlace(name, q[kept], clearance[kept])


def pair_of(
    places: tuple[NamedPlace, ...], seed: int, number: int, safety_distance: float
) -> EndPair:
    """Pair `number` of a seed: two different places, each in a configuration drawn for it."""
    rng = np.random.default_rng([seed, number])
    first, last = (places[k] for k in rng.choice(len(places), 2, replace=False))
    i = int(rng.integers(len(first.q)))
    j = int(rng.integers(len(last.q)))
    least = float(min(first.clearance[i], last.clearance[j]))
    margin = min(safety_distance, SHARE_OF_ENDS * least)
    return EndPair((first.name, last.name), first.q[i], last.q[j], margin)


# Movements of a pair of places: planned in both timings, driven, and measured.

AFTER_MOVEMENT = 0.5  # s after it that the filter of the indirect measurement may look at


def row_maker(settings: Mapping[str, Any]) -> Callable[[Mapping[str, Any]], Row]:
    """Rows of pairs by their numbers, with the cell and its places loaded once; `read` of the
    settings: what must be the same here. StudyError where it is not.
    """
    given = settings.get("read", {})
    asked = StatisticsSettings(**{key: value for key, value in settings.items() if key != "read"})
    refuse_others(given, read_by(asked) if given else {})
    planner = Planner(asked.cell)
    try:
        places = places_of(planner, asked.load)
        why = ""
    except (StudyError, PlannerError) as error:
        # a row says so in words, a process that can't start does not
        places = ()
        why = str(error)

    def row_of(job: Mapping[str, Any]) -> Row:
        if why:
            return {"message": why}
        number = int(job["number"])
        pair = pair_of(places, asked.seed, number, asked.safety_distance)
        own = replace(asked, plant=asked.plant_of(number))
        row: Row = {"start": pair.names[0], "goal": pair.names[1]}
        return row | {timing: one_timing(pair, timing, own, planner) for timing in TIMINGS}

    return row_of


def one_timing(pair: EndPair, timing: str, asked: StatisticsSettings, planner: Planner) -> Row:
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
        plan = planner.plan_regional(
            start=pair.start, goal=Goal(configuration=pair.goal), options=options
        )
    except PlannerError as error:
        return {"solved": False, "message": str(error)}
    if plan.trajectory is None or not plan.report.certified:
        return {"solved": False, "message": plan.status.message}
    driven = _figures_driven(plan.trajectory, plan.report.load, asked.plant, planner.cell)
    return _figures_of_plan(plan) | driven


def _figures_of_plan(plan: MovementPlan) -> Row:
    """What the planner says of a certified movement."""
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


def _figures_driven(trajectory: JointTrajectory, load: str, plant: str, cell: Cell) -> Row:
    """Joules by meter and by positions, peak power [W]; NaN, with a sentence, where it was not
    driven.

    Each movement has a robot of its own, whose gears are as warm as before the other.
    """
    try:
        run = SimulatedRun(cell, plant, load)
        try:
            run.place(np.array(trajectory.positions[0]))
            began, ended = run.drive(trajectory)
            run.advance(AFTER_MOVEMENT)
            return _figures_measured(run, began, ended)
        finally:
            run.close()
    except (DriverError, StudyError) as error:
        return {
            "direct_j": math.nan,
            "indirect_j": math.nan,
            "peak_w": math.nan,
            "message": str(error),
        }


def _figures_measured(run: SimulatedRun, began: float, ended: float) -> Row:
    """Joules by meter and by positions and peak power [W] between two times [s] of a run."""
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


@dataclass(frozen=True)
class FinishedStatistics:
    """Rows of all pairs in their order, what they say together, and the files that were written."""

    settings: StatisticsSettings
    rows: tuple[Row, ...]
    findings: Findings
    files: tuple[Path, ...]
    remark: str = ""

    @property
    def summary(self) -> str:
        """Counts, the table of comparisons with intervals, and notes, as text."""
        said = summary_of(self.findings, self.settings)
        return f"{said}\n{self.remark}" if self.remark else said

    @property
    def summed_up(self) -> str:
        """A row of CSV per comparison."""
        return summed_up(self.findings)


def run_statistics(
    settings: StatisticsSettings, folder: str | Path, means: Means | None = None
) -> FinishedStatistics:
    """Make the pairs that the folder has no row of; interrupted, it goes on where it ended.
    StudyError.
    """
    means = means or Means()
    jobs = {str(number): Job(str(number), {"number": number}) for number in range(settings.pairs)}
    read = read_by(settings)
    task = StudyJob("statistics", {**asdict(settings), "read": read}, settings.hang_after)
    with Results(Path(folder), "statistics", settings.budget, read) as results:
        missing = [job for key, job in jobs.items() if key not in results.rows]
        done = len(jobs) - len(missing)
        with means.makers(task) as makers:
            for job, row in makers.rows(missing):
                results.add(job, row)
                done += 1
                means.progress(_progress_text(row), done, len(jobs), "")
        rows = tuple(results.rows[key] for key in jobs)
        remark = results.remark
    found = findings_of(rows)
    files = write_outputs(rows, found, settings, Path(folder))
    return FinishedStatistics(settings, rows, found, files, remark)


def _progress_text(row: Row) -> str:
    """The pair of a row and whether it moved, for the line that says how far the study is."""
    if "start" not in row:
        return str(row.get("message", "no answer"))
    moved = any(solved(row, timing) for timing in TIMINGS)
    return f"{row['start']} to {row['goal']}: {'planned and driven' if moved else 'no movement'}"
