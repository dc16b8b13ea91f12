"""Motion in 3D: of a recording, of a plan that was not driven, and of a program beside it."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, PartPlaces, RobotModel, data_sheet_of
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_msgs_py.savings import Side
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.clearance import places_after
from ir_recorder.analysis.loads import carried
from ir_recorder.measure import PowerModel, planned_samples
from ir_recorder.reading.recording import TextEvent
from ir_recorder.report.cell_scene import cell_scene, door_bodies, matrix, part_meshes
from ir_recorder.report.series import (
    Curves,
    Json,
    Span,
    floats,
    indices,
    long_rests,
    packed,
    quantised,
    stretches,
)
from ir_values.arrays import FloatArray

# The cell and its motion for the picture in 3D: the joint values 50 times a second, parts, loads,
# pairs.

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
        **_values(q, cell.robot),
        "power": quantised(_power(analysis, time), POWER_STEP),
        **cell_scene(cell),
        "bodies": door_bodies(cell, analysis.recording.machines),
        "parts": _part_places(analysis, cell),
        "loads": [[round(t, 3), load] for t, load in _load_changes(analysis)],
        "nearest": _nearest(analysis),
    }


def _values(q: FloatArray, robot: RobotModel) -> dict[str, Json]:
    """Joint values (N, n) as whole steps: of those that turn 0.2 mrad, of a rail what its travel
    needs.
    """
    steps = np.full(robot.n, ANGLE_STEP)
    if robot.rail is not None:
        steps[0] = max(abs(robot.rail.low), abs(robot.rail.high)) / 32_000.0
    return {"jointSteps": steps.tolist(), "jointValues": quantised(q, steps)}


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


# Motion and power of a program that nobody recorded, for the picture in 3D and the chart.

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
        **_values(_joints(side, time), cell.robot),
        "power": quantised(watts, POWER_STEP),
        "parts": _parts(side, cell),
        "loads": [[round(at, 3), step.load or "none"] for at, step in _timed(side)],
        "nearest": [],
    }


def rests_of(side: Side) -> list[Span]:
    """When a program rests [s], and after its end."""
    rests = [(at, at + step.duration) for at, step in _timed(side) if step.is_pause]
    return [*rests, (side.report.duration, math.inf)]


_ROUNDING = 1e-6  # s: begins of steps are sums


@dataclass(frozen=True, eq=False)
class InStep:
    """Programs beside each other, stop by stop: what one is sooner it waits for the others.

    begins (K,) [s]: of its movements and pauses in their own time; there (K,): where they are
    drawn.
    """

    begins: FloatArray
    there: FloatArray
    end: float

    def at(self, time: FloatArray) -> FloatArray:
        """Where times (N,) [s] of the program are drawn; increasing."""
        own = np.clip(np.searchsorted(self.begins - _ROUNDING, time, "right") - 1, 0, None)
        drawn: FloatArray = self.there[own] + time - self.begins[own]
        return drawn


def in_step(sides: Sequence[Side]) -> list[InStep]:
    """Programs stop by stop, each from its own start where their stops are not the same."""
    names = [[hop.name for hop in side.hops] for side in sides]
    lengths = [np.array([hop.seconds for hop in side.hops]) for side in sides]
    alike = min(map(len, names))
    if any(own[:alike] != names[0][:alike] for own in names):
        alike = 0
    longest = np.max([own[:alike] for own in lengths], axis=0)
    found = []
    for own in lengths:
        drawn = np.concatenate([longest, own[alike:]])
        begins, there = (np.concatenate([[0.0], np.cumsum(each)]) for each in (own, drawn))
        # the last of a program ends when it does
        end = float(there[-2] + own[-1]) if len(own) else 0.0
        found.append(InStep(begins[:-1], there[:-1], end))
    return found


def power_curves(sides: Sequence[Side]) -> dict[str, Json]:
    """Power at the mains of all programs on one grid, stop by stop, every peak kept; a few points
    in rests that all have.
    """
    drawn = in_step(sides)
    end = max(each.end for each in drawn)
    time = np.linspace(0.0, end, 8 * _POINTS)
    inner = 0.5  # s at the ends of a rest, in which modes change
    rests = common_rests(sides)
    resting = np.zeros(len(time), dtype=bool)
    for start, stop in rests:
        resting |= (time > start + inner) & (time < stop - inner)
    moving = np.flatnonzero(~resting)
    kept = moving[:: max(1, len(moving) // _POINTS)]
    time = time[np.union1d(kept, np.flatnonzero(resting)[::64])]
    middle = (time[1:] + time[:-1]) / 2.0
    over = [middle > each.end for each in drawn]
    both = list(zip(drawn, sides, strict=True))
    lows = [stretches(time, each.at(side.time), side.watts).low for each, side in both]
    highs = [stretches(time, each.at(side.time), side.high).high for each, side in both]
    low, high = (np.where(np.transpose(over), 0.0, np.transpose(own)) for own in (lows, highs))
    curves = packed(Curves("power at the mains, predicted", "W", middle, high, low=low))
    ends: list[Json] = [each.end for each in drawn]
    return {**curves, "names": [side.name for side in sides], "ends": ends}


def common_rests(sides: Sequence[Side]) -> list[Span]:
    """Long rests [s] of all programs, stop by stop."""
    rests = []
    for each, side in zip(in_step(sides), sides, strict=True):
        own = np.array(rests_of(side)[:-1]).reshape(-1, 2)
        begins = each.at(own[:, 0])
        ends = begins + own[:, 1] - own[:, 0]
        rests.append([*zip(begins.tolist(), ends.tolist(), strict=True), (each.end, math.inf)])
    return long_rests(rests)


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


# The picture in 3D of a program that was planned and not driven, and of one for which no plan was
# found.


def planned_side(analysis: Analysis) -> Side | None:
    """The planned steps with the power [W] that they are predicted to take; None where their motion
    is not known.
    """
    cell = analysis.cell
    return None if cell is None else side_of_steps(analysis.recording.planned, cell)


def side_of_steps(steps: Sequence[PlannedMovement], cell: Cell) -> Side | None:
    """Steps of a plan with the power [W] that they are predicted to take; None where none moves."""
    if not any(step.trajectory is not None for step in steps):
        return None
    time, watts = _power_planned_motion(steps, cell)
    report = TrajectoryReport(duration=sum(step.duration for step in steps))
    return Side("planned", 0.0, tuple(steps), report, time=time, watts=watts)


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
        for begin, step in _timed_planned_motion(side.movements)
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


def _timed_planned_motion(
    steps: Sequence[PlannedMovement],
) -> Iterator[tuple[float, PlannedMovement]]:
    begin = 0.0
    for step in steps:
        yield begin, step
        begin += step.duration


def _states(side: Side) -> Iterator[TextEvent]:
    for begin, step in _timed_planned_motion(side.movements):
        for text in step.states:
            machine, _, state = text.partition("=")
            yield TextEvent(begin, machine, state)


def _power_planned_motion(
    steps: Sequence[PlannedMovement], cell: Cell
) -> tuple[FloatArray, FloatArray]:
    """Time [s] and power at the mains [W]: of movements by the data sheet, of pauses as they were
    planned.
    """
    data = cell.robot.controller
    parameters = data_sheet_of(cell.robot, data)
    model = PowerModel(cell.robot, data.dc_link, cell.base_pose, parameters)
    times = []
    watts = []
    for begin, step in _timed_planned_motion(steps):
        if step.duration <= 0.0:  # it is where it has to go
            continue
        if step.trajectory is None:
            times.append(begin + np.array([0.0, step.duration]))
            watts.append(np.full(2, step.report.energy / max(step.duration, 1e-9)))
            continue
        samples = planned_samples(step.trajectory, carried(cell, step.load), parameters.modes)
        times.append(begin + samples.time - step.trajectory.times[0])
        watts.append(model.watts(parameters.mean, model.prepare(samples)))
    return np.concatenate(times), np.concatenate(watts)
