"""The PLC's side by Modbus TCP, over a real socket; the plant is ticked by the test."""

from __future__ import annotations

import contextlib
import socket
import struct
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymodbus.client import ModbusTcpClient

from ir_msgs_py.modes import Mode, TransitionTimes
from ir_msgs_py.ros.testing import PATIENCE
from ir_sim_driver.controller.driver import Driver
from ir_sim_driver.controller.settings import ControllerSettings
from ir_sim_driver.errors import DriverError, RequestRefusedError, TrajectoryRefusedError
from ir_sim_driver.plc.inputs import PlcSettings
from ir_sim_driver.plc.modbus import (
    COILS,
    DISCRETE_INPUTS,
    HEARTBEAT,
    INPUT_REGISTERS,
    OPERATING_MODE,
    PAUSE,
    ModbusTcp,
)

PERIOD = 2_000_000
WATCHDOG = 0.5


def opened_on(driver, **limits):
    """A server on a free port."""
    wanted = {"modbus_port": 0, "modbus_watchdog": WATCHDOG, **limits}
    return ModbusTcp(modbus=True, **wanted).open(driver.plc)


@pytest.fixture
def serve():
    """A served simulation: serve(simulation) gives driver, client and port."""
    opened = []

    def serve_one(simulation, **limits):
        driver = Driver(simulation)
        server = opened_on(driver, **limits)
        client = ModbusTcpClient("127.0.0.1", port=server.port, timeout=PATIENCE)
        assert client.connect()
        opened.append((client, server, driver))
        return driver, client, server.port

    yield serve_one
    for client, server, driver in opened:
        client.close()
        server.close()
        driver.close()


def run(driver, seconds):
    for k in range(round(seconds / 0.002)):
        driver.tick((k + 1) * PERIOD)


def coil(name):
    return COILS.index(name)


def acknowledge(client):
    """Raise conf_mess, as a PLC does: again while the server, which did not run for 0.1 s, can't
    tell whether a request came before the last stop.
    """
    deadline = time.monotonic() + PATIENCE
    answer = client.write_coil(coil("conf_mess"), True)
    while answer.isError() and answer.exception_code == 3 and time.monotonic() < deadline:
        answer = client.write_coil(coil("conf_mess"), True)
    assert not answer.isError(), answer


def test_a_plc_switches_the_bus_off_and_on_and_reads_what_it_costs(make, serve):
    driver, client, _ = serve(make())
    client.write_coil(coil("ab"), True)
    run(driver, 3.1)
    registers = client.read_input_registers(0, count=INPUT_REGISTERS).registers
    assert registers[0] == Mode.BUS_POWER_OFF
    run(driver, 0.5)
    registers = client.read_input_registers(0, count=INPUT_REGISTERS).registers
    run(driver, 0.5)
    registers = client.read_input_registers(0, count=INPUT_REGISTERS).registers
    assert (registers[3] << 16) + registers[4] == 205  # W, Table II
    assert client.read_discrete_inputs(0, count=6).bits[DISCRETE_INPUTS.index("ab")]
    client.write_coil(coil("ab"), False)
    run(driver, 22.0)
    assert client.read_input_registers(0, count=1).registers[0] == Mode.STAND_ON_MOTORS
    assert client.read_discrete_inputs(0, count=6).bits[DISCRETE_INPUTS.index("drives_ready")]


def test_pause_and_operating_mode_are_registers(make, serve):
    driver, client, _ = serve(make())
    client.write_register(PAUSE, 30)
    run(driver, 0.5)
    assert client.read_input_registers(0, count=1).registers[0] == Mode.STAND_ON_BRAKES
    client.write_register(PAUSE, 0)
    run(driver, 2.0)
    assert client.read_input_registers(0, count=1).registers[0] == Mode.STAND_ON_MOTORS
    client.write_register(OPERATING_MODE, 1)
    assert client.read_holding_registers(0, count=2).registers == [1, 0]
    refused = client.write_register(OPERATING_MODE, 9)
    assert (refused.isError(), refused.exception_code) == (True, 3)
    refused = client.write_register(PAUSE, 60)  # not in T1
    assert refused.exception_code == 3


