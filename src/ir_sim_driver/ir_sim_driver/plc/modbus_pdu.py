"""Requests of Modbus in bytes, answered from tables: the part of the protocol that knows no
network.

The eight functions that read and write bits and registers, as in the MODBUS Application Protocol
Specification V1.1b3. What is wrong with a request is answered in its order: function, count,
address, value.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from enum import IntEnum
from typing import Protocol

from ir_sim_driver.errors import ModbusRefusedError

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
    """What requests read and write; each raises ModbusRefusedError, and has done nothing then."""

    def coils(self) -> Sequence[bool]:
        """All coils."""

    def discrete_inputs(self) -> Sequence[bool]:
        """All discrete inputs."""

    def holding_registers(self) -> Sequence[int]:
        """All holding registers."""

    def input_registers(self) -> Sequence[int]:
        """All input registers."""

    def write_coils(self, start: int, levels: Sequence[bool]) -> None:
        """Write all of these coils or none."""

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
