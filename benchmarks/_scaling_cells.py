"""Inputs of any size for benchmarks/scaling.py: cells with many bodies, programs, trajectories."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ir_description import Body, Cell, Equipment, load_cell
from ir_description.cell import AllowedContact, Zone, station_at
from ir_description.poses import pose_of
from ir_msgs_py.trajectory import JointTrajectory
from ir_values.arrays import FloatArray

# m: beyond the arm, so that every size has the same free paths
NEAREST = 3.4
FARTHEST = 10.0
HIGHEST = 3.0
EDGES = (0.05, 0.3)  # m
PER_WAVE = 10  # points of a trajectory
WAVE_S = 3.0
AMPLITUDE = 0.15  # rad


def crowded(name: str, bodies: int, seed: int) -> Cell:
    """A cell filled up to `bodies` bodies by machines, each a box with a station and a contact it
    allows.
    """
    cell = load_cell(name)
    bodies = max(bodies - len(cell.bodies()), 0)
    rng = np.random.default_rng([seed, bodies])
    angle = rng.uniform(-np.pi, np.pi, bodies)
    radius = rng.uniform(NEAREST, FARTHEST, bodies)
    places = np.stack(
        [radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0.2, HIGHEST, bodies)]
    )
    edges = rng.uniform(*EDGES, (bodies, 3))
    base = cell.base_pose[:3, 3] * [1.0, 1.0, 0.0]
    machines = tuple(
        _machine(k, base + place, size)
        for k, (place, size) in enumerate(zip(places.T, edges, strict=True))
    )
    capsule = cell.robot.capsules[-1].name
    stations = tuple(
        station_at(
            machine, f"at_{machine.name}", np.eye(4), (AllowedContact(capsule, body.name, 0.0),)
        )
        for machine in machines
        for body in machine.bodies
    )
    return replace(
        cell, equipment=(*cell.equipment, *machines), stations=(*cell.stations, *stations)
    )


def _machine(number: int, place: FloatArray, size: FloatArray) -> Equipment:
    box = Body(f"box_{number}", "box", np.eye(4), size)
    return Equipment(f"machine_{number}", pose_of(place), (box,), Zone("OPEN", np.eye(4), size))


def tour(cell: Cell, stops: int, seed: int) -> tuple[str, ...]:
    """Stations of a cell in a random order, no one twice in a row."""
    names = [station.name for station in cell.stations]
    rng = np.random.default_rng([seed, stops])
    found: list[str] = []
    while len(found) < stops:
        name = str(rng.choice(names))
        if not found or name != found[-1]:
            found.append(name)
    return tuple(found)


def with_turns(cell: Cell, half_range: float) -> Cell:
    """The cell whose robot may turn A4 and A6 by `half_range` rad in both directions."""
    robot = cell.robot
    turning = [3, 5]
    low = np.array(robot.position_min)
    high = np.array(robot.position_max)
    low[turning] = -half_range
    high[turning] = half_range
    return replace(cell, robot=replace(robot, position_min=low, position_max=high), tasks=())


def waves(cell: Cell, points: int) -> JointTrajectory:
    """A slow wave of all joints from home to beside it, at rest at both; more points last
    longer.
    """
    duration = WAVE_S * points / PER_WAVE
    share = np.linspace(0.0, 1.0, points)
    ramp = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)  # at rest at both ends
    slope = 30.0 * share**2 * (1.0 - share) ** 2
    bend = 60.0 * share * (1.0 - share) * (1.0 - 2.0 * share)
    turns = 2.0 * np.pi * max(points // (2 * PER_WAVE), 1)
    swing = AMPLITUDE * np.array([1.0, 0.5, -0.5, 1.0, 1.0, -1.0])
    phase = turns * ramp
    drift = 0.5 / turns  # of the swing, so that the end is another configuration
    q = cell.machine_home + (np.sin(phase) + drift * phase)[:, None] * swing
    qd = ((np.cos(phase) + drift) * turns * slope / duration)[:, None] * swing
    acceleration = (np.cos(phase) + drift) * turns * bend - np.sin(phase) * (turns * slope) ** 2
    times = share * duration
    return JointTrajectory.from_seconds(
        cell.robot.joint_names, times, q, qd, acceleration[:, None] / duration**2 * swing
    )
