"""Parameters of the node: every stage's settings under its own prefix."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rclpy.node import Node

from ir_msgs_py.modes import PREFIX, TransitionTimes
from ir_msgs_py.ros.parameters import Parameters
from ir_sim_driver.controller import ControllerSettings, SimulationSettings, SupervisionSettings
from ir_sim_driver.errors import SettingsError
from ir_sim_driver.load_check import LoadCheckSettings
from ir_sim_driver.motion import ExecutionSettings
from ir_sim_driver.plant import BACKENDS, TYPICAL, ControlSettings
from ir_sim_driver.plc import Link, PlcSettings, WakeOnLan, usable_links
from ir_sim_driver.power import IdleTimes
from ir_values.settings import check_settings, setting


@dataclass(frozen=True)
class NodeSettings:
    """What the node simulates and how it meets the world."""

    cell: str = setting(
        "demo", "Name of a bundled cell, or the path of a cell file.", read_only=True
    )
    load: str = setting(
        "cell",
        "Loads at the start: 'cell' (the cell's tool), 'none', or names joined by '+'.",
        read_only=True,
    )
    backend: str = setting(
        "pybullet", "What simulates the robot.", choices=tuple(BACKENDS), read_only=True
    )
    plant: str = setting(
        TYPICAL,
        "Which plant is simulated: nominal, typical, typical:SEED, or the path of a plant file "
        "(.yaml).",
        read_only=True,
    )
    joint_state_rate: int = setting(
        500,
        "Messages of joint_states per second; must divide 1000.",
        unit="Hz",
        minimum=50,
        maximum=1000,
        read_only=True,
    )
    client_timeout: float = setting(
        2.0,
        "How long a movement goes on when the client that asked for it has left the graph; 0: to "
        "its end.",
        unit="s",
        minimum=0.0,
        maximum=3600.0,
        read_only=True,
    )
    publish_tf: bool = setting(
        True,
        "Whether tf and tf_static are published, where tf2_msgs is installed.",
        read_only=True,
    )
    real_time_factor: float = setting(
        1.0,
        "How much faster than real time the plant runs; other than 1, the node publishes /clock.",
        minimum=0.1,
        maximum=100.0,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)
        if 1000 % self.joint_state_rate:
            raise SettingsError(
                f"joint_state_rate is {self.joint_state_rate} Hz: it must divide 1000 Hz"
            )


class DriverParameters:
    """All parameters; `execution` ones can be changed while the robot stands, then `changed` is
    called.
    """

    def __init__(
        self, node: Node, refuse: Callable[[], str], changed: Callable[[ExecutionSettings], None]
    ) -> None:
        self.node: NodeSettings = Parameters(node, NodeSettings).value
        self.links: tuple[Link, ...] = tuple(
            Parameters(node, link).value for link in usable_links()
        )
        execution = Parameters(
            node,
            ExecutionSettings,
            prefix="execution.",
            refuse=lambda names: refuse(),
            on_change=changed,
        )
        self.simulation = SimulationSettings(
            controller=Parameters(node, ControllerSettings).value,
            control=Parameters(node, ControlSettings, prefix="control.").value,
            execution=execution.value,
            transitions=Parameters(node, TransitionTimes, prefix=PREFIX, read_only=True).value,
            supervision=Parameters(node, SupervisionSettings, prefix="supervision.").value,
            idle=Parameters(node, IdleTimes, prefix=PREFIX).value,
            plc=Parameters(node, PlcSettings, prefix="plc.").value,
            load_check=Parameters(node, LoadCheckSettings, prefix="load_check.").value,
        )
        self._execution = execution

    @property
    def wake_hint(self) -> str:
        """What wakes the controller, for sentences."""
        hints = [
            f"a Wake-on-LAN packet for {link.mac}"
            for link in self.links
            if isinstance(link, WakeOnLan)
        ]
        return " or ".join(hints)
