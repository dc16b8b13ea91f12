"""A machine while it changes its state: an opening door counts as all that it sweeps.

The bodies that only the one state has are taken for those that only the other has, in their order;
each pair becomes the convex hull of both, around the boxes that enclose them. What has no partner
is there in full.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from ir_description.cell.cell import Cell
from ir_description.cell.equipment import Equipment, EquipmentState
from ir_description.poses import transformed
from ir_description.shapes import Body
from ir_values.arrays import FloatArray

_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def cell_in(cell: Cell, states: Mapping[str, Sequence[str]]) -> Cell:
    """The cell with these machines in their states, by name; two: while they change between
    them.
    """
    machines = (
        machine_in(machine, states[machine.name]) if machine.name in states else machine
        for machine in cell.equipment
    )
    return replace(cell, equipment=tuple(machines))


def machine_in(machine: Equipment, states: Sequence[str]) -> Equipment:
    """The machine in a state, or, where two are given, in a further one: while it changes between
    them.
    """
    if len(states) == 1:
        return replace(machine, state=states[0])
    first, second = states
    swept = tuple(hull for *_, hull in _sweeps(machine, first, second))
    before, after = (_only(machine, state) for state in (first, second))
    names = (
        *before,
        *(name for name in after if name not in before),
        *(body.name for body in swept),
    )
    state = EquipmentState(f"{first}>{second}", names)
    return replace(
        machine, bodies=(*machine.bodies, *swept), states=(*machine.states, state), state=state.name
    )


def sweep_speeds(machine: Equipment, first: str, second: str) -> Mapping[str, float]:
    """Bound [m/s] of how fast each body that changes moves, by its name; none without a time."""
    seconds = 0.0 if machine.switch is None else machine.switch.time
    found: dict[str, float] = {}
    if seconds > 0.0:
        for a, b, hull in _sweeps(machine, first, second):
            far = float(np.linalg.norm(_corners(a) - _corners(b), axis=1).max())
            found |= dict.fromkeys((a.name, b.name, hull.name), far / seconds)
    return found


def _sweeps(machine: Equipment, first: str, second: str) -> Iterator[tuple[Body, Body, Body]]:
    """Pairs of bodies that are one in two places, and the hull of each pair."""
    bodies = {body.name: body for body in machine.bodies}
    before = _only(machine, first)
    after = _only(machine, second)
    going = [bodies[name] for name in before if name not in after]
    coming = [bodies[name] for name in after if name not in before]
    for a, b in zip(going, coming, strict=False):
        if "plane" not in (a.kind, b.kind):
            corners = np.concatenate((_corners(a), _corners(b)))
            yield a, b, Body(f"{a.name}_to_{b.name}", "mesh", np.eye(4), np.zeros(3), corners)


def _only(machine: Equipment, state: str) -> tuple[str, ...]:
    """Names of the bodies that a state adds."""
    return next(each.bodies for each in machine.states if each.name == state)


def _corners(body: Body) -> FloatArray:
    """Corners (8, 3) of a box around a body, in the machine's frame and always in the same
    order.
    """
    low, high = replace(body, pose=np.eye(4)).bounds()
    corners: FloatArray = transformed(body.pose, (low + high) / 2.0 + _CORNERS * (high - low) / 2.0)
    return corners
