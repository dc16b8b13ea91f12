"""Modbus TCP: requests, register map, server and link."""

from __future__ import annotations

import asyncio
import logging
import struct
import threading
import time
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, Protocol, TypeVar

from ir_msgs_py.plc import OperatingMode
from ir_msgs_py.status import StatusCode
from ir_sim_driver.errors import DriverError, ModbusRefusedError, RequestRefusedError
from ir_sim_driver.plc.port import STOP_BIT, Controller, OpenLink, Readout
from ir_values.settings import check_settings, setting

# Requests in bytes, answered from tables: the part of the protocol that knows no network.
#
# The eight functions that read and write bits and registers, as in the MODBUS Application
# Protocol Specification V1.1b3. What is wrong with a request is answered in its order: function,
# count, address, value.

READ_COILS = 1
READ_DISCRETE_INPUTS = 2
READ_HOLDING = 3
READ_INPUT = 4
WRITE_COIL = 5
WRITE_REGISTER = 6
WRITE_COILS = 15
WRITE_REGISTERS = 16
_REFUSED = 0x80  # mark of a function that was refused
_MOST_BITS_READ = 2000
_MOST_BITS_WRITTEN = 1968
_MOST_REGISTERS_READ = 125
_MOST_REGISTERS_WRITTEN = 123
# a single coil
_ON = 0xFF00
_OFF = 0x0000


class ExceptionCode(IntEnum):
    """Why a request is refused."""

    FUNCTION = 1
    ADDRESS = 2
    VALUE = 3
    DEVICE_FAILURE = 4


class Tables(Protocol):
    """What requests read and write; each raises ModbusRefusedError, and has done nothing then,
    except that a press of the emergency stop counts.

    came_ns: when the request that is being answered came at the earliest [ns of the monotonic
    clock], 0: now.
    """

    came_ns: int

    def coils(self) -> Sequence[bool]:
        """All coils."""

    def discrete_inputs(self) -> Sequence[bool]:
        """All discrete inputs."""

    def holding_registers(self) -> Sequence[int]:
        """All holding registers."""

    def input_registers(self) -> Sequence[int]:
        """All input registers."""

    def write_coils(self, start: int, levels: Sequence[bool]) -> None:
        """Write all of these coils or none; of refused ones an emergency stop counts."""

    def write_registers(self, start: int, values: Sequence[int]) -> None:
        """Write all of these holding registers or none."""


def answered(request: bytes, tables: Tables) -> bytes:
    """The PDU that answers a PDU of at least one byte."""
    function = request[0]
    body = request[1:]
    try:
        return request[:1] + _answer_of(function)(body, tables)
    except ModbusRefusedError as refusal:
        code = refusal.code
    except struct.error:  # shorter than its function asks for
        code = ExceptionCode.VALUE
    return bytes((function | _REFUSED, code))


def _answer_of(function: int) -> Callable[[bytes, Tables], bytes]:
    if function not in _ANSWERS:
        raise ModbusRefusedError(ExceptionCode.FUNCTION)
    return _ANSWERS[function]


def _read_bits(body: bytes, read: Callable[[], Sequence[bool]]) -> bytes:
    start, count = struct.unpack_from(">HH", body)
    _check(1 <= count <= _MOST_BITS_READ, ExceptionCode.VALUE)
    levels = read()
    _check(start + count <= len(levels), ExceptionCode.ADDRESS)
    packed = sum(1 << k for k, level in enumerate(levels[start : start + count]) if level)
    size = _bytes_of(count)
    return bytes((size,)) + packed.to_bytes(size, "little")


def _read_registers(body: bytes, read: Callable[[], Sequence[int]]) -> bytes:
    start, count = struct.unpack_from(">HH", body)
    _check(1 <= count <= _MOST_REGISTERS_READ, ExceptionCode.VALUE)
    values = read()
    _check(start + count <= len(values), ExceptionCode.ADDRESS)
    return bytes((2 * count,)) + struct.pack(f">{count}H", *values[start : start + count])


def _write_coil(body: bytes, tables: Tables) -> bytes:
    start, value = struct.unpack_from(">HH", body)
    _check(value in (_ON, _OFF), ExceptionCode.VALUE)
    tables.write_coils(start, [value == _ON])
    return body[:4]


def _write_register(body: bytes, tables: Tables) -> bytes:
    start, value = struct.unpack_from(">HH", body)
    tables.write_registers(start, [value])
    return body[:4]


