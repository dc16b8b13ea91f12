"""Trajectories as CSV: time in s, then joints in rad by name; speeds and accelerations may follow.

Columns: `time`, one per joint (`joint_a1`, or `joint_a1_deg` in degrees), then `joint_a1_velocity` [rad/s]
and `joint_a1_acceleration` [rad/s^2]. Where only positions are given, as in a measured trace, both
follow from a cubic spline through them that is at rest at its ends.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ir_description.files import read_regular_file
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory

from ..errors import InputError

BYTES_MAX = 50_000_000
ENDINGS = ("", "_velocity", "_acceleration")


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


def read_trace(path: Path, joint_names: Sequence[str]) -> JointTrajectory:
    """The trajectory of a CSV file. Raises InputError with the line and the column that is wrong."""
    try:
        content = read_regular_file(path, BYTES_MAX)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error
    lines = list(csv.reader(content.decode("utf-8", "replace").splitlines()))
    if len(lines) < 3:
        raise InputError(f"{path}: has {max(len(lines) - 1, 0)} points, a trajectory has at least 2")
    columns = _columns(path, lines)
    if "time" not in columns:
        raise InputError(f"{path}:1: there is no column time, there is: {', '.join(columns)[:200]}")
    positions = _joints(path, columns, joint_names, "")
    assert positions is not None  # _joints refuses missing positions
    velocities = _joints(path, columns, joint_names, ENDINGS[1])
    accelerations = _joints(path, columns, joint_names, ENDINGS[2]) if velocities is not None else None
    times = columns["time"]
    if (np.diff(times) <= 0.0).any():
        line = int(np.argmax(np.diff(times) <= 0.0)) + 3
        raise InputError(f"{path}:{line}: time is {times[line - 2]:g} s, it must increase")
    if velocities is None:
        velocities, accelerations = _smooth(times, positions)
    return JointTrajectory.from_seconds(joint_names, times, positions, velocities, accelerations)


def _columns(path: Path, lines: Sequence[Sequence[str]]) -> Mapping[str, FloatArray]:
    header = [name.strip() for name in lines[0]]
    values = np.empty((len(lines) - 1, len(header)))
    for k, line in enumerate(lines[1:]):
        if len(line) != len(header):
            raise InputError(
                f"{path}:{k + 2}: has {len(line)} values, the header names {len(header)} columns"
            )
        for j, text in enumerate(line):
            try:
                values[k, j] = float(text)
            except ValueError:
                raise InputError(
                    f"{path}:{k + 2}: {header[j]} is {text[:40]!a}, it must be a number"
                ) from None
    return dict(zip(header, values.T, strict=True))


def _joints(
    path: Path, columns: Mapping[str, FloatArray], names: Sequence[str], ending: str
) -> FloatArray | None:
    """Values (N, n) of all joints; None where no joint has such a column and it may be missing."""
    found, missing = [], []
    for name in names:
        if f"{name}{ending}" in columns:
            found.append(columns[f"{name}{ending}"])
        elif not ending and f"{name}_deg" in columns:
            found.append(np.radians(columns[f"{name}_deg"]))
        else:
            missing.append(f"{name}{ending}")
    if missing and (found or not ending):
        raise InputError(f"{path}:1: there is no column {missing[0]}, there is: {', '.join(columns)[:200]}")
    return np.column_stack(found) if found else None


def _smooth(times: FloatArray, positions: FloatArray) -> tuple[FloatArray, FloatArray]:
    from scipy.interpolate import CubicSpline

    spline = CubicSpline(times, positions, bc_type="clamped")
    return spline(times, 1), spline(times, 2)