def test_what_came_before_a_stop_acknowledges_nothing_and_a_press_counts(make, serve):
    """As coils that were written while the driver was suspended, and are read after a press."""
    driver, client, _ = serve(make())
    before = time.monotonic_ns()
    driver.press("service", "emergency_stop", True)
    number = driver.stop_number
    for late in ({"conf_mess": True}, {"drives_on": True}, {"emergency_stop": False}):
        with pytest.raises(RequestRefusedError, match="before stop"):
            driver.plc.write_inputs("modbus", late, before)
    with pytest.raises(RequestRefusedError, match="before stop"):
        driver.plc.write_inputs("modbus", {"emergency_stop": True, "conf_mess": True}, before)
    driver.plc.write_inputs("modbus", {"emergency_stop": True}, before)
    assert driver.plc.inputs().emergency_stop
    assert not driver.plc.inputs().conf_mess
    assert driver.stop_number == number  # the button is down
    acknowledge(client)  # it comes now
    assert driver.plc.inputs().conf_mess


def test_a_press_on_a_connection_that_finds_no_place_counts(make, serve):
    driver, client, port = serve(make(), modbus_connections=2)
    speaking = ModbusTcpClient("127.0.0.1", port=port, timeout=PATIENCE)
    assert speaking.connect()
    for place in (client, speaking):
        assert not place.read_coils(0, count=1).isError()
    number = driver.stop_number
    pressing = ModbusTcpClient("127.0.0.1", port=port, timeout=PATIENCE, retries=0)
    assert pressing.connect()
    assert not pressing.write_coil(coil("emergency_stop"), True).isError()
    assert driver.stop_number != number
    assert not client.read_coils(0, count=1).isError()
    pressing.close()
    speaking.close()


def test_registers_are_written_all_or_none(make, serve):
    _, client, _ = serve(make())
    refused = client.write_registers(OPERATING_MODE, [1, 60])  # no pause in T1
    assert refused.exception_code == 3
    assert client.read_holding_registers(0, count=2).registers == [4, 0]


def test_coils_read_back_what_topic_or_service_have_set(make, serve):
    driver, client, _ = serve(make())
    driver.press("service", "drives_off", True)
    levels = client.read_coils(0, count=len(COILS)).bits[: len(COILS)]
    assert [name for name, level in zip(COILS, levels, strict=True) if level] == [
        "drives_off",
        "move_enable",
    ]


@pytest.mark.parametrize(
    ("request_", "code"),
    [
        (lambda c: c.read_coils(100, count=1), 2),
        (lambda c: c.write_coil(len(COILS), True), 2),
        (lambda c: c.write_coils(5, [True] * 10), 2),
        (lambda c: c.read_input_registers(INPUT_REGISTERS, count=1), 2),
        (lambda c: c.write_register(2, 1), 2),
        (lambda c: c.read_discrete_inputs(40, count=4), 2),
        (lambda c: c.read_coils(len(COILS), count=1), 2),
        (lambda c: c.read_coils(0, count=len(COILS) + 1), 2),
        (lambda c: c.read_discrete_inputs(0, count=len(DISCRETE_INPUTS) + 1), 2),
    ],
)
def test_addresses_that_aren_t_there_are_exception_02(make, serve, request_, code):
    _, client, _ = serve(make())
    answer = request_(client)
    assert (answer.isError(), answer.exception_code) == (True, code)
    assert not client.read_coils(0, count=9).isError()


def exchange(port, pdu, length=None):
    """Send a raw request and return the PDU of the answer, b"" when there is none within 60 s."""
    frame = struct.pack(">HHHB", 7, 0, (len(pdu) + 1) if length is None else length, 1) + pdu
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link:
        link.sendall(frame)
        try:
            return link.recv(300)[7:]
        except (TimeoutError, ConnectionError):
            return b""


def test_an_unknown_function_is_exception_01_and_a_bad_count_03(make, serve):
    _, client, port = serve(make())
    assert exchange(port, bytes([0x63, 0, 0, 0, 1])) == bytes([0x63 | 0x80, 1])
    assert exchange(port, struct.pack(">BHH", 1, 0, 0)) == bytes([0x81, 3])
    assert not client.read_coils(0, count=1).isError()


def test_half_open_and_silent_sockets_disturb_nobody(make, serve):
    _, client, port = serve(make())
    idle = [socket.create_connection(("127.0.0.1", port)) for _ in range(20)]
    idle[0].sendall(b"\x00\x07\x00")
    assert not client.read_coils(0, count=1).isError()
    for link in idle:
        link.close()


def test_while_hibernating_the_controller_does_not_answer_for_itself(make, serve):
    _, client, _ = serve(make(controller=ControllerSettings(start_mode="HIBERNATION")))
    assert client.read_input_registers(0, count=1).exception_code == 4
    assert client.write_coil(coil("hib"), False).exception_code == 4