def _write_coils(body: bytes, tables: Tables) -> bytes:
    start, count, size = struct.unpack_from(">HHB", body)
    packed = body[5:]
    right = 1 <= count <= _MOST_BITS_WRITTEN and size == len(packed) == _bytes_of(count)
    _check(right, ExceptionCode.VALUE)
    number = int.from_bytes(packed, "little")
    tables.write_coils(start, [bool(number >> k & 1) for k in range(count)])
    return body[:4]


def _write_registers(body: bytes, tables: Tables) -> bytes:
    start, count, size = struct.unpack_from(">HHB", body)
    right = 1 <= count <= _MOST_REGISTERS_WRITTEN and size == len(body) - 5 == 2 * count
    _check(right, ExceptionCode.VALUE)
    tables.write_registers(start, struct.unpack_from(f">{count}H", body, 5))
    return body[:4]


def _bytes_of(bits: int) -> int:
    return (bits + 7) // 8


def _check(holds: bool, code: ExceptionCode) -> None:
    if not holds:
        raise ModbusRefusedError(code)


_ANSWERS: dict[int, Callable[[bytes, Tables], bytes]] = {
    READ_COILS: lambda body, tables: _read_bits(body, tables.coils),
    READ_DISCRETE_INPUTS: lambda body, tables: _read_bits(body, tables.discrete_inputs),
    READ_HOLDING: lambda body, tables: _read_registers(body, tables.holding_registers),
    READ_INPUT: lambda body, tables: _read_registers(body, tables.input_registers),
    WRITE_COIL: _write_coil,
    WRITE_REGISTER: _write_register,
    WRITE_COILS: _write_coils,
    WRITE_REGISTERS: _write_registers,
}


# Register map: coils and holding registers in, discrete inputs and input registers out.
#
# Addresses are zero-based (PDU addresses). 32-bit values take two registers, the high word first.

MODBUS = "modbus"
"""How sentences and the parameter `plc.owner` call the link."""
COILS = (
    "ab",
    "hib",
    "ks",
    "emergency_stop",
    "drives_on",
    "drives_off",
    "conf_mess",
    "move_enable",
    "heartbeat",
)
"""Coils 0..8; the first eight are the fields of ir_msgs/PlcInputs."""
HEARTBEAT = COILS.index("heartbeat")
DISCRETE_INPUTS = ("ab", "bbs", "drives_ready", "alarm_stop", "in_home", "moving")
"""Discrete inputs 0..5: the fields of ir_msgs/PlcOutputs."""
OPERATING_MODE = 0
PAUSE = 1
"""Holding registers: mode switch (1 T1, 2 T2, 3 AUT, 4 EXT); pause [s] (writing starts one, 0 ends
it).
"""
HOLDING_REGISTERS = 2
INPUT_REGISTERS = 9
"""Input registers: 0 mode, 1 target mode, 2 time to target [0.1 s], 3 and 4 power [W], 5 and 6
energy [J / 100], 7 time to operate [s], 8 alive counter.
"""
_WORD = 0xFFFF


def discrete_inputs(readout: Readout) -> list[bool]:
    """Values in the order of DISCRETE_INPUTS."""
    return [bool(getattr(readout.outputs, name)) for name in DISCRETE_INPUTS]


def input_registers(readout: Readout) -> list[int]:
    """Values of the INPUT_REGISTERS."""
    return [
        int(readout.mode),
        int(readout.target),
        _clamped(readout.time_to_target * 10.0),
        *_words(readout.power),
        *_words(readout.energy / 100.0),
        _clamped(readout.time_to_operate),
        readout.alive & _WORD,
    ]


def _clamped(value: float) -> int:
    return min(max(round(value), 0), _WORD)


def _words(value: float) -> tuple[int, int]:
    number = min(max(round(value), 0), 0xFFFFFFFF)
    return number >> 16, number & _WORD


# Tables: coils and registers act on the controller, inputs are read from it.

T = TypeVar("T")


