"""What the commands that take traces share: the mapping of their columns, the bandwidth, and the
motion.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.checks import movement_energy
from ir_planner.program import Progress

from ..errors import InputError
from .measured import Measured, measured
from .output import Row
from .rows_of_robot import check_ranges, counted_turns
from .trace_file import Rows, read_motion


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
) -> tuple[Measured | None, JointTrajectory]:
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
    if isinstance(found, JointTrajectory) or file.suffix.lower() == ".mcap":
        raise InputError(f"{file}: --between is of measured positions in a CSV or Parquet file")
    inside = (found.time >= begin) & (found.time <= end)
    if np.count_nonzero(inside) < 2:
        raise InputError(
            f"--between {begin:g} {end:g} holds no two rows of {file}, which lasts "
            f"{found.time[-1]:g} s"
        )
    time = found.time[inside]
    return Rows(time - time[0], found.positions[inside], found.notes)


def measured_figures(known: Measured | None) -> Row:
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
