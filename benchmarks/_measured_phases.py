"""Recordings with two phases: something changes half-way, and nobody states it. Is it named?

The plant is that of `_measured_strangers`; it knows what changed, when and by how much.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from _measured_strangers import (
    DT,
    MODES,
    Stranger,
    joint_log,
    meter_log,
    motion,
    standing_for,
    torques,
    watts_of,
)

from ir_description import RobotModel, data_sheet_of, load_robot
from ir_description.robot import centre_deviations, without_table
from ir_recorder.fit import Change, Estimate, change
from ir_recorder.measure import PowerModel, samples_of
from ir_recorder.traces import Trace
from ir_values.arrays import FloatArray

ROBOTS = {
    "kr6_r900_2": 6.0,
    "ur10e": 10.0,
    "kr210_r2700_extra": 210.0,
    "kr300_r2700_2": 300.0,
}
"""Robots with their payloads [kg]."""
CLEAN = "nothing"
WARM = "friction"
KINDS = (CLEAN, "payload", "watts", "rest", "clock", WARM)
NAMED = {"payload": "payload", "watts": "watts", "rest": "watts", "clock": "clock"}
SECONDS = 20.0
LONG = 60.0  # s: of recordings in which gears get warm
NEAR = 4.0  # s beside the instant: a change is seen by the movements before and behind it
_REST = 2.0  # s before and after
_LEAST_LEFT = 1.0  # s of a rest


@dataclass(frozen=True)
class Phases:
    """A recording, and what changes in it: one of KINDS at `start` until `end` [s] by a size."""

    robot: Stranger
    joints: Trace
    meter: Trace
    kind: str
    start: float
    end: float
    size: float


def known(name: str) -> RobotModel:
    """A robot without its gas spring, which the plant has not, at a controller nobody knows."""
    return replace(load_robot(name), counterbalance=None, controller=without_table())


def recorded(name: str, kind: str, seed: int, seconds: float = SECONDS) -> Phases:
    """A recording of a robot in which something changes at a random rest in its middle."""
    rng = np.random.default_rng([seed, list(ROBOTS).index(name), KINDS.index(kind)])
    carries = ROBOTS[name]
    robot = standing_for(known(name), carries, rng)
    robot = replace(robot, warm=min(robot.warm, 0.1))
    time, q, qd, qdd = motion(robot.known, seconds, rng, rest=_REST)
    still = (np.abs(qd) < 1e-9).all(axis=1) & (time > 0.3 * seconds) & (time < 0.7 * seconds)
    first = int(rng.choice(np.flatnonzero(still))) if still.any() else len(time) // 2
    start = float(time[first])
    end = np.inf
    size = 0.0
    if kind == "rest":
        longer = round(rng.uniform(3.0, 8.0) / DT)
        q, qd, qdd = (np.insert(each, [first] * longer, each[first], 0) for each in (q, qd, qdd))
        time = DT * np.arange(len(q))
        end = float(time[first + longer])
    torque = torques(robot, time, q, qd, qdd)
    if kind == WARM:
        size = rng.uniform(0.4, 1.0)
        colder = size * np.exp(-time / (rng.uniform(0.3, 0.7) * seconds))
        torque = torque + robot.viscous * colder[:, None] * qd
    elif kind == "payload":
        size = rng.uniform(0.3, 0.8) * carries
        if rng.random() < 0.5 and robot.payload > size:
            size = -size
        other = replace(robot, payload=robot.payload + size)
        torque[first:] = torques(other, time, q, qd, qdd)[first:]
    watts = watts_of(robot, time, qd, torque)
    if kind == "rest":
        size = -rng.uniform(0.3, 0.9) * robot.standing
        watts[(time >= start) & (time < end)] = robot.standing + size
    elif kind == "watts":
        size = rng.uniform(0.1, 0.4) * robot.standing * rng.choice([-1.0, 1.0])
        watts[first:] += size
    meter = meter_log(watts, rng)
    if kind == "clock":
        size = rng.uniform(0.15, 0.6)
        meter = replace(meter, time=meter.time + size * (meter.time > start))
    joints = joint_log(robot, time, q, rng)
    return Phases(robot, joints, meter, kind, start, end, size)


def estimate_of(phases: Phases) -> Estimate:
    """The fit that is looked at, before it has begun."""
    robot = phases.robot.known
    prior = data_sheet_of(robot, robot.controller).with_centres(centre_deviations(robot))
    held = [(-np.inf, np.inf, ())]
    samples = samples_of(phases.joints, phases.meter, robot.joint_names, MODES, held)
    model = PowerModel(robot, robot.controller.dc_link, np.eye(4), prior)
    return Estimate([samples], ["log"], model, prior)


def outcome(phases: Phases, found: Change | None) -> str:
    """Silent, or named rightly, wrongly, or without need."""
    if found is None:
        return "silent"
    if phases.kind == CLEAN:
        return "named without need"
    kinds = {found.kind, *found.others}
    wanted = NAMED.get(phases.kind, phases.kind)
    near = abs(found.start - phases.start) < NEAR or phases.kind == WARM
    return "named rightly" if wanted in kinds and near else "named wrongly"


def outcomes(seeds: range, robots: Sequence[str] = tuple(ROBOTS)) -> Iterator[dict[str, object]]:
    """What comes of recordings of robots and of every kind, as rows."""
    for seed in seeds:
        for name in robots:
            lasts = [(kind, SECONDS) for kind in KINDS[:-1]] + [(CLEAN, LONG), (WARM, LONG)]
            for kind, seconds in lasts:
                phases = recorded(name, kind, seed, seconds)
                found = change(estimate_of(phases))
                yield {
                    "robot": name,
                    "changed": kind,
                    "seconds": seconds,
                    "at": round(phases.start, 1),
                    "by": round(phases.size, 2),
                    "outcome": outcome(phases, found),
                    "said": "" if found is None else found.sentence,
                }


def torque_log(name: str, seed: int, kind: str) -> tuple[Estimate, Phases]:
    """A fit by the motors' torques of such a recording, whose payload may change."""
    phases = recorded(name, CLEAN, seed)
    robot = phases.robot
    rng = np.random.default_rng([seed, 1])
    time, q, qd, qdd = motion(robot.known, SECONDS, rng, rest=_REST)
    torque = torques(robot, time, q, qd, qdd)
    first = len(time) // 2
    size = 0.0
    if kind == "payload":
        size = rng.uniform(0.3, 0.8) * ROBOTS[name]
        other = replace(robot, payload=robot.payload + size)
        torque[first:] = torques(other, time, q, qd, qdd)[first:]
    noise: FloatArray = rng.normal(0.0, 0.01, torque.shape) * np.abs(torque).max(axis=0)
    joints = joint_log(robot, time, q, rng, torque + noise)
    known_robot = robot.known
    prior = data_sheet_of(known_robot, known_robot.controller)
    prior = prior.with_centres(centre_deviations(known_robot))
    held = [(-np.inf, np.inf, ())]
    samples = samples_of(joints, None, known_robot.joint_names, MODES, held)
    model = PowerModel(known_robot, known_robot.controller.dc_link, np.eye(4), prior)
    estimate = Estimate([samples], ["log"], model, prior, motors=True)
    return estimate, replace(phases, kind=kind, start=float(time[first]), size=size)
