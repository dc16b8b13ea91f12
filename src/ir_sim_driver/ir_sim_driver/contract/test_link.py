"""The contract of `Link`, for each registered link between PLC and controller."""

from __future__ import annotations

import dataclasses
import socket
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from ir_msgs_py.modes import Mode
from ir_msgs_py.plc import OperatingMode, PlcInputs, PlcOutputs
from ir_sim_driver.errors import DriverError
from ir_sim_driver.plc import LINKS, WRITERS, Link, OpenLink, Readout
from ir_values.settings import describe

LOOPBACK = "127.0.0.1"
GARBAGE = 200  # packets


class Recorder:
    """A controller that keeps what a link asks of it; `asleep`: off the network."""

    def __init__(self) -> None:
        self.asleep = False
        self.calls: list[str] = []
        self.levels = PlcInputs()

    def readout(self) -> Readout | None:
        if self.asleep:
            return None
        mode = Mode.STAND_ON_MOTORS
        return Readout(PlcOutputs(), mode, mode, 0.0, 0.0, 420.0, 1e6, 1)

    def inputs(self) -> PlcInputs:
        return self.levels

    def write_inputs(self, writer: str, levels: Mapping[str, bool], came_ns: int = 0) -> None:
        self.calls.append(f"{writer} writes {dict(levels)}")

    def write_mode_and_pause(
        self, writer: str, mode: OperatingMode | None, pause: float | None
    ) -> None:
        self.calls.append(f"{writer} turns the switch to {mode} and asks for a pause of {pause} s")

    def heartbeat(self, timeout: float) -> None:
        pass

    def wake(self) -> None:
        self.calls.append("wake")


def setting_names(kind: type[Link], ending: str) -> list[str]:
    return [each.name for each in describe(kind) if each.name.endswith(ending)]


def settings(kind: type[Link], port: int = 0) -> Link:
    """The link with its own defaults, wanted, on a port (0: a free one)."""
    made: Any = kind(**dict.fromkeys(setting_names(kind, "_port"), port))
    if not made.wanted:
        switches = [each.name for each in describe(kind) if each.type is bool]
        made = dataclasses.replace(made, **dict.fromkeys(switches, True))
    link: Link = made
    return link


@pytest.fixture(params=LINKS)
def kind(request: pytest.FixtureRequest) -> type[Link]:
    return LINKS[request.param]


@pytest.fixture
def controller() -> Recorder:
    return Recorder()


@pytest.fixture
def served(kind: type[Link], controller: Recorder) -> Iterator[OpenLink]:
    opened = settings(kind).open(controller)
    yield opened
    opened.close()


def pester(port: int, packets: int = GARBAGE) -> None:
    """Random bytes by TCP and by UDP to a port of this host."""
    generator = np.random.default_rng(1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for _ in range(packets):
            sender.sendto(generator.bytes(int(generator.integers(0, 600))), (LOOPBACK, port))
    for _ in range(packets // 20):
        try:
            with socket.create_connection((LOOPBACK, port), timeout=1.0) as stream:
                stream.sendall(generator.bytes(int(generator.integers(1, 600))))
        except OSError:  # it serves no TCP, or has ended the connection
            continue


def test_its_settings_are_fields_with_a_sentence(kind: type[Link]) -> None:
    assert dataclasses.is_dataclass(kind)
    assert kind.__dataclass_params__.frozen
    assert all(each.sentence.endswith(".") for each in describe(kind))
    assert setting_names(kind, "_port"), "a test needs a free port"


def test_its_name_is_its_own(kind: type[Link]) -> None:
    assert kind.name
    assert LINKS[kind.name] is kind
    assert kind.name in WRITERS or not kind.sets_inputs


def test_by_default_only_this_host_reaches_it(kind: type[Link]) -> None:
    hosts = [each.default for each in describe(kind) if each.name.endswith("_host")]
    assert hosts == [LOOPBACK]
    ports = [each.default for each in describe(kind) if each.name.endswith("_port")]
    assert all(port > 1024 for port in ports), "needs no privileges"


def test_it_serves_on_a_free_port_and_gives_it_back(kind: type[Link], controller: Recorder) -> None:
    first = settings(kind).open(controller)
    port = first.port
    assert port > 0
    first.close()
    again = settings(kind, port).open(controller)
    assert again.port == port
    again.close()


def test_a_taken_port_is_an_error_with_its_number(
    kind: type[Link], controller: Recorder, served: OpenLink
) -> None:
    with pytest.raises(DriverError, match=str(served.port)):
        settings(kind, served.port).open(controller)


@pytest.mark.parametrize("asleep", [False, True])
def test_no_bytes_reach_the_controller_but_those_of_its_protocol(
    controller: Recorder, served: OpenLink, asleep: bool
) -> None:
    controller.asleep = asleep
    pester(served.port)
    served.close()  # what was received is done by now
    assert controller.calls == []


def test_closing_twice_is_harmless(served: OpenLink) -> None:
    served.close()
    served.close()
