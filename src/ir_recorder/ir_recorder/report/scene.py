"""The cell and its motion for the picture in 3D: the joint values 50 times a second, parts, loads,
pairs.
"""

from __future__ import annotations

import numpy as np

from ir_description import Cell, PartPlaces
from ir_msgs_py.arrays import FloatArray
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.clearance import places_after
from ir_recorder.report.cell_scene import cell_scene, matrix, part_meshes
from ir_recorder.report.door_bodies import door_bodies
from ir_recorder.report.series import Json, floats, indices, quantised

RATE = 50.0  # Hz: between two frames the fastest axis turns 4 degrees, and the page stays small
MOST_FRAMES = 60_000  # 20 minutes; a longer recording gets fewer frames a second
ANGLE_STEP = 2e-4  # rad: int16 spans 6.5 rad; at 3 m from an axis it is 0.6 mm
POWER_STEP = 1.0  # W: colours show no less, and int16 holds 32 kW


def scene(analysis: Analysis) -> dict[str, Json] | None:
    """What motion.js draws; None where cell or joint states are missing."""
    cell = analysis.cell
    joints = analysis.recording.joints
    if (
        cell is None
        or joints is None
        or joints.position.shape[1] != cell.robot.n
        or len(joints.time) < 2
    ):
        return None
    time = _frames(joints.time)
    nearest = np.clip(np.searchsorted(joints.time, time, side="right") - 1, 0, len(joints.time) - 1)
    q = joints.position[nearest]
    return {
        "start": float(time[0]),
        "step": float(time[1] - time[0]),
        "frames": len(time),
        "angleStep": ANGLE_STEP,
        "angles": quantised(q, ANGLE_STEP),
        "power": quantised(_power(analysis, time), POWER_STEP),
        **cell_scene(cell),
        "bodies": door_bodies(cell, analysis.recording.machines),
        "parts": _part_places(analysis, cell),
        "loads": [[round(t, 3), load] for t, load in _load_changes(analysis)],
        "nearest": _nearest(analysis),
    }


def _frames(time: FloatArray) -> FloatArray:
    span = float(time[-1] - time[0])
    count = int(np.clip(span * RATE, 2, MOST_FRAMES))
    return np.linspace(time[0], time[-1], count)


def _power(analysis: Analysis, time: FloatArray) -> FloatArray:
    power = analysis.recording.power
    if power is None or not len(power.time):
        return np.zeros(len(time))
    return np.interp(time, power.time, power.power)


def _part_places(analysis: Analysis, cell: Cell) -> list[dict[str, Json]]:
    """For each part its meshes, and from when on it lies where (no pose: it is held or nowhere)."""
    changes: list[tuple[float, PartPlaces]] = [(-1e9, cell.parts_at_start())]
    for result in analysis.steps:
        if result.step.outcome != "ended":
            continue
        places = places_after(cell, changes[-1][1], result.step.movement)
        if places is not changes[-1][1]:
            changes.append((result.step.end, places))
    parts: list[dict[str, Json]] = []
    for part in cell.parts:
        lies: list[Json] = []
        for time, places in changes:
            station = places.lying.get(part.name, "")
            lies.append([round(time, 3), matrix(cell.station(station).pose) if station else None])
        parts.append({"name": part.name, "lies": lies, "meshes": part_meshes(cell, part.name)})
    return parts


def _load_changes(analysis: Analysis) -> list[tuple[float, str]]:
    changes: list[tuple[float, str]] = []
    for time, load in analysis.loads.observations:
        if not changes or changes[-1][1] != load:
            changes.append((time if changes else -1e9, load))  # what is seen first was there before
    if not changes and analysis.cell is not None and analysis.cell.tool is not None:
        changes.append((-1e9, analysis.cell.tool.name))
    return changes


def _nearest(analysis: Analysis) -> list[dict[str, Json]]:
    """The closest pair along each movement, for the line between the two bodies."""
    return [
        {
            "time": floats(near.time),
            "distance": floats(near.distance),
            "a": quantised(near.point_a, 5e-4),
            "b": quantised(near.point_b, 5e-4),
            "pairs": sorted(set(near.pairs)),
            "pair": indices([sorted(set(near.pairs)).index(pair) for pair in near.pairs]),
        }
        for near in (result.clearance for result in analysis.steps)
        if near is not None
    ]
