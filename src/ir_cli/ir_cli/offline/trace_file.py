"""Trajectories as CSV: time in s, then joints in rad by name; speeds and accelerations may follow.

Columns: `time`, one per joint (`joint_a1`, or `joint_a1_deg` in degrees), then `joint_a1_velocity`
[rad/s] and `joint_a1_acceleration` [rad/s^2]. Where only positions are given, as in a measured
trace, they are smoothed (`measured`). Read by `ir_recorder.traces`, which also takes Parquet and
recordings, other units in the headings, and other headings by a mapping file.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import MsgsError
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.errors import RecorderError
from ir_recorder.traces import Trace, TraceMapping, column_names, read_mapping, read_traces
from ir_recorder.traces.trace import ACCELERATION, EFFORT, GAP_FACTOR, VELOCITY

from ..errors import InputError
from .measured import BANDWIDTHS, smoothed

ENDINGS = ("", VELOCITY, ACCELERATION)
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
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([repr(value) for value in row] for row in rows.tolist())


def write_readings(path: Path, trace: Trace) -> None:
    """Write all columns of a measured trace; `ir_recorder.traces` reads them back."""
    path.parent.mkdir(parents=True, exist_ok=True)
    numbers = zip(
        trace.time.tolist(), *(values.tolist() for values in trace.columns.values()), strict=True
    )
    with path.open("w", encoding="utf-8", newline="") as file:
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
    if accelerations is None or mapping is not None or path.suffix.lower() == ".mcap":
        return _without_holes(trace, times, positions, joint_names)
    try:
        found = JointTrajectory.from_seconds(
            joint_names, times, positions, velocities, accelerations
        )
    except MsgsError as error:
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
    steps = np.diff(times)
    moved = np.abs(np.diff(positions, axis=0)).max(axis=1)
    lost = np.flatnonzero((steps > GAP_FACTOR * np.median(steps)) & (moved > _SAME_PLACE))
    if len(lost):
        k = int(lost[0])
        raise InputError(
            f"{source}: between {times[k]:.3f} s and {times[k + 1]:.3f} s there are no rows, and "
            f"the robot moved by {moved[k]:.3f} rad: nobody knows how"
        )
    return Rows(times - times[0], positions, trace.problems)
