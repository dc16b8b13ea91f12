"""Motion and power of a program that nobody recorded, for the picture in 3D and the chart."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ir_description import Cell
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.before_after import Side
from ir_msgs_py.report import PlannedMovement
from ir_recorder.report.axes import Curves, packed
from ir_recorder.report.cell_scene import matrix, part_meshes
from ir_recorder.report.scene import ANGLE_STEP, MOST_FRAMES, POWER_STEP, RATE
from ir_recorder.report.series import Json, quantised

_POINTS = 4000  # of a power curve


def motion_of(side: Side, cell: Cell) -> dict[str, Json]:
    """What motion.js draws of a program beside its cell."""
    end = max(side.report.duration, 1e-3)
    time = np.linspace(0.0, end, int(np.clip(end * RATE, 2, MOST_FRAMES)))
    watts = np.interp(time, side.time, side.watts) if len(side.time) else np.zeros(len(time))
    return {
        "name": side.name,
        "seconds": side.report.duration,
        "start": 0.0,
        "step": float(time[1] - time[0]),
        "frames": len(time),
        "angleStep": ANGLE_STEP,
        "angles": quantised(_joints(side, time), ANGLE_STEP),
        "power": quantised(watts, POWER_STEP),
        "parts": _parts(side, cell),
        "loads": [[round(at, 3), step.load or "none"] for at, step in _timed(side)],
        "nearest": [],
    }


def power_curves(sides: Sequence[Side]) -> dict[str, Json]:
    """Power at the mains of all programs on one grid, each from its start."""
    end = max(side.report.duration for side in sides)
    time = np.linspace(0.0, end, _POINTS)
    value = np.column_stack([np.interp(time, side.time, side.watts, right=0.0) for side in sides])
    curves = packed(Curves("power at the mains, predicted", "W", time, value))
    ends: list[Json] = [side.report.duration for side in sides]
    return {**curves, "names": [side.name for side in sides], "ends": ends}


def _timed(side: Side) -> list[tuple[float, PlannedMovement]]:
    """Steps with their starts [s]."""
    starts = np.cumsum([0.0, *(step.duration for step in side.movements)])[:-1]
    return list(zip(starts.tolist(), side.movements, strict=True))


def _joints(side: Side, time: FloatArray) -> FloatArray:
    """Joint values (M, n) at times (M,) [s]; in a pause they stay."""
    first = next(step.trajectory for step in side.movements if step.trajectory is not None)
    q = np.tile(first.positions[0], (len(time), 1))
    for begin, step in _timed(side):
        trajectory = step.trajectory
        if trajectory is not None:
            rows = time >= begin
            at = np.minimum(time[rows] - begin + trajectory.times[0], trajectory.duration)
            q[rows] = trajectory.sample(at).q
    return q


def _parts(side: Side, cell: Cell) -> list[dict[str, Json]]:
    """For each part its meshes, and from when on it lies where."""
    lying = {part.name: part.station for part in cell.parts}
    changes: dict[str, list[Json]] = {
        name: [_lies(cell, -1e9, station)] for name, station in lying.items()
    }
    for begin, step in _timed(side):
        end = begin + step.duration
        if step.attach in changes:
            changes[step.attach].append(_lies(cell, end, ""))
        if step.detach in changes:
            changes[step.detach].append(_lies(cell, end, step.to_station))
    return [
        {"name": name, "lies": lies, "meshes": part_meshes(cell, name)}
        for name, lies in changes.items()
    ]


def _lies(cell: Cell, time: float, station: str) -> Json:
    return [round(time, 3), matrix(cell.station(station).pose) if station else None]