def test_a_taken_port_is_an_error_with_its_number(make, serve):
    driver, _, port = serve(make())
    with pytest.raises(DriverError, match=str(port)):
        opened_on(driver, modbus_port=port)


def test_a_plc_that_falls_silent_stops_the_robot_until_it_is_back(make, serve, plan, start, cell):
    simulation = make()
    driver, client, _ = serve(simulation)
    home = np.array(cell.machine_home)
    client.write_coil(HEARTBEAT, True)
    start(simulation, plan(4.0, home, home + 0.1))
    run(driver, 0.4)
    client.write_coil(HEARTBEAT, False)
    run(driver, 0.4)
    assert simulation.executor.active
    run(driver, 1.0)
    assert not simulation.executor.active
    assert simulation.modes.mode is Mode.STAND_ON_MOTORS  # the power mode stays
    with pytest.raises(TrajectoryRefusedError, match="heartbeat"):
        start(simulation, plan([1.5], home))
    client.write_coil(HEARTBEAT, True)
    start(simulation, plan([1.5], home))


def test_a_sleeping_controller_hears_no_heartbeat_and_misses_none(make, serve):
    simulation = make(transitions=TransitionTimes(hibernation_enter=0.1))
    driver, client, _ = serve(simulation)
    client.write_coil(HEARTBEAT, True)
    client.write_coil(coil("hib"), True)
    run(driver, 3.0)
    assert simulation.modes.mode is Mode.HIBERNATION
    assert simulation.watch.lost == ""


def test_a_plc_without_a_heartbeat_is_not_watched(make, serve):
    simulation = make()
    driver, client, _ = serve(simulation)
    client.write_coil(coil("move_enable"), True)
    run(driver, 3.0)
    assert simulation.watch.lost == ""


@pytest.fixture(scope="module")
def endangered(make):
    driver = Driver(make(load="none"))
    server = opened_on(driver)
    yield driver, server.port
    server.close()
    driver.close()


word = st.one_of(st.integers(0, 20), st.integers(0, 0xFFFF))
pdu = st.builds(
    lambda function, words, rest: struct.pack(f">B{len(words)}H", function, *words) + rest,
    st.one_of(st.sampled_from([1, 2, 3, 4, 5, 6, 15, 16, 22, 23]), st.integers(0, 255)),
    st.lists(word, max_size=4),
    st.binary(max_size=8),
)
requests = st.lists(st.one_of(pdu, st.binary(max_size=40)), min_size=1, max_size=4)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(frames=requests, framed=st.booleans())
def test_no_bytes_bring_the_server_down(endangered, frames, framed):
    survive(endangered, frames, framed)


@pytest.mark.long
@settings(max_examples=5_000, deadline=None, derandomize=True)
@given(frames=requests, framed=st.booleans())
def test_five_thousand_connections_don_t_bring_the_server_down(endangered, frames, framed):
    survive(endangered, frames, framed)


def survive(endangered, frames, framed):
    driver, port = endangered
    driver.plc.write_inputs(
        "service", {"hib": False}
    )  # a request may have put the controller to sleep
    driver.plc.wake()
    # what is no Modbus ends its connection
    with (
        socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as link,
        contextlib.suppress(ConnectionError),
    ):
        for body in frames:
            link.sendall(struct.pack(">HHHB", 1, 0, len(body) + 1, 1) + body if framed else body)
    run(driver, 0.01)
    assert exchange(port, struct.pack(">BHH", 1, 0, 1))[0] in (0x01, 0x81)


def test_inputs_that_belong_to_the_topic_are_refused_but_the_emergency_stop(make, serve):
    simulation = make(plc=PlcSettings(owner="topic"))
    driver, client, _ = serve(simulation)
    assert client.write_coil(coil("ab"), True).exception_code == 3
    assert client.write_register(OPERATING_MODE, 1).exception_code == 3
    run(driver, 0.1)
    assert not simulation.plc.levels.ab
    assert any("plc.owner" in notice.sentence for notice in simulation.notices.take())
    levels = [True] * len(COILS)
    assert (
        client.write_coils(0, levels).exception_code == 3
    )  # all at once: the stop counts, the rest does not
    run(driver, 0.1)
    assert simulation.modes.mode is Mode.EMERGENCY_STOP
    assert not simulation.plc.raw.ab
    assert (
        client.write_coil(coil("emergency_stop"), False).exception_code == 3
    )  # released by its owner only
