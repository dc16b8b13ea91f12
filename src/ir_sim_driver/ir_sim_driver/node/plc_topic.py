"""The PLC's inputs by topic."""

from __future__ import annotations

<<<<<<< HEAD
=======
from collections import deque
from collections.abc import Callable, Iterator

>>>>>>> 739bad9 (A pressed stop of the topic is not kept waiting behind old levels)
from rclpy.node import Node

from ir_msgs.msg import PlcInputs
from ir_msgs_py import names
from ir_msgs_py.errors import MsgsError
<<<<<<< HEAD
from ir_msgs_py.ros.commands import CommandTopic
=======
from ir_msgs_py.plc import PlcInputs as Levels
>>>>>>> 739bad9 (A pressed stop of the topic is not kept waiting behind old levels)
from ir_msgs_py.ros.conversions import plc_inputs_from_msg
from ir_sim_driver.controller import Driver
from ir_sim_driver.errors import DriverError
from ir_sim_driver.plc import TOPIC


class PlcTopic:
    """Hands each message to the driver, in the order in which they were sent.

    A turn takes all that wait: on a busy machine an emergency stop would come behind a second of old levels.
    """

    def __init__(self, node: Node, driver: Driver) -> None:
        self._driver = driver
<<<<<<< HEAD
        CommandTopic(node, PlcInputs, names.PLC_INPUTS, self._take)

    def _take(self, msg: PlcInputs) -> None:
=======
        self._heard: deque[tuple[int, PlcInputs]] = deque(maxlen=REQUESTS_WAITING)
        self._subscriptions = [
            node.create_subscription(PlcInputs, names.PLC_INPUTS, self._take, quality) for quality in COMMANDS
        ]

    def _take(self, msg: PlcInputs, info: dict[str, int]) -> None:
        came = [(info["source_timestamp"], msg), *self._waiting()]
        came.sort(key=lambda each: each[0])
        new = []
        for heard in came:
            if heard not in self._heard:  # by the other subscription
                self._heard.append(heard)
                new.append(heard[1])
        levels = [read for msg in new if (read := self._read(msg)) is not None]
        self._write(lambda: self._driver.plc.write_all_inputs(TOPIC, *levels))

    def _read(self, msg: PlcInputs) -> Levels | None:
        """The levels; None for a message that makes no sense, of which only a pressed stop counts."""
>>>>>>> 739bad9 (A pressed stop of the topic is not kept waiting behind old levels)
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

    def _waiting(self) -> Iterator[tuple[int, PlcInputs]]:
        for subscription in self._subscriptions:
            with subscription.handle:
                for _ in range(REQUESTS_WAITING):  # who floods the topic does not hold the node here
                    taken = subscription.handle.take_message(PlcInputs, False)
                    if taken is None:
                        break
                    yield taken[1]["source_timestamp"], taken[0]
