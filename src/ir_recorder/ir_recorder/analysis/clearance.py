"""Executed clearance: exact distances along the recorded joint states, with the loads the program
carried.

Pairs that a station allows to touch don't count against the safety distance on movements to and
from it: they keep their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, PartPlaces
from ir_kernels import Chain, CollisionModel
from ir_msgs_py.names import LOAD_SEPARATOR
from ir_msgs_py.report import PlannedMovement
from ir_recorder.analysis.loads import held_part, normal
from ir_recorder.analysis.steps import ExecutedStep
from ir_recorder.reading.recording import JointSeries
from ir_values.arrays import FloatArray

# s between samples of the profile: 4 cm of tool path. Near its minimum all joint states count
COARSE = 0.02
_NONE = -1


@dataclass(frozen=True, eq=False)
class StepClearance:
    """Along one step: time (N,) [s], distance (N,) [m] of the nearest pair that isn't allowed to
    touch, point_a and point_b (N, 3) in the world; the least distance with its pair and time;
    contact_margin [m]: least excess of an allowed pair over its own safety distance (inf: no such
    pair).
    """

    time: FloatArray
    distance: FloatArray
    point_a: FloatArray
    point_b: FloatArray
    pairs: tuple[str, ...]
    least: float
    least_pair: str
    least_time: float
    contact_margin: float


def step_clearances(
    cell: Cell, joints: JointSeries, steps: Sequence[ExecutedStep]
) -> tuple[StepClearance | None, ...]:
    """Clearance of each movement; None for pauses and where nothing was recorded."""
    places = cell.parts_at_start()
    result: list[StepClearance | None] = []
    for step in steps:
        result.append(
            None if step.movement.is_pause else _step_clearance(cell, joints, step, places)
        )
        if step.outcome == "ended":
            places = places_after(cell, places, step.movement)
    return tuple(result)


def places_after(cell: Cell, places: PartPlaces, movement: PlannedMovement) -> PartPlaces:
    """Where the parts are after a step that ended."""
    parts = {part.name for part in cell.parts}
    if movement.attach in parts:
        return places.taken(movement.attach)
    if movement.detach in parts:
        stations = {station.name for station in cell.stations}
        return places.put(
            movement.detach, movement.to_station if movement.to_station in stations else ""
        )
    return places


def collision_model(cell: Cell, load: str, places: PartPlaces) -> CollisionModel:
    """Exact distances for the robot with that load among the bodies as they stand."""
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    tool = cell.tool is not None and cell.tool.name in normal(load).split(LOAD_SEPARATOR)
    held = held_part(cell, load)
    if tool or held or not load:
        capsules = cell.capsules(held)
        pairs = cell.self_pairs(held)
    else:
        capsules = cell.robot.capsules
        pairs = cell.robot.self_pairs
    bodies = cell.bodies(PartPlaces(held, {**places.lying, held: ""} if held else places.lying))
    return CollisionModel(chain, capsules, bodies, pairs, cell.ignored_pairs)


def _step_clearance(
    cell: Cell, joints: JointSeries, step: ExecutedStep, places: PartPlaces
) -> StepClearance | None:
    """The nearest pairs along a driven step; None where its positions are missing."""
    rows = np.flatnonzero((joints.time >= step.start - 1e-9) & (joints.time <= step.end + 1e-9))
    rows = rows[np.isfinite(joints.position[rows]).all(axis=1)]
    if not len(rows) or joints.position.shape[1] != cell.robot.n:
        return None
    model = collision_model(cell, step.movement.load, places)
    own = allowed_pairs(cell, step.movement, model)
    offset = np.where(np.isnan(own), 0.0, -np.inf)
    stride = _stride(joints.time[rows])
    coarse = rows[::stride]
    near = model.min_distance(joints.position[coarse], offset)
    best = int(np.argmin(near.distance))
    fine = rows[max(0, (best - 1) * stride) : (best + 1) * stride + 1]
    finer = model.min_distance(joints.position[fine], offset)
    least = int(np.argmin(finer.distance))
    return StepClearance(
        joints.time[coarse],
        near.distance,
        near.point_a,
        near.point_b,
        tuple(pair_name(model, index) for index in near.pair),
        float(finer.distance[least]),
        pair_name(model, finer.pair[least]),
        float(joints.time[fine[least]]),
        _contact_margin(model, joints.position[coarse], own),
    )


def _stride(time: FloatArray) -> int:
    """How many joint states lie between two coarse samples."""
    return (
        max(1, round(COARSE / max(float(np.median(np.diff(time))), 1e-4))) if len(time) > 1 else 1
    )


def allowed_pairs(cell: Cell, movement: PlannedMovement, model: CollisionModel) -> FloatArray:
    """Own safety distance (Z,) of pairs that the step's stations allow to touch, or that are near
    by construction of the robot; NaN for all others.
    """
    own = np.full(len(model.pairs), np.nan)
    for first, second, distance, _ in cell.robot.reduced_distances:
        for z, pair in enumerate(model.pairs):
            if {pair.body_a, pair.body_b} == {first, second}:
                own[z] = distance
    ends = (movement.from_station, movement.to_station)
    for station in cell.stations:
        if station.name in ends:
            for contact in station.allowed_contacts:
                for z, pair in enumerate(model.pairs):
                    if {pair.body_a, pair.body_b} == {contact.body_a, contact.body_b}:
                        own[z] = contact.safety_distance
    return own


def _contact_margin(model: CollisionModel, q: FloatArray, own: FloatArray) -> float:
    allowed = ~np.isnan(own)
    if not allowed.any():
        return float("inf")
    near = model.min_distance(q, np.where(allowed, own, -np.inf))
    return float((near.distance - own[near.pair]).min())


def pair_name(model: CollisionModel, index: int) -> str:
    """The two bodies of a pair, "" for none."""
    return "" if index == _NONE else f"{model.pairs[index].body_a} – {model.pairs[index].body_b}"
