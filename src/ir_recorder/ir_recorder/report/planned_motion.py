"""The picture in 3D of a program that was planned and not driven, and of one for which no plan was
found.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from ir_description import Cell, data_sheet_of
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.before_after import Side
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.loads import carried
from ir_recorder.measure import PowerModel, planned_samples
from ir_recorder.read.recording import TextEvent
from ir_recorder.report.cell_scene import cell_scene
from ir_recorder.report.door_bodies import door_bodies
from ir_recorder.report.series import Json
from ir_recorder.report.side_motion import motion_of


def planned_side(analysis: Analysis) -> Side | None:
    """The planned steps with the power [W] that they are predicted to take; None where their motion
    is not known.
    """
    cell = analysis.cell
    steps = analysis.recording.planned
    if cell is None or not any(step.trajectory is not None for step in steps):
        return None
    time, watts = _power(steps, cell)
    report = TrajectoryReport(duration=sum(step.duration for step in steps))
    return Side("planned", 0.0, steps, report, time=time, watts=watts)


def planned_scene(side: Side, cell: Cell) -> dict[str, Json]:
    """What motion.js draws of it; doors stand as the movements rely on them."""
    return {
        **motion_of(side, cell),
        **cell_scene(cell),
        "bodies": door_bodies(cell, list(_states(side))),
    }


def failed_scene(cell: Cell) -> dict[str, Json]:
    """The cell with its robot at machine home."""
    still = Side("not found", 0.0, (_standing(cell),), TrajectoryReport(duration=1.0))
    return {**motion_of(still, cell), **cell_scene(cell)}


def blamed(cell: Cell, problems: Sequence[str]) -> list[Json]:
    """The bodies and capsules that the problems name: drawn in red."""
    words = set(re.findall(r"\w[\w.\-]*\w|\w", " ".join(problems)))
    capsules = {
        capsule.name
        for part in ("", *(p.name for p in cell.parts))
        for capsule in cell.capsules(part)
    }
    return [*sorted((capsules | {body.name for body in cell.bodies()}) & words)]


def lanes(side: Side) -> list[dict[str, Json]]:
    """The program above the power curve."""
    spans: list[Json] = [
        [begin, begin + step.duration, _label(step), "pause" if step.is_pause else step.kind]
        for begin, step in _timed(side.movements)
    ]
    return [{"label": "program", "spans": spans}]


def _standing(cell: Cell) -> PlannedMovement:
    at = np.repeat(cell.machine_home[None], 2, axis=0)
    still = JointTrajectory(cell.robot.joint_names, np.array([0, 1_000_000_000]), at)
    load = cell.tool.name if cell.tool is not None else "none"
    return PlannedMovement(kind="regional", trajectory=still, duration=1.0, load=load)


def _label(step: PlannedMovement) -> str:
    return (
        " → ".join(dict.fromkeys(filter(None, (step.from_station, step.to_station)))) or step.kind
    )


def _timed(steps: Sequence[PlannedMovement]) -> Iterator[tuple[float, PlannedMovement]]:
    begin = 0.0
    for step in steps:
        yield begin, step
        begin += step.duration


def _states(side: Side) -> Iterator[TextEvent]:
    for begin, step in _timed(side.movements):
        for text in step.states:
            machine, _, state = text.partition("=")
            yield TextEvent(begin, machine, state)


def _power(steps: Sequence[PlannedMovement], cell: Cell) -> tuple[FloatArray, FloatArray]:
    """Time [s] and power at the mains [W]: of movements by the data sheet, of pauses as they were
    planned.
    """
    data = cell.robot.controller
    parameters = data_sheet_of(cell.robot, data)
    model = PowerModel(cell.robot, data.dc_link, cell.base_pose, parameters)
    times = []
    watts = []
    for begin, step in _timed(steps):
        if step.trajectory is None:
            times.append(begin + np.array([0.0, step.duration]))
            watts.append(np.full(2, step.report.energy / max(step.duration, 1e-9)))
            continue
        samples = planned_samples(step.trajectory, carried(cell, step.load), parameters.modes)
        times.append(begin + samples.time - step.trajectory.times[0])
        watts.append(model.watts(parameters.mean, model.prepare(samples)))
    return np.concatenate(times), np.concatenate(watts)
