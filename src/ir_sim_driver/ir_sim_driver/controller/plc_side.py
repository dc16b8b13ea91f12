"""What the PLC may do: `plc.Controller` on a running simulation, and all levels at once for the
topic.
"""

from __future__ import annotations

from collections.abc import Mapping

from ir_msgs_py.plc import OperatingMode, PlcInputs
from ir_sim_driver.controller.access import Access
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plc import Readout

_POWER_WINDOW = (
    0.01  # s; the mean power that a PLC reads is over at least one period of power_state
)
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

    def write_inputs(self, writer: str, levels: Mapping[str, bool]) -> None:
        """Set these levels, the others stay. Raises RequestRefusedError."""
        with self._access.writing() as simulation:
            simulation.plc.write(writer, levels)

    def write_all_inputs(self, writer: str, *inputs: PlcInputs) -> None:
        """Set all levels at once, several times in a row. Raises RequestRefusedError when all are
        written.
        """
        refusal: RequestRefusedError | None = None
        with self._access.writing() as simulation:
            for levels in inputs:
                try:
                    simulation.plc.write_all(writer, levels)
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
                    simulation.pauses.end()
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
