"""What a driver publishes about its controller, its load and the machines around it, and what
counts while no driver does.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

from ir_description import Cell, PowerData
from ir_msgs_py.announcements import DATA, DRIVER, CarriedLoad, ControllerTimers, MachineState
from ir_msgs_py.modes import TransitionTimes
from ir_planner.program import Doors


class Heard:
    """timers, load, machines: what the driver says, None while no driver does. settings: asked for
    the transition times where no driver says them.
    """

    def __init__(self, settings: Callable[[], TransitionTimes]) -> None:
        self._settings = settings
        self.timers: ControllerTimers | None = None
        self.load: CarriedLoad | None = None
        self.machines: tuple[MachineState, ...] | None = None

    def of(self, data: PowerData) -> PowerData:
        """A controller's figures as its file has them, with the timer that counts."""
        if self.timers is None or not data.has_table:
            return data
        return replace(data, motors_to_brakes_in_program=self.timers.brakes_after)

    @property
    def transitions(self) -> TransitionTimes:
        """Transition times that count."""
        return self._settings() if self.timers is None else self.timers.transitions

    @property
    def source(self) -> str:
        """Where timer and transition times are from."""
        return DATA if self.timers is None else DRIVER

    def doors(self, cell: Cell) -> Doors:
        """Machines of a cell with a switch that are not as the cell has them, as the driver
        says.
        """
        return tuple(self._doors(cell))

    def _doors(self, cell: Cell) -> Iterator[tuple[str, tuple[str, ...]]]:
        heard = {each.equipment: each for each in self.machines or ()}
        for machine in cell.equipment:
            said = heard.get(machine.name)
            if said is None or machine.switch is None or not machine.enabled:
                continue
            states = (said.state, said.next) if said.next else (said.state,)
            known = {state.name for state in machine.states}
            if known.issuperset(states) and states != (machine.state,):
                yield machine.name, states
