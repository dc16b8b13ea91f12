"""The PLC's inputs by topic."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rclpy.node import Node

from ir_msgs.msg import PlcInputs
from ir_msgs_py import names
from ir_msgs_py.errors import MsgsError
from ir_msgs_py.plc import PlcInputs as Levels
from ir_msgs_py.ros.power_conversions import plc_inputs_from_msg
from ir_msgs_py.ros.topics import CommandTopic
from ir_sim_driver.controller import Driver
from ir_sim_driver.errors import DriverError
from ir_sim_driver.plc import TOPIC


class PlcTopic:
    """Hands each message to the driver, in the order in which they were sent."""

    def __init__(self, node: Node, driver: Driver) -> None:
        self._driver = driver
        CommandTopic(node, PlcInputs, names.PLC_INPUTS, self._take)

    def _take(self, messages: Sequence[PlcInputs]) -> None:
        levels = [read for msg in messages if (read := self._read(msg)) is not None]
        self._write(lambda: self._driver.plc.write_all_inputs(TOPIC, *levels))

    def _read(self, msg: PlcInputs) -> Levels | None:
        """The levels; None for a message that makes no sense, of which only a pressed stop
        counts.
        """
        try:
            return plc_inputs_from_msg(msg)
        except (MsgsError, ValueError) as error:
            self._driver.warn(f"plc_inputs ignored: {error}")
        if msg.emergency_stop:
            self._write(lambda: self._driver.plc.write_inputs(TOPIC, {"emergency_stop": True}))
        return None

    def _write(self, write: Callable[[], None]) -> None:
        try:
            write()
        except (MsgsError, DriverError) as error:
            self._driver.warn(f"plc_inputs ignored: {error}")
