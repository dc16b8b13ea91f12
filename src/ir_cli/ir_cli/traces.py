"""Traces of joints: CSV files written, measured positions read and checked against the robot.

Columns: `time`, one per joint (`joint_a1`, or `joint_a1_deg` in degrees), then `joint_a1_velocity`
[rad/s] and `joint_a1_acceleration` [rad/s^2]. Positions alone, as in a measured trace, are smoothed
(`smoothing`). `ir_recorder.traces` reads them; it also takes Parquet and recordings, other units in
the headings, and other headings by a mapping file.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ir_cli.errors import InputError
from ir_cli.output import Row
from ir_cli.smoothing import BANDWIDTHS, MeasuredMotion, measured, smoothed
from ir_description import RobotModel
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.checks import movement_energy
from ir_planner.program import Progress
from ir_recorder.errors import RecorderError
from ir_recorder.traces import Trace, TraceMapping, column_names, read_mapping, read_traces
from ir_recorder.traces.trace import ACCELERATION, EFFORT, GAP_FACTOR, VELOCITY
from ir_values.arrays import FloatArray
from ir_values.errors import IrError
from ir_values.output_files import replacing_text

ENDINGS = ("", VELOCITY, ACCELERATION)
RECORDED = (".mcap", ".db3", ".xml", ".dat")  # what they hold is measured
DAY = 86400.0  # s
_SAME_PLACE = 0.001  # rad
_NEAR = 0.02  # s: rows that lie nearer say by themselves how fast a joint is
_APART = 0.2  # share of a joint's motion that its speeds may be off: encoders' noise is far less
_ROWS_COMPARED = 8


def write_trace(path: Path, trajectory: JointTrajectory) -> None:
    """Write points with speeds and accelerations; `read_trace` gives the same trajectory back."""
    names = trajectory.joint_names
    kinds = [trajectory.positions, trajectory.velocities, trajectory.accelerations]
    given = [
        (ending, each) for ending, each in zip(ENDINGS, kinds, strict=True) if each is not None
    ]
    header = ["time", *(f"{name}{ending}" for ending, _ in given for name in names)]
    rows = np.column_stack([trajectory.times, *(values for _, values in given)])
    path.parent.mkdir(parents=True, exist_ok=True)
    with replacing_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([repr(value) for value in row] for row in rows.tolist())


def write_readings(path: Path, trace: Trace) -> None:
    """Write all columns of a measured trace; `ir_recorder.traces` reads them back."""
    path.parent.mkdir(parents=True, exist_ok=True)
    numbers = zip(
        trace.time.tolist(), *(values.tolist() for values in trace.columns.values()), strict=True
    )
    with replacing_text(path) as file:
        file.write(f"# {trace.source}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *trace.columns, *trace.texts])
        for row, words in zip(numbers, zip(*trace.texts.values(), strict=True), strict=True):
            writer.writerow([*(f"{value:.9g}" for value in row), *words])


def read_trace(path: Path, joint_names: Sequence[str]) -> JointTrajectory:
    """The trajectory of a trace (CSV, Parquet, a recording) as it is given; from positions alone by
    a spline.

    InputError with the line and the column that is wrong.
    """
    found = read_motion(path, joint_names)
    if isinstance(found, JointTrajectory):
        return found
    return smoothed(tuple(joint_names), found.time, found.positions, BANDWIDTHS[-1])


class Rows(NamedTuple):
    """Positions alone: time (N,) [s] from 0 on, positions (N, n) [rad], and what was left out of
    the file.
    """

    time: FloatArray
    positions: FloatArray
    notes: tuple[str, ...] = ()


def read_motion(
    path: Path, joint_names: Sequence[str], mapping: Path | None = None
) -> JointTrajectory | Rows:
    """The trajectory of a trace that gives speeds and accelerations, else its positions alone.

    What a recording or a mapped file gives is measured: its positions count. InputError with the
    line and the column that is wrong, and for a gap in which the robot moved.
    """
    try:
        meaning = _mapping(mapping, joint_names) if mapping is not None else None
        trace = read_traces(path, meaning, joint_names)[0]
        positions = trace.joints(joint_names)
        velocities = trace.joints(joint_names, VELOCITY)
        accelerations = trace.joints(joint_names, ACCELERATION) if velocities is not None else None
    except RecorderError as error:
        raise InputError(str(error)) from error
    if positions is None:
        known = ", ".join(trace.columns)[:200]
        raise InputError(f"{trace.source}: there is no column {joint_names[0]}, there is: {known}")
    times = trace.time
    if not 0.0 <= times[0] <= DAY:  # of a clock that knows the date
        times = times - times[0]
    if accelerations is None or mapping is not None or path.suffix.lower() in RECORDED:
        return _without_holes(trace, times, positions, joint_names)
    try:
        found = JointTrajectory.from_seconds(
            joint_names, times, positions, velocities, accelerations
        )
    except IrError as error:
        raise InputError(f"{trace.source}: {error}") from error
    _check_speeds(trace.source, found)
    return found


def _mapping(path: Path, joint_names: Sequence[str]) -> TraceMapping:
    """The mapping of a file. InputError for a name that is no column of a trace of this robot."""
    found = read_mapping(path)
    known = column_names(joint_names)
    unknown = next((name for name in found.columns if name not in known), None)
    if unknown is not None:
        others = ", ".join(
            sorted(name for name in known if not name.startswith(tuple(joint_names)))
        )
        raise InputError(
            f"{path}: {unknown[:40]!r} is no column of a trace: known are {others}, and "
            f"{', '.join(joint_names)}, also with {VELOCITY}, {ACCELERATION} and {EFFORT}"
        )
    return found


def _check_speeds(source: str, motion: JointTrajectory) -> None:
    """InputError where rows (N, n) that lie near each other have speeds that their positions
    contradict.
    """
    q = motion.positions
    qd = motion.velocities
    qdd = motion.accelerations
    assert qd is not None and qdd is not None  # noqa: PT018 - both were given
    steps = np.diff(motion.times)[:, None]
    if len(q) < _ROWS_COMPARED or np.median(steps) > _NEAR:
        return
    said = 0.5 * steps * (qd[1:] + qd[:-1]) + steps**2 / 12.0 * (qdd[:-1] - qdd[1:])
    moved = np.diff(q, axis=0)
    apart = np.abs(said - moved).sum(axis=0)
    path = np.abs(moved).sum(axis=0)
    j = int(np.argmax(apart - _APART * path))
    if apart[j] > _APART * path[j] + _SAME_PLACE:
        raise InputError(
            f"{source}: {motion.joint_names[j]} moves by {path[j]:.4g} rad in all, by its speeds "
            f"it is {np.abs(said[:, j]).sum():.4g} rad: which is right? Without columns of speed "
            "or acceleration the positions alone count"
        )


def _without_holes(
    trace: Trace, times: FloatArray, positions: FloatArray, joint_names: Sequence[str]
) -> Rows:
    """The rows that have the positions of all joints. InputError for a gap in which the robot
    moved.
    """
    source = trace.source
    known = np.isfinite(positions)
    empty = np.flatnonzero(~known.any(axis=0))
    if len(empty):
        raise InputError(f"{source}: the column of {joint_names[int(empty[0])]} is empty")
    whole = known.all(axis=1)
    times = times[whole]
    positions = positions[whole]
    if len(times) < 2:
        raise InputError(f"{source}: {len(times)} rows have the positions of all joints")
    notes = _bridged(source, times, positions)
    return Rows(times - times[0], positions, (*trace.problems, *notes))


def _bridged(source: str, times: FloatArray, positions: FloatArray) -> tuple[str, ...]:
    """What is said of rows that come late. InputError for a gap in which the robot moved, unless
    the rows around it say how: it is short, and their speeds cover the way.
    """
    steps = np.diff(times)
    moved = np.abs(np.diff(positions, axis=0)).max(axis=1)
    gaps = np.flatnonzero((steps > GAP_FACTOR * np.median(steps)) & (moved > _SAME_PLACE))
    left = [k for k in gaps if not _is_bridged(times, positions, int(k))]
    if left:
        k = int(left[0])
        raise InputError(
            f"{source}: between {times[k]:.3f} s and {times[k + 1]:.3f} s there are no rows, and "
            f"the robot moved by {moved[k]:.3f} rad: nobody knows how"
        )
    if not len(gaps):
        return ()
    k = int(gaps[np.argmax(steps[gaps])])
    return (
        f"{len(gaps)} rows come late, the latest {1e3 * steps[k]:.3g} ms after the one before at "
        f"{times[k]:.3f} s: the speeds around them cover the way within {_SAME_PLACE:g} rad",
    )


def _is_bridged(times: FloatArray, positions: FloatArray, k: int) -> bool:
    """Whether the speeds before and after rows k, k + 1 explain the way between them."""
    begin = times[k]
    end = times[k + 1]
    gap = end - begin
    before = int(np.searchsorted(times, begin - _NEAR))
    after = int(np.searchsorted(times, end + _NEAR, side="right")) - 1
    if gap > _NEAR or before == k or after == k + 1:
        return False
    arriving = (positions[k] - positions[before]) / (begin - times[before])
    leaving = (positions[after] - positions[k + 1]) / (times[after] - end)
    # speeds in the middles of their spans, carried on to the middle of the gap
    spans = 0.5 * np.array([begin - times[before] + gap, times[after] - end + gap])
    speed = (arriving * spans[1] + leaving * spans[0]) / spans.sum()
    way = positions[k + 1] - positions[k]
    return bool(np.abs(way - speed * gap).max() <= _SAME_PLACE)


# The robot's limits. A wrong unit, a missing row in the middle of a movement or a log of another
# robot would otherwise be a movement of absurd energy, and the planner's would save 99 % of it.

_TURN = 2.0 * np.pi
# times its speed limit: no encoder's noise or clock's jitter at the rate of a log does this
_FASTER = 3.0
_NOISE = 0.002  # rad: coarser than any log is rounded
# rad outside of its range that a joint may be: what is more was never measured there
_BEYOND = np.pi


def counted_turns(
    source: str, time: FloatArray, positions: FloatArray, robot: RobotModel
) -> tuple[FloatArray, tuple[str, ...]]:
    """Positions (N, n) [rad] without jumps by whole turns, which logs make that are written within
    half a turn, and a sentence for each joint that had some.

    InputError where a joint moves faster between two rows than it can, or is far outside of its
    range.
    """
    turns = np.round(np.diff(positions, axis=0) / _TURN)
    unwrapped = positions.copy()
    unwrapped[1:] -= _TURN * np.cumsum(turns, axis=0)
    _check_speeds_rows_of_robot(source, time, unwrapped, robot)
    notes = []
    for j in np.flatnonzero(turns.any(axis=0)):
        unwrapped[:, j] += _shift(unwrapped[:, j], robot.position_min[j], robot.position_max[j])
        notes.append(f"{robot.joint_names[j]} jumps by whole turns in the file: taken as going on")
    check_ranges(source, unwrapped, robot)
    return unwrapped, tuple(notes)


def check_ranges(source: str, positions: FloatArray, robot: RobotModel) -> None:
    """InputError where a position (N, n) [rad] is farther outside of a joint's range than half a
    turn.
    """
    beyond = np.maximum(robot.position_min - positions, positions - robot.position_max)
    row, j = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if beyond[row, j] > _BEYOND:
        low, high = np.degrees((robot.position_min[j], robot.position_max[j]))
        raise InputError(
            f"{source}: {robot.joint_names[j]} is at {np.degrees(positions[row, j]):.0f} deg, "
            f"its range is {low:.0f} to {high:.0f} deg: are its unit and the robot right? Values "
            "without a unit are rad"
        )


def _check_speeds_rows_of_robot(
    source: str, time: FloatArray, positions: FloatArray, robot: RobotModel
) -> None:
    steps = np.diff(time)
    steps = np.maximum(steps, np.median(steps))
    moved = np.abs(np.diff(positions, axis=0))
    share = (moved - _NOISE) / (steps[:, None] * robot.velocity_max)
    row, j = np.unravel_index(int(np.argmax(share)), share.shape)
    if share[row, j] > _FASTER:
        raise InputError(
            f"{source}: {robot.joint_names[j]} moves by {np.degrees(moved[row, j]):.3g} deg "
            f"between {time[row]:.3f} s and {time[row + 1]:.3f} s, {share[row, j]:.0f} times as "
            "fast as it can: are the units, the rows and the robot right? Values without a unit "
            "are rad and s"
        )


def _shift(values: FloatArray, low: float, high: float) -> float:
    """Whole turns [rad] that bring values (N,) into low .. high; 0 where they are there, or none
    do.
    """
    for turns in (0, -1, 1):
        if low <= values.min() + _TURN * turns and values.max() + _TURN * turns <= high:
            return _TURN * turns
    return 0.0


def add_measured(parser: argparse.ArgumentParser) -> None:
    """--mapping, --bandwidth and --between."""
    words = "what the columns of a trace are (.yaml), where their headings don't say it"
    parser.add_argument("--mapping", type=Path, metavar="FILE", help=words)
    words = "at which positions alone are smoothed; 0: what leaves least open of the energy (0)"
    parser.add_argument("--bandwidth", type=float, default=0.0, metavar="HZ", help=words)
    words = "only these seconds of a trace, from its first row: one cycle of a long file"
    parser.add_argument("--between", type=float, nargs=2, metavar=("FROM", "TO"), help=words)


def motion_of(
    arguments: argparse.Namespace, planner: Planner, progress: Progress, path: Path | None = None
) -> tuple[MeasuredMotion | None, JointTrajectory]:
    """The motion of a trace, and what is known of it where it was smoothed."""
    robot = planner.cell.robot
    file = path or arguments.trace
    progress(f"read {file.name}", 0, 1, 0.0)
    found = read_motion(file, robot.joint_names, arguments.mapping)
    if arguments.between is not None:
        found = between(file, found, *arguments.between)
    if isinstance(found, JointTrajectory):
        check_ranges(str(file), found.positions, robot)
        return None, found
    positions, turned = counted_turns(str(file), found.time, found.positions, robot)
    scene = planner.scene(arguments.load)
    known = measured(
        robot.joint_names,
        found.time,
        positions,
        lambda one: movement_energy(one, scene).total,
        arguments.bandwidth,
        progress,
    )
    return replace(known, notes=(*found.notes, *turned)), known.trajectory


def between(file: Path, found: JointTrajectory | Rows, begin: float, end: float) -> Rows:
    """The rows from `begin` to `end` [s]. InputError where that makes no sense."""
    if isinstance(found, JointTrajectory) or file.suffix.lower() in RECORDED:
        raise InputError(f"{file}: --between is of measured positions in a CSV or Parquet file")
    inside = (found.time >= begin) & (found.time <= end)
    if np.count_nonzero(inside) < 2:
        raise InputError(
            f"--between {begin:g} {end:g} holds no two rows of {file}, which lasts "
            f"{found.time[-1]:g} s"
        )
    time = found.time[inside]
    return Rows(time - time[0], found.positions[inside], found.notes)


def measured_figures(known: MeasuredMotion | None) -> Row:
    """The same for other programs."""
    if known is None:
        return {}
    return {
        "bandwidth_hz": known.bandwidth,
        "positions_hz": known.rate,
        "positions_noise_rad": known.noise,
        "noise_joules": known.noise_joules,
        "joules_bound": known.bound,
        "notes": list(known.notes),
    }
