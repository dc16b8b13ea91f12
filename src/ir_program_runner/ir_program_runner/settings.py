"""Settings of the program runner: times of a program, and where driver, planner and network are."""

from __future__ import annotations

from dataclasses import dataclass

from ir_msgs_py.wake_on_lan import CONTROLLER_MAC, WAKE_PORT, mac_bytes
from ir_values.settings import check_settings, setting

_HOUR = 3600.0


@dataclass(frozen=True)
class ProgramSettings:
    """Patience and margins of a program."""

    signal_timeout: float = setting(
        600.0, "Longest wait for the signals of a step.", unit="s", minimum=0.0, maximum=24 * _HOUR
    )
    ready_timeout: float = setting(
        10.0,
        "How much later than planned the robot may be ready.",
        unit="s",
        minimum=0.0,
        maximum=_HOUR,
    )
    enter_timeout: float = setting(
        5.0,
        "How much later than planned a power mode may be reached.",
        unit="s",
        minimum=0.0,
        maximum=_HOUR,
    )
    load_timeout: float = setting(
        2.0,
        "How long a load is offered to a robot that still settles.",
        unit="s",
        minimum=0.0,
        maximum=60.0,
    )
    wake_repeat: float = setting(
        1.0,
        "Time between two Wake-on-LAN packets: a packet can get lost.",
        unit="s",
        minimum=0.1,
        maximum=60.0,
    )

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class LinkSettings:
    """Where the others are; fixed when the node starts."""

    driver: str = setting("ir_sim_driver", "Name of the driver's node.", read_only=True)
    planner: str = setting("ir_planner", "Name of the planner's node.", read_only=True)
    cell: str = setting(
        "",
        "Cell file or bundled cell whose machines are simulated; empty: signals come from outside.",
        read_only=True,
    )
    peers: tuple[str, ...] = setting(
        ("",),
        "Names of other robots' program runners whose signals are heard: /right/ir_program_runner.",
        read_only=True,
    )
    seed: int = setting(
        0,
        "Seed of the process times that vary, of the machines that are simulated.",
        minimum=0,
        maximum=2**31 - 1,
        read_only=True,
    )
    mac: str = setting(CONTROLLER_MAC, "MAC address of the robot's controller.", read_only=True)
    wake_address: str = setting(
        "127.0.0.1", "Where Wake-on-LAN packets go; may be a broadcast.", read_only=True
    )
    wake_port: int = setting(
        WAKE_PORT,
        "UDP port of Wake-on-LAN; the real one is 9.",
        minimum=1,
        maximum=65535,
        read_only=True,
    )
    response_timeout: float = setting(
        5.0,
        "Longest wait for an answer of driver or planner.",
        unit="s",
        minimum=0.01,
        maximum=60.0,
        read_only=True,
    )
    silence_timeout: float = setting(
        2.0,
        "Without a reading of the meter the driver counts as gone.",
        unit="s",
        minimum=0.05,
        maximum=60.0,
        read_only=True,
    )
    cancel_timeout: float = setting(
        5.0,
        "Longest wait for a stop along the path.",
        unit="s",
        minimum=0.1,
        maximum=60.0,
        read_only=True,
    )
    client_timeout: float = setting(
        2.0,
        "How long a program goes on when the client that asked for it has left the graph; 0: to "
        "its end.",
        unit="s",
        minimum=0.0,
        maximum=_HOUR,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)
        mac_bytes(self.mac)
