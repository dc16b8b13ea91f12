"""Trajectories as CSV: time in s, then joints in rad by name; speeds and accelerations may follow.

Columns: `time`, one per joint (`joint_a1`, or `joint_a1_deg` in degrees), then `joint_a1_velocity` [rad/s]
and `joint_a1_acceleration` [rad/s^2]. Where only positions are given, as in a measured trace, both
follow from a cubic spline through them that is at rest at its ends. Read by `ir_recorder.traces`, which also
takes Parquet and recordings, and other units in the headings.
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.errors import MsgsError
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.errors import RecorderError
from ir_recorder.traces import Trace, read_traces
from ir_recorder.traces.trace import ACCELERATION, VELOCITY

from ..errors import InputError

ENDINGS = ("", VELOCITY, ACCELERATION)
DAY = 86400.0  # s


def write_trace(path: Path, trajectory: JointTrajectory) -> None:
    """Write points with speeds and accelerations; `read_trace` gives the same trajectory back."""
    names = trajectory.joint_names
    kinds = [trajectory.positions, trajectory.velocities, trajectory.accelerations]
    given = [(ending, each) for ending, each in zip(ENDINGS, kinds, strict=True) if each is not None]
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
    numbers = zip(trace.time.tolist(), *(values.tolist() for values in trace.columns.values()), strict=True)
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(f"# {trace.source}\n")
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time", *trace.columns, *trace.texts])
        for row, words in zip(numbers, zip(*trace.texts.values(), strict=True), strict=True):
            writer.writerow([*(f"{value:.9g}" for value in row), *words])


def read_trace(path: Path, joint_names: Sequence[str]) -> JointTrajectory:
    """The trajectory of a trace (CSV, Parquet, a recording). InputError with the line and the column that is
    wrong.
    """
    try:
        trace = read_traces(path, joint_names=joint_names)[0]
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
    if velocities is None:
        velocities, accelerations = _smooth(times, positions)
    try:
        return JointTrajectory.from_seconds(joint_names, times, positions, velocities, accelerations)
    except MsgsError as error:
        raise InputError(f"{trace.source}: {error}") from error


def _smooth(times: FloatArray, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, positions, bc_type="clamped")
    return spline(times, 1), spline(times, 2)
