"""Access of other threads to a running simulation: one lock, and only while it is stepped."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from ir_msgs_py.announcements import Contact, MachineState
from ir_msgs_py.plc import OperatingMode, PlcInputs
from ir_msgs_py.status import StatusCode
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.notices import Level
from ir_sim_driver.plc import Readout, Written


class Access:
    """Hands out `simulation`; wake_hint: what wakes the controller, for sentences.

    failure: why the simulation is not stepped any more, "" while it is. simulation: for single
    values that are read without the lock.
    """

    def __init__(self, simulation: Simulation, wake_hint: str) -> None:
        self.simulation = simulation
        self._wake_hint = wake_hint
        self.lock = threading.Lock()
        self.failure = ""

    @contextmanager
    def reading(self) -> Iterator[Simulation]:
        """To read, or to set what counts from the next step on."""
        with self.lock:
            yield self.simulation

    @contextmanager
    def alive(self) -> Iterator[Simulation]:
        """To ask for something. Raises RequestRefusedError when nobody steps the simulation any
        more.
        """
        with self.lock:
            if self.failure:
                raise RequestRefusedError(StatusCode.FAILURE, self.failure)
            yield self.simulation

    @contextmanager
    def online(self, *, asleep_too: bool = False) -> Iterator[Simulation]:
        """To ask the controller for something. Raises also while it is off the network."""
        with self.alive() as simulation:
            if not (asleep_too or simulation.on_the_network):
                raise RequestRefusedError(
                    StatusCode.INVALID_ROBOT_STATE,
                    f"the controller is off the network ({simulation.modes.mode.name}): "
                    f"only {self._wake_hint} wakes it",
                )
            yield simulation

    @contextmanager
    def writing(self) -> Iterator[Simulation]:
        """To write PLC inputs: what is refused becomes a notice, a pressed emergency stop acts at
        once.
        """
        with self.alive() as simulation:
            try:
                yield simulation
            except RequestRefusedError as error:
                simulation.notices.add(Level.WARN, str(error))
                raise
            finally:
                simulation.heed_stop()


# Machines and contacts, for the node.


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


# `plc.Controller` on a running simulation.

# s; the mean power that a PLC reads is over at least one period of power_state
_POWER_WINDOW = 0.01
_ALIVE_STEPS = 100  # a PLC that polls at 10 Hz or slower sees every change of the alive counter


class PlcSide:
    """Implements plc.Controller on `access`."""

    def __init__(self, access: Access) -> None:
        self._access = access
        self._power = (0.0, 0.0, 0.0)  # mean W, and energy [J] and time [s] of its last reading

    def readout(self) -> Readout | None:
        """Present outputs; None while the controller is off the network."""
        with self._access.reading() as simulation:
            if not simulation.on_the_network:
                return None
            simulation.mains.settle()
            reading = simulation.mains.meter.reading()
            modes = simulation.modes
            power, energy, time = self._power
            if reading.time - time >= _POWER_WINDOW:
                power = (reading.energy - energy) / (reading.time - time)
                self._power = (power, reading.energy, reading.time)
            return Readout(
                simulation.outputs(),
                modes.mode,
                modes.target,
                modes.time_to_target,
                modes.time_to_ready(),
                power,
                reading.energy,
                simulation.steps // _ALIVE_STEPS,
            )

    def inputs(self) -> PlcInputs:
        """Levels of the PLC inputs as they were written last."""
        with self._access.reading() as simulation:
            return simulation.plc.raw

    def write_inputs(self, writer: str, levels: Mapping[str, bool], came_ns: int = 0) -> None:
        """Set these levels, the others stay. Raises RequestRefusedError."""
        with self._access.writing() as simulation:
            simulation.plc.write(writer, levels, came_ns=came_ns)

    def write_all_inputs(self, writer: str, *inputs: PlcInputs) -> None:
        """Set all levels at once, several times in a row. Raises RequestRefusedError when all are
        written.
        """
        self.write_heard(writer, [Written(levels) for levels in inputs])

    def write_heard(self, writer: str, heard: Sequence[Written]) -> None:
        """As `write_all_inputs`, with what is known of when they were written."""
        refusal: RequestRefusedError | None = None
        with self._access.writing() as simulation:
            for written in heard:
                try:
                    simulation.plc.write_all(writer, written)
                except RequestRefusedError as error:
                    refusal = error
            if refusal is not None:
                raise refusal

    def write_mode_and_pause(
        self, writer: str, mode: OperatingMode | None, pause: float | None
    ) -> None:
        """Turn the mode switch and start or end a pause, both or neither. Raises
        RequestRefusedError.
        """
        with self._access.writing() as simulation:
            plc = simulation.plc
            before = simulation.plc.operating_mode
            if mode is not None:
                plc.turn_switch(writer, mode)
            try:
                if pause == 0.0:
                    simulation.control.end_pause()
                elif pause is not None:
                    simulation.pauses.start(pause, simulation.executor.active)
            except RequestRefusedError:
                plc.set_operating_mode(before)  # no step has seen the other one
                raise

    def heartbeat(self, timeout: float) -> None:
        """The PLC is alive; from the first one on it is watched, `timeout` [s] in plant time."""
        with self._access.reading() as simulation:
            simulation.watch.beat(simulation.time, timeout)

    def wake(self) -> None:
        """Wake the controller from hibernation; does nothing otherwise."""
        with self._access.reading() as simulation:
            simulation.wake()
