"""The PLC's inputs by topic: every message counts once, from publishers that latch and those that do not."""

from __future__ import annotations

from collections import deque

from rclpy.node import Node

from ir_msgs.msg import PlcInputs
from ir_msgs_py import names
from ir_msgs_py.errors import MsgsError
from ir_msgs_py.ros.conversions import plc_inputs_from_msg
from ir_msgs_py.ros.quality import COMMANDS, REQUESTS_WAITING
from ir_sim_driver.controller import Driver
from ir_sim_driver.errors import DriverError
from ir_sim_driver.plc import TOPIC


class PlcTopic:
    """Hands each message to the driver, in the order in which they were sent."""

    def __init__(self, node: Node, driver: Driver) -> None:
        self._driver = driver
        self._heard: deque[tuple[int, PlcInputs]] = deque(maxlen=REQUESTS_WAITING)
        for quality in COMMANDS:
            node.create_subscription(PlcInputs, names.PLC_INPUTS, self._take, quality)

    def _take(self, msg: PlcInputs, info: dict[str, int]) -> None:
        heard = (info["source_timestamp"], msg)
        if heard in self._heard:  # by the other subscription
            return
        self._heard.append(heard)
        try:
            self._driver.plc.write_all_inputs(TOPIC, plc_inputs_from_msg(msg))
        except (MsgsError, DriverError) as error:
            self._driver.warn(f"plc_inputs ignored: {error}")
