"""Bodies of machines over a recording: doors are where their states have them, and while one
changes what it sweeps is drawn as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ir_description import Body, Cell, Equipment, machine_in
from ir_recorder.read.recording import TextEvent
from ir_recorder.report.cell_scene import body_shape
from ir_recorder.report.series import Json

ALWAYS = -1e9  # s: what is heard first was so before


def door_bodies(cell: Cell, events: Sequence[TextEvent]) -> list[dict[str, Json]]:
    """All bodies of the cell; those of machines whose states are in `events` ("shut>open" while
    they change) with `shown`: from which time [s] on they are there or not; `sweep`: it is what a
    door sweeps.
    """
    shapes = []
    for machine in cell.equipment:
        heard = [event for event in events if event.name == machine.name]
        for body, changes in _over_time(machine, list(_standing(machine, heard))):
            shape = body_shape(body, machine.name)
            if shape is not None:
                sweep = body.name not in {own.name for own in machine.bodies}
                shapes.append({**shape, "shown": changes, "sweep": sweep})
    return shapes


def _standing(machine: Equipment, heard: Sequence[TextEvent]) -> Iterator[tuple[float, Equipment]]:
    """The machine from the beginning, and whenever another of its states was heard."""
    known = {state.name for state in machine.states}
    last = ""
    for event in heard:
        states = event.text.split(">")
        if event.text != last and known.issuperset(states) and len(states) <= 2:
            yield (event.time if last else ALWAYS), machine_in(machine, states)
            last = event.text
    if not last:
        yield ALWAYS, machine


def _over_time(
    machine: Equipment, standing: Sequence[tuple[float, Equipment]]
) -> Iterator[tuple[Body, list[Json]]]:
    """Every body that is ever there, with the times at which it comes or goes."""
    present = [(time, {body.name: body for body in now.world_bodies()}) for time, now in standing]
    bodies = {name: body for _, there in present for name, body in there.items()}
    for name, body in bodies.items():
        changes: list[Json] = []
        before: bool | None = None
        for time, now in present:
            there = name in now
            if there != before:
                changes.append([round(time, 3), there])
            before = there
        yield body, changes
