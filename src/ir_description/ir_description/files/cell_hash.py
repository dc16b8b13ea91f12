"""A cell's content hash: of all that a plan depends on, and of nothing else."""

import hashlib
from dataclasses import replace

from ir_description.cell import Cell, Equipment
from ir_description.files.cell_writer import cell_to_yaml

_LENGTH = 16  # hexadecimal digits, as ids of trajectories have


def cell_hash(cell: Cell) -> str:
    """Hash of bodies, poses, states, zones, stations, loads and robot; its program and its texts
    don't count.

    The state of a machine that a signal switches doesn't count either: doors move while a program
    runs, and a movement that relies on a state says so. The file of a cell, written and read again,
    has the same hash.
    """
    machines = tuple(_unswitched(machine) for machine in cell.equipment)
    place = replace(
        cell, description="", equipment=machines, program=(), signals=(), tasks=(), paths=()
    )
    content = f"{cell_to_yaml(place)}\n{cell.robot!r}"
    return hashlib.sha256(content.encode()).hexdigest()[:_LENGTH]


def _unswitched(machine: Equipment) -> Equipment:
    if machine.switch is None:
        return machine
    return replace(machine, state=machine.states[0].name, switch=None)
