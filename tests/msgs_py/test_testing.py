"""The fixtures that users get: waiting for conditions, nodes that spin, failures that are not
lost.
"""

from __future__ import annotations

import pytest
from rclpy.node import Node
from std_msgs.msg import Float64

from ir_msgs_py.ros.spinning import BackgroundExecutor
from ir_msgs_py.ros.testing import PATIENCE
from ir_msgs_py.ros.waiting import Waiting


def test_a_message_goes_from_node_to_node(ros_node, ros_executor, ros_context, wait_for):
    received = []
    other = ros_executor.add_node(Node("other", context=ros_context))
    other.create_subscription(Float64, "speed", received.append, 1)
    publisher = ros_node.create_publisher(Float64, "speed", 1)
    wait_for(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(Float64(data=0.5))
    assert wait_for(lambda: received)[0].data == 0.5


def test_a_condition_that_stays_false_fails_the_test_with_its_name(wait_for):
    with pytest.raises(pytest.fail.Exception, match=r"the door did not come true within 0\.01 s"):
        wait_for(lambda: False, timeout=0.01, what="the door")


def test_what_a_callback_raises_is_raised_where_somebody_waits(ros_context):
    executor = BackgroundExecutor(ros_context)
    node = executor.add_node(Node("failing", context=ros_context))

    def fail():
        timer.cancel()
        raise ValueError("a mistake in a callback")

    timer = node.create_timer(0.001, fail)
    with pytest.raises(ValueError, match="a mistake in a callback"):
        executor.wait_until(lambda: False, timeout=PATIENCE)
    assert executor.run(lambda: 42) == 42
    executor.close()


def test_a_coroutine_waits_for_a_condition_or_its_timeout(ros_node, ros_executor):
    waiting = Waiting(ros_node, period=0.002)
    arrived = []
    ros_node.create_timer(0.005, lambda: arrived.append(True))

    async def wait():
        return await waiting.until(lambda: bool(arrived), 60.0), await waiting.until(
            lambda: False, 0.01
        )

    assert ros_executor.run(wait) == (True, False)
