"""Modbus clients by the hundred, silent, pipelining, half heard: bounded, answered, nothing
logged.
"""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymodbus.client import ModbusTcpClient

from ir_msgs_py.plc import OperatingMode
from ir_msgs_py.ros.testing import PATIENCE
from ir_sim_driver import Driver, make_simulation
from ir_sim_driver.plc import OpenLink
from ir_sim_driver.plc.modbus import (
    COILS,
    OPERATING_MODE,
    ClientLimits,
    ControllerTables,
    ModbusServer,
    ModbusTcp,
    answered,
)

Opened = Callable[..., int]
READ_ALL_COILS = struct.pack(">BHH", 1, 0, len(COILS))


@pytest.fixture
def driver() -> Iterator[Driver]:
    made = Driver(make_simulation("open", backend="ideal"))
    yield made
    made.close()


@pytest.fixture
def open_port(driver: Driver) -> Iterator[Opened]:
    """A server's port: open_port(**settings of ModbusTcp)."""
    opened: list[OpenLink] = []

    def open_one(**settings: float) -> int:
        opened.append(ModbusTcp(modbus=True, modbus_port=0, **settings).open(driver.plc))  # type: ignore[arg-type]
        return opened[-1].port

    yield open_one
    for link in opened:
        link.close()


def frame(pdu: bytes, transaction: int = 1, unit: int = 1) -> bytes:
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def received(link: socket.socket, count: int) -> bytes:
    """So many bytes, or fewer when the connection ends."""
    got = b""
    while len(got) < count:
        more = link.recv(count - len(got))
        if not more:
            break
        got += more
    return got


def is_served(port: int) -> bool:
    """Whether a client finds a place: without one it may say one thing."""
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
        try:
            for _ in range(2):
                link.sendall(frame(READ_ALL_COILS))
                if len(received(link, 11)) < 11:
                    return False
        except ConnectionError:
            return False
    return True


def connected(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=PATIENCE)


def test_a_hundred_silent_clients_leave_a_place_and_no_line_in_the_log(
    open_port: Opened, driver: Driver, capfd: pytest.CaptureFixture[str], wait_for: Any
) -> None:
    port = open_port(modbus_connections=4)
    before = threading.active_count()
    silent = [connected(port) for _ in range(100)]
    # a client that was not silent for a second keeps its place
    wait_for(lambda: is_served(port), what="a place for a client that asks")
    assert threading.active_count() <= before  # one of a test before may have ended
    ended = set[int]()

    def most_have_ended() -> bool:
        for k, link in enumerate(silent):
            link.settimeout(0.001)
            with contextlib.suppress(TimeoutError):
                try:
                    if link.recv(1) == b"":
                        ended.add(k)
                except ConnectionError:
                    ended.add(k)
        return len(ended) >= 96

    wait_for(most_have_ended, what="those without a place are disconnected")
    for link in silent:
        link.close()
    assert driver.snapshot(0.0).notices == []
    assert "".join(capfd.readouterr()) == ""


def test_who_asks_keeps_its_place_among_silent_ones(driver: Driver) -> None:
    """On a clock of the server's own: a busy machine would keep the PLC silent as well."""
    server = ModbusServer(
        "127.0.0.1", 0, ControllerTables(driver.plc, 2.0), ClientLimits(connections=2)
    )
    now = [0.0]
    server._loop.time = lambda: now[0]  # type: ignore[method-assign]
    plc = connected(server.port)
    silent = connected(server.port)

    def asks() -> bool:
        plc.sendall(frame(READ_ALL_COILS))
        return len(received(plc, 11)) == 11

    try:
        assert asks()
        assert not is_served(server.port)  # nobody has been silent for a second
        now[0] = 1.5
        assert asks()
        assert is_served(server.port), "the silent one has kept its place"
        assert asks()
    finally:
        plc.close()
        silent.close()
        server.close()


@pytest.mark.parametrize("said", [b"", frame(READ_ALL_COILS)[:5], frame(READ_ALL_COILS)[:9]])
def test_who_says_nothing_whole_is_disconnected(open_port: Opened, said: bytes) -> None:
    # a busy machine's test may come late: what is sent then is refused
    with connected(open_port(modbus_idle=0.1)) as link, contextlib.suppress(ConnectionError):
        link.sendall(said)
        assert link.recv(1) == b""


def test_pipelined_requests_are_all_answered_in_their_order(open_port: Opened) -> None:
    with connected(open_port()) as link:
        link.sendall(b"".join(frame(READ_ALL_COILS, k, unit=k % 200) for k in range(500)))
        answers = [received(link, 11) for _ in range(500)]
    assert [int.from_bytes(answer[:2], "big") for answer in answers] == list(range(500))
    assert [answer[6] for answer in answers] == [k % 200 for k in range(500)]
    assert {answer[7] for answer in answers} == {1}


