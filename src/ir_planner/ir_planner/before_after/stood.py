"""How the doors stood when today's program began: as a recording says, or else as the cell has
them, which is said.
"""

from ir_description import Cell
from ir_planner.before_after.asked import AskedProgram
from ir_planner.before_after.today import Today
from ir_planner.program import Doors


def doors_at_the_start(
    today: Today, asked: AskedProgram, cell: Cell
) -> tuple[Doors, tuple[str, ...]]:
    """Machines that are not as the cell has them where the planner's programs begin, and sentences
    on it.

    Where doors moved meanwhile and no step that is asked for has the signals that move them, the
    planner's programs can't follow: they are planned in the cell's states.
    """
    if today.doors is None:
        return (), assumed_doors(cell)
    recorded = {one.doors for one in today.stretches}
    signals = {machine.switch.signal for machine in cell.equipment if machine.switch is not None}
    moved = {signal.name for step in asked.steps for signal in step.step.set_signals}
    if len(recorded) > 1 and not signals & moved:
        note = (
            "doors moved in the recording, by signals that no stop has: the planner's programs have"
        )
        return (), (
            f"{note} {_states(cell, ())}; today's movements are judged with the doors as recorded",
        )
    return today.doors, ((f"doors at the start as recorded: {_states(cell, today.doors)}"),)


def assumed_doors(cell: Cell) -> tuple[str, ...]:
    """That the cell's states are assumed, where it has machines that a signal switches."""
    return (
        (f"doors at the start are assumed, as the cell has them: {known}",)
        if (known := _states(cell, ()))
        else ()
    )


def _states(cell: Cell, doors: Doors) -> str:
    now = dict(doors)
    switched = [
        machine for machine in cell.equipment if machine.switch is not None and machine.enabled
    ]
    return ", ".join(
        f"{machine.name} {' changing to '.join(now.get(machine.name, (machine.state,)))}"
        for machine in switched
    )
