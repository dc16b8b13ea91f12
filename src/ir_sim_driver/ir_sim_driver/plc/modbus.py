"""Modbus TCP server of the controller: a PLC sets its bits and reads the outputs.

The server has a thread and an event loop of its own. Exception 03 also says what the controller
refuses, 04 that it is off the network. What clients do is not logged: a million of them leave no
line.
"""

from __future__ import annotations

import asyncio
import logging
import struct
import threading
from collections.abc import Awaitable
from dataclasses import dataclass
from typing import TypeVar

from ir_sim_driver.plc.modbus_pdu import ExceptionCode, Tables, answered

T = TypeVar("T")
_LOG = logging.getLogger(__name__)
_HEADER = struct.Struct(">HHHB")  # transaction, protocol, bytes that follow, unit
_LONGEST = 254  # bytes that follow, of the largest request that there can be
_HELD = 1.0  # s; a client that has said something since then keeps its place
_CLOSING = 5.0  # s
_DROPPED = (OSError, TimeoutError, asyncio.IncompleteReadError)  # how connections end


@dataclass(frozen=True)
class Limits:
    """Clients at once; idle [s]: how long one may be silent, and take to read its answer."""

    connections: int = 16
    idle: float = 60.0


class ModbusServer:
    """Serves `tables` on host:port until it is closed. Raises OSError when the port can't be had.

    When all connections are taken, a new one takes the place of the one that has been silent for
    longest, or is closed where none has been silent for a second. A frame that is not Modbus ends
    its connection.
    """

    def __init__(self, host: str, port: int, tables: Tables, limits: Limits | None = None) -> None:
        self._tables = tables
        self._limits = limits or Limits()
        self._heard: dict[
            asyncio.StreamWriter, float
        ] = {}  # last request, or begin, of each client [s]
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
            for writer in self._heard:
                writer.transport.abort()
            self._loop.run_until_complete(_end(asyncio.all_tasks(self._loop)))
            self._loop.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if not self._has_place():
            writer.transport.abort()
            return
        self._heard[writer] = self._loop.time()
        try:
            while request := await self._within(_next_request(reader)):
                self._heard[writer] = self._loop.time()
                writer.write(self._answer(*request))
                await self._within(writer.drain())
                await asyncio.sleep(
                    0
                )  # others' turn: requests that are here already need no waiting
        except _DROPPED:
            pass
        finally:
            self._heard.pop(writer, None)
            writer.close()

    async def _within(self, work: Awaitable[T]) -> T:
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
        eldest.transport.abort()
        return True

    def _answer(self, transaction: int, unit: int, request: bytes) -> bytes:
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
