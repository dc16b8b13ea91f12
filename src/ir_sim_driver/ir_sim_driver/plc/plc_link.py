"""The field bus between PLC and controller: reads and writes of the Modbus server on the running simulation.

Only a PLC that has sent a heartbeat is watched: without one for `watchdog` seconds the link counts as lost.
The movement is stopped along its path, goals are refused, the power mode stays; the next heartbeat ends it.
"""

from __future__ import annotations

from ir_msgs_py.plc import OperatingMode
from ir_msgs_py.status import StatusCode
from ir_sim_driver.controller.driver import Driver
from ir_sim_driver.controller.simulation import Simulation
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.notices import Level
from ir_sim_driver.plc.inputs import MODBUS
from ir_sim_driver.plc.modbus_map import COILS, HEARTBEAT, Readout


class PlcLink:
    """Implements modbus.Link on a driver; watchdog [s] in plant time."""

    def __init__(self, driver: Driver, watchdog: float) -> None:
        self._driver, self._watchdog = driver, watchdog
        self._power = (0.0, 0.0, 0.0)  # mean W, and energy [J] and time [s] of its last reading

    def readout(self) -> Readout | None:
        """Present outputs; None while the controller is off the network."""
        with self._driver.locked() as simulation:
            if not simulation.on_the_network:
                return None
            simulation.settle_meter()
            reading, modes = simulation.meter.reading(), simulation.modes
            power, energy, time = self._power
            if reading.time - time >= 0.01:
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
                simulation.steps // 100,
            )

    def coils(self) -> list[bool]:
        """Levels of the coils as they are now, without the heartbeat."""
        with self._driver.locked() as simulation:
            return [bool(getattr(simulation.plc.raw, name)) for name in COILS[:HEARTBEAT]]

    def write_coil(self, name: str, level: bool) -> None:
        """Set the level of one coil. Raises RequestRefusedError."""
        with self._driver.locked() as simulation:
            _check_owner(simulation, presses_stop=name == "emergency_stop" and level)
            simulation.plc.set_bit(name, level)

    def operating_mode(self) -> int:
        """Position of the mode switch."""
        with self._driver.locked() as simulation:
            return int(simulation.plc.operating_mode)

    def write_operating_mode(self, mode: int) -> None:
        """Turn the mode switch. Raises RequestRefusedError."""
        if not OperatingMode.T1 <= mode <= OperatingMode.EXT:
            raise RequestRefusedError(
                StatusCode.INVALID_GOAL_CONSTRAINTS, f"operating mode is {mode}: it must be in 1 .. 4"
            )
        with self._driver.locked() as simulation:
            _check_owner(simulation)
            simulation.plc.set_operating_mode(OperatingMode(mode))

    def write_pause(self, seconds: int) -> None:
        """Start a pause, or end it with 0. Raises RequestRefusedError."""
        with self._driver.locked() as simulation:
            if seconds == 0:
                simulation.pauses.end()
            else:
                simulation.pauses.start(float(seconds), simulation.executor.active)

    def heartbeat(self) -> None:
        """The PLC is alive; from the first one on it is watched."""
        with self._driver.locked() as simulation:
            simulation.watch.beat(simulation.time, self._watchdog)


def _check_owner(simulation: Simulation, presses_stop: bool = False) -> None:
    refusal = simulation.plc.refusal(MODBUS, presses_stop)
    if refusal:
        simulation.notices.add(Level.WARN, refusal)
        raise RequestRefusedError(StatusCode.INVALID_ROBOT_STATE, refusal)
