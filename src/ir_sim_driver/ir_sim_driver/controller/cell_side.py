"""What the node hears of the cell's signals, and publishes of its machines and of contacts."""

from __future__ import annotations

from ir_msgs_py.contact import Contact, MachineState
from ir_sim_driver.controller.access import Access


class CellSide:
    """Of the simulation behind `access`."""

    def __init__(self, access: Access) -> None:
        self._access = access

    def hear_signal(self, name: str, level: bool) -> None:
        """Take the level of a signal of the machines."""
        with self._access.reading() as simulation:
            simulation.cell_watch.hear(name, level)

    @property
    def version(self) -> int:
        """Grows with every change of a machine's state and every contact."""
        return self._access.simulation.cell_watch.version

    def machine_states(self) -> tuple[MachineState, ...]:
        """The states of the machines."""
        with self._access.reading() as simulation:
            return simulation.cell_watch.states()

    def take_contacts(self) -> tuple[Contact, ...]:
        """Contacts since the last call."""
        with self._access.reading() as simulation:
            return simulation.cell_watch.take_contacts()
