"""Which states the machines with a switch are in along a program, as its own signals move them.

They begin as the cell has them, or as a driver says that they are. A machine whose signal is set
changes
from then on, until a step waits for the signal that follows, or dwells as long as the change takes:
meanwhile it is in both states, and what sweeps between them is there too. Movements are planned
among what may be there.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from ir_description import Cell, Equipment, ProgramStep
from ir_msgs_py.status import Status
from ir_planner.scene import PlanningScene

Doors = tuple[tuple[str, tuple[str, ...]], ...]
"""Machines that are not as the cell has them, with their state, or the two between which they
change.
"""


def doors_along(
    cell: Cell, steps: Sequence[ProgramStep], begin: Doors = ()
) -> Iterator[tuple[Doors, Doors]]:
    """Before each step moves, and after it. begin: machines that are not as the cell has them
    now.
    """
    states: dict[str, tuple[str, ...]] = {
        machine.name: (machine.state,) for machine in _switched(cell)
    }
    states |= {name: now for name, now in begin if name in states}
    for step in steps:
        for machine in _switched(cell):
            states[machine.name] = _awaited(cell, machine, step, states[machine.name])
        before = _unlike(cell, states)
        for machine in _switched(cell):
            states[machine.name] = _set(machine, step, states[machine.name])
        yield before, _unlike(cell, states)


def doors_text(doors: Doors) -> str:
    """How they stand at the start of a program or a movement, "" where all are as the cell has
    them.
    """
    said = (f"{name} {' changing to '.join(states)}" for name, states in doors)
    return f"at the start, as the driver says: {', '.join(said)}" if doors else ""


def with_doors(status: Status, scene: PlanningScene) -> Status:
    """The status of what was not found or is not free, and doors that are not as the cell has
    them.
    """
    said = doors_advice(scene.cell, "", scene.doors)
    return replace(status, message="; ".join(filter(None, (status.message, said))))


def doors_advice(cell: Cell, target: str, doors: Doors) -> str:
    """What a movement to `target` ("": the one that was asked for) that was not found may want, ""
    where all is as the cell has it.
    """
    return "; ".join(
        _of_machine(cell, cell.machine(name), target, states) for name, states in doors
    )


def _switched(cell: Cell) -> list[Equipment]:
    return [machine for machine in cell.equipment if machine.switch is not None and machine.enabled]


def _answers(cell: Cell, machine: Equipment) -> list[str]:
    """Signals that say where the machine is: they follow its switch, no sooner than it is there."""
    assert machine.switch is not None
    signal = machine.switch.signal
    time = machine.switch.time
    own = [signal] if time == 0.0 else []
    return [
        *own,
        *(each.name for each in cell.signals if each.follows == signal and each.delay >= time),
    ]


def _awaited(
    cell: Cell, machine: Equipment, step: ProgramStep, states: tuple[str, ...]
) -> tuple[str, ...]:
    assert machine.switch is not None
    for signal in step.wait_for:
        if signal.name in _answers(cell, machine):
            states = (machine.switch.on if signal.value else machine.switch.off,)
    return states


def _set(machine: Equipment, step: ProgramStep, states: tuple[str, ...]) -> tuple[str, ...]:
    switch = machine.switch
    assert switch is not None
    for signal in step.set_signals:
        target = switch.on if signal.value else switch.off
        if signal.name == switch.signal and states[-1] != target:
            states = (states[-1], target)
    return states[-1:] if step.dwell >= switch.time else states


def _unlike(cell: Cell, states: Mapping[str, tuple[str, ...]]) -> Doors:
    return tuple((name, now) for name, now in states.items() if now != (cell.machine(name).state,))


def _of_machine(cell: Cell, machine: Equipment, target: str, states: tuple[str, ...]) -> str:
    switch = machine.switch
    assert switch is not None
    there = f"when {target} is next, {machine.name}" if target else machine.name
    if len(states) == 1:
        level = "" if states[0] == switch.off else "=0"
        return (
            f"{there} is {states[0]}, as signal {switch.signal} has it; "
            f"{switch.signal}{level} turns it"
        )
    level = "" if states[1] == switch.on else "=0"
    wait = "".join(f"wait for signal {name}{level}, or " for name in _answers(cell, machine)[:1])
    return f"{there} changes from {states[0]} to {states[1]}: {wait}dwell {switch.time:g} s before"