@pytest.mark.parametrize("header", [(1, 7, 6, 1), (1, 0, 1, 1), (1, 0, 0, 1), (1, 0, 60_000, 1)])
def test_what_is_no_modbus_ends_its_connection(open_port: Opened, header: tuple[int, ...]) -> None:
    port = open_port()
    with connected(port) as link:
        link.sendall(struct.pack(">HHHB", *header) + READ_ALL_COILS)
        with contextlib.suppress(ConnectionError):
            assert received(link, 1) == b""
    assert is_served(port)


def test_several_registers_are_written_together_or_not_at_all(
    open_port: Opened, driver: Driver
) -> None:
    """No step of the plant sees the half: the mode switch at T1 would stop a movement."""
    seen: list[OperatingMode] = []
    client = ModbusTcpClient("127.0.0.1", port=open_port(), timeout=PATIENCE)
    assert client.connect()
    ended = threading.Event()

    def tick() -> None:
        stamp = 0
        while not ended.is_set():
            stamp += 2_000_000
            driver.tick(stamp)
            seen.append(driver.plc.inputs().operating_mode)

    plant = threading.Thread(target=tick)
    plant.start()
    try:
        for _ in range(50):
            assert client.write_registers(OPERATING_MODE, [1, 60]).exception_code == 3
    finally:
        ended.set()
        plant.join()
        client.close()
    assert set(seen) == {OperatingMode.EXT}


class Wall:
    """Tables that fail with what nobody expects."""

    def coils(self) -> list[bool]:
        raise ZeroDivisionError

    def discrete_inputs(self) -> list[bool]:
        return [True, False, True] * 3

    def holding_registers(self) -> list[int]:
        return [7, 8]

    def input_registers(self) -> list[int]:
        return []

    def write_coils(self, start: int, levels: object) -> None:
        self.written = (start, list(levels))  # type: ignore[call-overload]

    def write_registers(self, start: int, values: object) -> None:
        self.written = (start, list(values))  # type: ignore[call-overload]


@pytest.mark.parametrize(
    ("request_", "answer"),
    [
        ("02 0001 0008", "02 01 b6"),  # inputs 1 to 8 of 101101101
        ("02 0000 0009", "02 02 6d01"),
        ("02 0009 0001", "82 02"),
        ("02 0000 0000", "82 03"),
        ("02 0000 07d1", "82 03"),
        ("03 0000 0002", "03 04 0007 0008"),
        ("03 0001 0002", "83 02"),
        ("04 0000 0001", "84 02"),
        ("05 0003 ff00", "05 0003 ff00"),
        ("05 0003 0100", "85 03"),
        ("0f 0002 000a 02 cd01", "0f 0002 000a"),
        ("0f 0002 000a 01 cd", "8f 03"),
        ("10 0000 0002 04 000a 0102", "10 0000 0002"),
        ("10 0000 0002 04 000a", "90 03"),
        ("03 00", "83 03"),
        ("2b 0e 01 00", "ab 01"),
    ],
)
def test_requests_are_answered_as_the_specification_says(request_: str, answer: str) -> None:
    assert answered(bytes.fromhex(request_), Wall()) == bytes.fromhex(answer)


def test_coils_are_written_as_the_specification_packs_them() -> None:
    wall = Wall()
    answered(bytes.fromhex("0f 0013 000a 02 cd01"), wall)  # the example of its section 6.11
    assert wall.written == (0x13, [True, False, True, True, False, False, True, True, True, False])


def test_an_error_of_the_drivers_own_is_answered_and_logged_once(
    caplog: pytest.LogCaptureFixture,
) -> None:
    server = ModbusServer("127.0.0.1", 0, Wall())
    try:
        with connected(server.port) as link:
            for _ in range(3):
                link.sendall(frame(READ_ALL_COILS))
                assert received(link, 9)[7:] == bytes((0x81, 4))
            link.sendall(frame(struct.pack(">BHH", 3, 0, 2)))
            assert received(link, 13)[7:] == bytes.fromhex("03 04 0007 0008")
    finally:
        server.close()
    assert [record.exc_info[0] for record in caplog.records if record.exc_info] == [
        ZeroDivisionError
    ]


def test_what_the_event_loop_complains_of_is_not_logged(caplog: pytest.LogCaptureFixture) -> None:
    """Without descriptors it would be a traceback each second."""
    server = ModbusServer("127.0.0.1", 0, Wall())
    try:
        complaint = {
            "message": "socket.accept() out of system resource",
            "exception": OSError(24, "full"),
        }
        server._loop.call_soon_threadsafe(server._loop.call_exception_handler, complaint)
        with connected(server.port) as link:  # heard after the complaint
            link.sendall(frame(struct.pack(">BHH", 3, 0, 2)))
            assert received(link, 13)[7:] == bytes.fromhex("03 04 0007 0008")
    finally:
        server.close()
    assert caplog.records == []