class ControllerTables:
    """Implements `Tables` on `controller`; watchdog [s]: longest time between
    heartbeats.
    """

    def __init__(self, controller: Controller, watchdog: float) -> None:
        self._controller = controller
        self._watchdog = watchdog
        self._pause = 0
        self.came_ns = 0

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
        """Set levels; any write of the heartbeat's coil is a heartbeat. Raises ModbusRefusedError
        for an address that has none.
        """
        if start + len(levels) > len(COILS):
            raise ModbusRefusedError(ExceptionCode.ADDRESS)
        named = {COILS[k]: level for k, level in enumerate(levels, start=start)}
        if self._controller.readout() is None:
            self._press_asleep(named)
            return
        beats = named.pop(COILS[HEARTBEAT], None) is not None
        if named:
            _asked(lambda: self._controller.write_inputs(MODBUS, named, self.came_ns))
        if beats:
            self._controller.heartbeat(self._watchdog)

    def write_registers(self, start: int, values: Sequence[int]) -> None:
        """Turn the mode switch, start or end a pause, or both at once. Raises ModbusRefusedError
        for an address that has none and for what the controller refuses.
        """
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


# Server.
#
# The server has a thread and an event loop of its own. Exception 03 also says what the controller
# refuses, 04 that it is off the network. What clients do is not logged: a million of them leave
# no line.

_LOG = logging.getLogger(__name__)
_HEADER = struct.Struct(">HHHB")  # transaction, protocol, bytes that follow, unit
_LONGEST = 254  # bytes that follow, of the largest request that there can be
_HELD = 1.0  # s; a client that has said something since then keeps its place
_LEAVING = 256  # clients without a place that may still say one thing
_CLOSING = 5.0  # s
_TURN = 0.02  # s between two looks of the server at the clock
_SUSPENDED = 0.1  # s without a look: what is read then may be as old
_DROPPED = (OSError, TimeoutError, asyncio.IncompleteReadError)  # how connections end


@dataclass(frozen=True)
class ClientLimits:
    """Clients at once; idle [s]: how long one may be silent, and take to read its answer."""

    connections: int = 16
    idle: float = 60.0


