"""What the commands that take traces share: the mapping of their columns, the bandwidth, and the motion."""

from __future__ import annotations

import argparse
from pathlib import Path

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.checks import movement_energy

from .measured import Measured, measured
from .output import Row
from .trace_file import read_motion


def add_measured(parser: argparse.ArgumentParser) -> None:
    """--mapping and --bandwidth."""
    words = "what the columns of a trace are (.yaml), where their headings don't say it"
    parser.add_argument("--mapping", type=Path, metavar="FILE", help=words)
    words = "at which positions alone are smoothed; 0: what leaves least open of the energy (0)"
    parser.add_argument("--bandwidth", type=float, default=0.0, metavar="HZ", help=words)


def motion_of(
    arguments: argparse.Namespace, planner: Planner, path: Path | None = None
) -> tuple[Measured | None, JointTrajectory]:
    """The motion of a trace, and what is known of it where it was smoothed."""
    names = planner.cell.robot.joint_names
    found = read_motion(path or arguments.trace, names, arguments.mapping)
    if isinstance(found, JointTrajectory):
        return None, found
    scene = planner.scene(arguments.load)
    known = measured(names, *found, lambda one: movement_energy(one, scene).total, arguments.bandwidth)
    return known, known.trajectory


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
    }
