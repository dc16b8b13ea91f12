"""Modbus TCP server of the controller: a PLC sets its bits and reads the outputs.

The server has a thread and an event loop of its own. Modbus exceptions 01 to 03 come from the protocol, 03
also for what the controller refuses; 04 says that the controller is off the network.
"""

from __future__ import annotations

import asyncio
import struct
import threading
from collections.abc import Sequence
from typing import Any

from pymodbus import ModbusDeviceIdentification
from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from ir_msgs_py.plc import OperatingMode
from ir_sim_driver.errors import DriverError
from ir_sim_driver.plc.modbus_map import (
    COILS,
    DISCRETE_INPUTS,
    HEARTBEAT,
    HOLDING_REGISTERS,
    INPUT_REGISTERS,
    MODBUS,
    OPERATING_MODE,
    PAUSE,
    discrete_inputs,
    input_registers,
)
from ir_sim_driver.plc.port import STOP_BIT, Controller

_READ_COILS, _READ_DISCRETE, _READ_HOLDING, _READ_INPUT = 1, 2, 3, 4
_WRITE_COILS, _WRITE_HOLDING = (5, 15), (6, 16)
_FUNCTIONS = (_READ_COILS, _READ_DISCRETE, _READ_HOLDING, _READ_INPUT, *_WRITE_COILS, *_WRITE_HOLDING)
_FUNCTION, _REFUSAL = 7, 0x80  # place of the function in a frame, mark of a refusal
_STOP = COILS.index(STOP_BIT)
_BITS_OF = {_READ_COILS: len(COILS), _READ_DISCRETE: len(DISCRETE_INPUTS)}
_MOST_BITS = 2000  # of one request; beyond, it is exception 03
_BITS = 16  # coils live in registers of 16