class ModbusServer:
    """Serves `tables` on host:port until it is closed. Raises OSError when the port can't be had.

    When all connections are taken, a new one takes the place of the one that has been silent for
    longest, where that is a second at least. Who has no place, or loses it, may still say one thing
    within a second: a press of the emergency stop that is on its way counts. A frame that is not
    Modbus ends its connection.
    """

    def __init__(
        self, host: str, port: int, tables: Tables, limits: ClientLimits | None = None
    ) -> None:
        self._tables = tables
        self._limits = limits or ClientLimits()
        self._heard: dict[
            asyncio.StreamWriter, float
        ] = {}  # last request, or begin, of each client [s]
        # without a place, and when each is closed
        self._leaving: dict[asyncio.StreamWriter, asyncio.TimerHandle] = {}
        self._reported: set[type[Exception]] = set()
        self._loop = asyncio.new_event_loop()
        # without descriptors no client can be accepted: asyncio tries again every second, and need
        # not say so
        self._loop.set_exception_handler(lambda loop, context: None)
        try:
            self._server = self._loop.run_until_complete(
                asyncio.start_server(self._serve, host, port)
            )
        except (OSError, ValueError, TypeError) as error:  # the last two: a host that is no name
            self._loop.close()
            raise OSError(f"TCP {host}:{port} can't be opened ({error})") from error
        self.port = int(self._server.sockets[0].getsockname()[1])
        self._looked = time.monotonic()
        self._before_gap = self._gap_ended = -float("inf")
        self._loop.call_soon(self._look_at_the_clock)
        self._thread = threading.Thread(target=self._run, name="modbus", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop serving."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_CLOSING)

    def _run(self) -> None:
        try:
            self._loop.run_forever()
        finally:
            self._server.close()
            for writer in (*self._heard, *self._leaving):
                writer.transport.abort()
            self._loop.run_until_complete(_end(asyncio.all_tasks(self._loop)))
            self._loop.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if self._has_place():
            self._heard[writer] = self._loop.time()
        else:
            self._take_leave(writer)
        try:
            while request := await self._unless_idle(_next_request(reader)):
                writer.write(self._answer(*request))
                if writer in self._leaving:
                    break
                self._heard[writer] = self._loop.time()
                await self._unless_idle(writer.drain())
                # others' turn: requests that are here already need no waiting
                await asyncio.sleep(0)
        except _DROPPED:
            pass
        finally:
            self._heard.pop(writer, None)
            leaves = self._leaving.pop(writer, None)
            if leaves is not None:
                leaves.cancel()
            writer.close()

    def _take_leave(self, writer: asyncio.StreamWriter) -> None:
        """Give a client that has no place a second to say one thing."""
        if len(self._leaving) >= _LEAVING:
            eldest = next(iter(self._leaving))
            self._leaving.pop(eldest).cancel()
            eldest.transport.abort()
        self._leaving[writer] = self._loop.call_later(_HELD, writer.transport.abort)

    async def _unless_idle(self, work: Awaitable[T]) -> T:
        """What work gives. TimeoutError where it takes longer than a connection may be idle."""
        async with asyncio.timeout(self._limits.idle):
            return await work

    def _has_place(self) -> bool:
        """Whether there is a place for one more, made if need be."""
        if len(self._heard) < self._limits.connections:
            return True
        eldest = min(self._heard, key=self._heard.__getitem__)
        if self._loop.time() - self._heard[eldest] < _HELD:
            return False
        del self._heard[eldest]
        self._take_leave(eldest)
        return True

    def _look_at_the_clock(self) -> None:
        """Note a gap, in which this process did not run: what is read just after it may be as old
        as the look before.
        """
        now = time.monotonic()
        if now - self._looked > _SUSPENDED:
            self._before_gap = self._looked
            self._gap_ended = now
        self._looked = now
        self._loop.call_later(_TURN, self._look_at_the_clock)

    def _came_ns(self) -> int:
        """When a request that is read now came at the earliest [ns]; 0: now."""
        now = time.monotonic()
        if now - self._looked > _SUSPENDED:
            return int(self._looked * 1e9)
        return int(self._before_gap * 1e9) if now - self._gap_ended < _SUSPENDED else 0

    def _answer(self, transaction: int, unit: int, request: bytes) -> bytes:
        self._tables.came_ns = self._came_ns()
        try:
            answer = answered(request, self._tables)
        except (
            Exception
        ) as error:  # a bug in one answer must end neither the connection nor the server
            self._report(error)
            answer = bytes((request[0] | 0x80, ExceptionCode.DEVICE_FAILURE))
        return _HEADER.pack(transaction, 0, len(answer) + 1, unit) + answer

    def _report(self, error: Exception) -> None:
        """Log an error of the driver's own, each kind once: clients must not be able to fill a
        disk.
        """
        if type(error) not in self._reported:
            self._reported.add(type(error))
            _LOG.error("a Modbus request could not be answered", exc_info=error)


async def _end(tasks: set[asyncio.Task[None]]) -> None:
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def _next_request(reader: asyncio.StreamReader) -> tuple[int, int, bytes] | None:
    """Transaction, unit and PDU of the next frame; None when it is no Modbus."""
    transaction, protocol, length, unit = _HEADER.unpack(await reader.readexactly(_HEADER.size))
    if protocol != 0 or not 2 <= length <= _LONGEST:
        return None
    return transaction, unit, await reader.readexactly(length - 1)


# Link: its settings, and the server opened where it is wanted.


@dataclass(frozen=True)
class ModbusTcp:
    """A PLC can connect by Modbus TCP."""

    name: ClassVar[str] = MODBUS
    sets_inputs: ClassVar[bool] = True

    modbus: bool = setting(False, "Whether a PLC can connect by Modbus TCP.", read_only=True)
    modbus_host: str = setting("127.0.0.1", "Address of the Modbus server.", read_only=True)
    modbus_port: int = setting(
        5020,
        "TCP port of the Modbus server; 0 takes a free one. The usual one is 502.",
        minimum=0,
        maximum=65535,
        read_only=True,
    )
    modbus_watchdog: float = setting(
        2.0,
        "Without a heartbeat for this long the link to the PLC counts as lost, if it has ever "
        "sent one.",
        unit="s",
        minimum=0.1,
        maximum=3600.0,
        read_only=True,
    )

    modbus_connections: int = setting(
        16,
        "Modbus clients at once; one more takes the place of the one that has been silent for "
        "longest.",
        minimum=1,
        maximum=1000,
        read_only=True,
    )
    modbus_idle: float = setting(
        60.0,
        "A Modbus client that is silent for this long is disconnected.",
        unit="s",
        minimum=0.1,
        maximum=86400.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    def wanted(self) -> bool:
        """Whether the settings ask for it."""
        return self.modbus

    def open(self, controller: Controller) -> OpenLink:
        """Serve the controller. Raises DriverError when the port is taken."""
        tables = ControllerTables(controller, self.modbus_watchdog)
        limits = ClientLimits(self.modbus_connections, self.modbus_idle)
        try:
            return ModbusServer(self.modbus_host, self.modbus_port, tables, limits)
        except OSError as error:
            raise DriverError(f"no Modbus: {error}") from error
