"""A fleet as columns of numbers, for CSV, Parquet and pandas: SI units, joules of a cycle."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ir_msgs_py.file_roots import ANYWHERE, FileRoots
from ir_recorder.report.fleet.members import Member
from ir_recorder.report.step_table import Cell, write_columns

START = b"robot,"


def fleet_columns(members: Sequence[Member]) -> dict[str, list[Cell]]:
    """A row for every cycle, mode, movement and measure of every recording."""
    rows: list[tuple[Cell, ...]] = []
    for member in members:
        whose = (member.robot, member.file, member.origin)
        rows.append((*whose, "cycle", "", member.seconds, member.joules))
        for what, shares in (("mode", member.modes), ("movement", member.movements)):
            rows += [
                (*whose, what, name, share.seconds, share.energy) for name, share in shares.items()
            ]
        rows += [
            (*whose, "measure", name, float("nan"), joules)
            for name, joules in member.measures.items()
        ]
    names = ("robot", "recording", "origin", "what", "name", "seconds_s", "energy_j")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def write_fleet_table(
    members: Sequence[Member], path: str | Path, roots: FileRoots = ANYWHERE
) -> Path:
    """Writes the rows as .csv or .parquet below `roots`; RecorderError for another ending."""
    return write_columns(fleet_columns(members), path, START, roots)
