"""A cell's content hash: of all that a plan depends on, and of nothing else."""

import hashlib
from dataclasses import replace

from ir_description.cell import Cell
from ir_description.files.cell_writer import cell_to_yaml

_LENGTH = 16  # hexadecimal digits, as ids of trajectories have


def cell_hash(cell: Cell) -> str:
    """Hash of bodies, poses, states, zones, stations, loads and robot; its program and its texts don't count.

    The file of a cell, written and read again, has the same hash.
    """
    place = replace(cell, description="", program=(), signals=(), tasks=())
    content = f"{cell_to_yaml(place)}\n{cell.robot!r}"
    return hashlib.sha256(content.encode()).hexdigest()[:_LENGTH]
