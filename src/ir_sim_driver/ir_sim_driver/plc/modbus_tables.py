"""The controller as tables of Modbus: coils and registers act on it, inputs are read from it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

from ir_msgs_py.plc import OperatingMode
from ir_msgs_py.status import StatusCode
from ir_sim_driver.errors import DriverError, ModbusRefusedError, RequestRefusedError
from ir_sim_driver.plc.modbus_map import (
    COILS,
    HEARTBEAT,
    HOLDING_REGISTERS,
    MODBUS,
    OPERATING_MODE,
    PAUSE,
    discrete_inputs,
    input_registers,
)
from ir_sim_driver.plc.modbus_pdu import ExceptionCode
from ir_sim_driver.plc.port import STOP_BIT, Controller, Readout

T = TypeVar("T")


class ControllerTables:
    """Implements modbus_pdu.Tables on `controller`; watchdog [s]: longest time between
    heartbeats.
    """

    def __init__(self, controller: Controller, watchdog: float) -> None:
        self._controller = controller
        self._watchdog = watchdog
        self._pause = 0

    def coils(self) -> list[bool]:
        """Levels as they were written last, by whomever; the heartbeat reads 0."""
        self._readout()
        inputs = self._controller.inputs()
        return [*(bool(getattr(inputs, name)) for name in COILS[:HEARTBEAT]), False]

    def discrete_inputs(self) -> list[bool]:
        """The controller's outputs."""
        return discrete_inputs(self._readout())

    def holding_registers(self) -> list[int]:
        """Mode switch and pause."""
        self._readout()
        registers = [0] * HOLDING_REGISTERS
        registers[OPERATING_MODE] = int(self._controller.inputs().operating_mode)
        registers[PAUSE] = self._pause
        return registers

    def input_registers(self) -> list[int]:
        """Mode, times, power and energy."""
        return input_registers(self._readout())

    def write_coils(self, start: int, levels: Sequence[bool]) -> None:
        """Set levels; any write of the heartbeat's coil is a heartbeat."""
        if start + len(levels) > len(COILS):
            raise ModbusRefusedError(ExceptionCode.ADDRESS)
        named = {COILS[k]: level for k, level in enumerate(levels, start=start)}
        if self._controller.readout() is None:
            self._press_asleep(named)
            return
        beats = named.pop(COILS[HEARTBEAT], None) is not None
        if named:
            _asked(lambda: self._controller.write_inputs(MODBUS, named))
        if beats:
            self._controller.heartbeat(self._watchdog)

    def write_registers(self, start: int, values: Sequence[int]) -> None:
        """Turn the mode switch, start or end a pause, or both at once."""
        if start + len(values) > HOLDING_REGISTERS:
            raise ModbusRefusedError(ExceptionCode.ADDRESS)
        self._readout()
        wanted = dict(enumerate(values, start=start))
        position = wanted.get(OPERATING_MODE)
        pause = wanted.get(PAUSE)
        if position is not None and not OperatingMode.T1 <= position <= OperatingMode.EXT:
            raise ModbusRefusedError(ExceptionCode.VALUE)
        mode = None if position is None else OperatingMode(position)
        _asked(lambda: self._controller.write_mode_and_pause(MODBUS, mode, pause))
        self._pause = self._pause if pause is None else pause

    def _press_asleep(self, levels: dict[str, bool]) -> None:
        """Off the network nothing is heard but a pressed emergency stop, which is latched."""
        pressed = levels.get(STOP_BIT, False)
        if pressed:
            _asked(lambda: self._controller.write_inputs(MODBUS, {STOP_BIT: True}))
        if not pressed or len(levels) > 1:
            raise ModbusRefusedError(ExceptionCode.DEVICE_FAILURE)

    def _readout(self) -> Readout:
        readout = self._controller.readout()
        if readout is None:
            raise ModbusRefusedError(ExceptionCode.DEVICE_FAILURE)
        return readout


def _asked(work: Callable[[], T]) -> T:
    """What the controller refuses as an exception code: 04 when the plant is dead, 03 otherwise."""
    try:
        return work()
    except RequestRefusedError as error:
        dead = error.code is StatusCode.FAILURE
        raise ModbusRefusedError(
            ExceptionCode.DEVICE_FAILURE if dead else ExceptionCode.VALUE
        ) from error
    except DriverError as error:
        raise ModbusRefusedError(ExceptionCode.VALUE) from error
