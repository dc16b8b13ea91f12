"""A foreign process that has our names with other types: sentences without our node, no harm beside
it.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from diagnostic_msgs.srv import SelfTest
from rclpy.context import Context
from rclpy.parameter import Parameter

from ir_msgs.msg import PowerState
from ir_msgs.srv import QueryModes
from ir_msgs_py import names
from ir_msgs_py.ros.client import Client
from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.status import StatusCode
from ir_sim_driver.node import SimDriver
from ir_values.errors import CallTimedOutError, ServiceUnavailableError

TOPICS = (names.POWER_STATE, names.CELL, names.PLC_INPUTS, names.CARRIED_LOAD)


@pytest.fixture
def ros_discovery_range() -> str:
    return "SYSTEM_DEFAULT"


@pytest.fixture
def foreign(ros_context: Any, ros_domain_id: int) -> Iterator[Any]:
    """Its services never answer what anybody here asks; its topics talk all the time."""
    context = Context()
    rclpy.init(context=context, domain_id=ros_domain_id)
    with BackgroundExecutor(context) as executor:
        node = executor.add_node(rclpy.create_node("foreign", context=context))

        def offer() -> None:
            node.create_service(SelfTest, names.QUERY_MODES, lambda request, response: response)
            for topic in TOPICS:
                talk = node.create_publisher(DiagnosticArray, topic, 10)
                node.create_timer(0.02, lambda talk=talk: talk.publish(DiagnosticArray()))

        executor.run(offer)
        yield node
    context.try_shutdown()


@pytest.mark.usefixtures("foreign")
def test_a_foreign_type_is_named_where_our_node_is_missing_and_ignored_where_it_is_there(
    ros_context: Any, ros_executor: Any, wait_for: Any
) -> None:
    name = f"/{names.QUERY_MODES}"
    with Client(context=ros_context, timeout=PATIENCE) as client:
        topic = f"/{names.POWER_STATE}"
        wait_for(lambda: name in client.graph.services(), what="the foreign service is seen")
        wait_for(lambda: topic in client.graph.topics(), what="the foreign topic is seen")
        with pytest.raises(
            ServiceUnavailableError, match=r"has it as diagnostic_msgs/srv/SelfTest$"
        ):
            client.call(names.QUERY_MODES, QueryModes.Request(), timeout=0.5)
        with pytest.raises(
            CallTimedOutError, match=r"has it as diagnostic_msgs/msg/DiagnosticArray$"
        ):
            client.next_message(names.POWER_STATE, PowerState, timeout=0.5)
        values = {"cell": "open", "backend": "ideal", "wake_port": 0}
        overrides = [Parameter(key, value=value) for key, value in values.items()]
        ros_executor.add_node(SimDriver(context=ros_context, parameter_overrides=overrides))
        answer = client.ask(names.QUERY_MODES, QueryModes.Request(), timeout=PATIENCE)
        assert answer.status.code == StatusCode.SUCCESS
        assert client.next_message(names.POWER_STATE, PowerState, timeout=PATIENCE).energy > 0.0
        wait_for(
            lambda: client.graph.services()[name] == "ir_msgs/srv/QueryModes",
            what="its type counts",
        )
        wait_for(
            lambda: client.graph.topics()[topic] == "ir_msgs/msg/PowerState", what="its type counts"
        )