class ModbusServer:
    """Serves `controller` on host:port until it is closed; watchdog [s]: longest time between heartbeats.

    Raises OSError when the port can't be had.
    """

    def __init__(self, host: str, port: int, controller: Controller, watchdog: float) -> None:
        self._controller, self._watchdog = controller, watchdog
        self._address = (host, port)
        self._ready = threading.Event()
        self._failure: OSError | None = None
        self._loop = asyncio.new_event_loop()
        self._server: Any = None
        self._pause = 0
        self._thread = threading.Thread(target=self._run, name="modbus", daemon=True)
        self._thread.start()
        self._ready.wait()
        if self._failure is not None:
            self._thread.join()
            raise self._failure

    @property
    def port(self) -> int:
        """TCP port it listens on."""
        return int(self._server.transport.sockets[0].getsockname()[1])

    def close(self) -> None:
        """Stop serving."""
        if self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._server.shutdown(), self._loop).result(5.0)
            self._thread.join(5.0)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        finally:
            self._ready.set()
            self._loop.close()

    async def _serve(self) -> None:
        identity = ModbusDeviceIdentification(info_name={"ProductName": "KR C4, simulated"})
        self._server = ModbusTcpServer(
            self._device(), identity=identity, address=self._address, trace_packet=_Mender().mend
        )
        try:
            await self._server.serve_forever(background=True)
        except RuntimeError as error:
            host, port = self._address
            self._failure = OSError(f"TCP {host}:{port} can't be opened ({error})")
            return
        self._ready.set()
        await self._server.serving

    def _device(self) -> SimDevice:
        bits = [SimData(0, values=[False] * _BITS, datatype=DataType.BITS)]
        return SimDevice(
            id=0,
            simdata=(
                bits,
                [SimData(0, values=[False] * _BITS, datatype=DataType.BITS)],
                [SimData(0, values=[0] * HOLDING_REGISTERS, datatype=DataType.REGISTERS)],
                [SimData(0, values=[0] * INPUT_REGISTERS, datatype=DataType.REGISTERS)],
            ),
            action=self._answer,
        )

    async def _answer(
        self,
        function: int,
        start: int,
        address: int,
        count: int,
        registers: list[int],
        values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        """Bring the registers up to date before they are read, or act on what is written."""
        readout = self._controller.readout()
        try:
            if readout is None:
                return self._answer_asleep(function, address, values)
            if function in _WRITE_COILS:
                return self._write_coils(address, values or [])
            if function in _WRITE_HOLDING:
                return self._write_holding(address, values or [])
        except DriverError:
            return ExcCodes.ILLEGAL_VALUE
        if function in _BITS_OF and address >= _BITS_OF[function]:
            return ExcCodes.ILLEGAL_ADDRESS
        if function == _READ_COILS:
            registers[0] = _packed([*self._levels(), False])
        elif function == _READ_DISCRETE:
            registers[0] = _packed(discrete_inputs(readout))
        elif function == _READ_HOLDING:
            registers[OPERATING_MODE] = int(self._controller.inputs().operating_mode)
            registers[PAUSE] = self._pause
        elif function == _READ_INPUT:
            registers[:] = input_registers(readout)
        else:
            return ExcCodes.ILLEGAL_FUNCTION
        return None

    def _answer_asleep(
        self, function: int, address: int, values: Sequence[int | bool] | None
    ) -> ExcCodes | None:
        """Off the network nothing is heard but a pressed emergency stop, which is latched."""
        if function in _WRITE_COILS and values is None:
            return None  # pymodbus reads back what was written
        values = values or []
        pressed = function in _WRITE_COILS and 0 <= _STOP - address < len(values) and values[_STOP - address]
        if pressed:
            self._controller.write_inputs(MODBUS, {STOP_BIT: True})
        return None if pressed and len(values) == 1 else ExcCodes.DEVICE_FAILURE

    def _levels(self) -> list[bool]:
        inputs = self._controller.inputs()
        return [bool(getattr(inputs, name)) for name in COILS[:HEARTBEAT]]

    def _write_coils(self, address: int, values: Sequence[int | bool]) -> ExcCodes | None:
        if address + len(values) > len(COILS):
            return ExcCodes.ILLEGAL_ADDRESS
        levels = {COILS[k]: bool(level) for k, level in enumerate(values, start=address)}
        if levels.pop(COILS[HEARTBEAT], None) is not None:
            self._controller.heartbeat(self._watchdog)
        if levels:
            self._controller.write_inputs(MODBUS, levels)
        return None

    def _write_holding(self, address: int, values: Sequence[int | bool]) -> ExcCodes | None:
        """Write mode switch and pause; when the second is refused, the first is taken back."""
        wanted = dict(enumerate(map(int, values), start=address))
        mode, pause = wanted.get(OPERATING_MODE), wanted.get(PAUSE)
        before = self._controller.inputs().operating_mode
        if mode is not None:
            if not OperatingMode.T1 <= mode <= OperatingMode.EXT:
                return ExcCodes.ILLEGAL_VALUE
            self._controller.write_operating_mode(MODBUS, OperatingMode(mode))
        if pause is not None:
            try:
                self._controller.request_pause(float(pause))
            except DriverError:
                if mode is not None:
                    self._controller.write_operating_mode(MODBUS, before)
                raise
            self._pause = pause
        return None


class _Mender:
    """Refusals that pymodbus gets wrong.

    It answers requests that it could not read with 80 01, whatever their function; and it reads bits in
    registers of 16, also those that are not defined. An answer is sent while its request is being received,
    so the last packet is the one that is meant.
    """

    def __init__(self) -> None:
        self._function = 0
        self._beyond = b""  # transaction of a request for bits beyond those that are defined

    def mend(self, sending: bool, packet: bytes) -> bytes:
        """Return the packet as it goes on."""
        if not sending:
            self._function = packet[_FUNCTION] if len(packet) > _FUNCTION else 0
            self._beyond = packet[:2] if _reads_beyond(packet) else b""
        elif self._beyond and packet[:2] == self._beyond:
            refusal = bytes((_REFUSAL | self._function, ExcCodes.ILLEGAL_ADDRESS))
            return packet[:4] + len(packet[6:7] + refusal).to_bytes(2, "big") + packet[6:7] + refusal
        elif len(packet) == _FUNCTION + 2 and packet[_FUNCTION] == _REFUSAL:
            known = self._function in _FUNCTIONS
            reason = ExcCodes.ILLEGAL_VALUE if known else ExcCodes.ILLEGAL_FUNCTION
            return packet[:_FUNCTION] + bytes((_REFUSAL | self._function, reason))
        return packet


def _reads_beyond(packet: bytes) -> bool:
    """Whether a request asks for bits beyond those that are defined."""
    if len(packet) < _FUNCTION + 5 or packet[_FUNCTION] not in _BITS_OF:
        return False
    start, count = struct.unpack_from(">HH", packet, _FUNCTION + 1)
    return bool(0 < count <= _MOST_BITS and start + count > _BITS_OF[packet[_FUNCTION]])


def _packed(levels: list[bool]) -> int:
    return sum(1 << k for k, level in enumerate(levels) if level)
