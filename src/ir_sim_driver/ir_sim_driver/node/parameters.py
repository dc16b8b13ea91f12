"""Parameters of the node: every stage's settings under its own prefix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rclpy.node import Node

from ir_msgs_py.ros.parameters import Parameters
from ir_msgs_py.settings import check_settings, setting
from ir_msgs_py.transitions import PREFIX
from ir_sim_driver.controller.settings import ControllerSettings, SimulationSettings
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.motion.execution_settings import ExecutionSettings
from ir_sim_driver.plant.control import ControlSettings
from ir_sim_driver.plc.inputs import PlcSettings
from ir_sim_driver.plc.wake_on_lan import mac_bytes
from ir_sim_driver.power.power_modes import TransitionSettings


@dataclass(frozen=True)
class NodeSettings:
    """What the node simulates and how it meets the world."""

    cell: str = setting("demo", "Name of a bundled cell, or the path of a cell file.", read_only=True)
    load: str = setting(
        "cell",
        "Loads at the start: 'cell' (the cell's tool), 'none', or names joined by '+'.",
        read_only=True,
    )
    backend: str = setting(
        "pybullet", "What simulates the robot.", choices=("pybullet", "ideal"), read_only=True
    )
    joint_state_rate: int = setting(
        500,
        "Messages of joint_states per second; must divide 1000.",
        unit="Hz",
        minimum=50,
        maximum=1000,
        read_only=True,
    )
    real_time_factor: float = setting(
        1.0,
        "How much faster than real time the plant runs; other than 1, the node publishes /clock.",
        minimum=0.1,
        maximum=100.0,
        read_only=True,
    )
    mac: str = setting(
        "02:00:00:c4:02:10", "MAC address that a Wake-on-LAN packet has to carry.", read_only=True
    )
    wake_host: str = setting("127.0.0.1", "Address the Wake-on-LAN listener is bound to.", read_only=True)
    wake_port: int = setting(
        9009,
        "UDP port of the Wake-on-LAN listener; 0 takes a free one. The real one is 9.",
        minimum=0,
        maximum=65535,
        read_only=True,
    )
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
        "Without a heartbeat for this long the link to the PLC counts as lost, if it has ever sent one.",
        unit="s",
        minimum=0.1,
        maximum=3600.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)
        mac_bytes(self.mac)
        if 1000 % self.joint_state_rate:
            raise SettingsError(f"joint_state_rate is {self.joint_state_rate} Hz: it must divide 1000 Hz")


class DriverParameters:
    """All parameters; `execution` ones can be changed while the robot stands, `changed` is told."""

    def __init__(
        self, node: Node, refuse: Callable[[], str], changed: Callable[[ExecutionSettings], None]
    ) -> None:
        self.node: NodeSettings = Parameters(node, NodeSettings).value
        execution = Parameters(
            node, ExecutionSettings, prefix="execution.", refuse=lambda names: refuse(), on_change=changed
        )
        self.simulation = SimulationSettings(
            controller=Parameters(node, ControllerSettings).value,
            control=Parameters(node, ControlSettings, prefix="control.").value,
            execution=execution.value,
            transitions=Parameters(node, TransitionSettings, prefix=PREFIX).value,
            plc=Parameters(node, PlcSettings, prefix="plc.").value,
        )
        self._execution = execution
