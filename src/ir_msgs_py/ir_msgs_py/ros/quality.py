"""Quality of service that nodes and clients of the project share."""

from rclpy.qos import DurabilityPolicy, QoSProfile

REQUESTS_WAITING = 1000
"""Requests of a service that wait for their answers at most; what comes beyond is refused
(serving.py).
"""
BURST = 20_000
"""Requests that the middleware keeps between two looks of a node. ROS keeps 10 by default, and
drops the eleventh without a word to anybody; only a client that sends more than these faster than
the node looks, which is some ten thousand times a second, loses any. What nobody uses takes no
memory.
"""

SERVICE = QoSProfile(depth=BURST)
ACTION_SERVICES = {
    "goal_service_qos_profile": SERVICE,
    "result_service_qos_profile": SERVICE,
    "cancel_service_qos_profile": SERVICE,
}
"""Keyword arguments of an action server or client: an action is three services."""

COMMANDS = (
    QoSProfile(depth=REQUESTS_WAITING, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    QoSProfile(depth=REQUESTS_WAITING),
)
"""Two subscriptions that hear every publisher of commands: those that latch, with what they said
before, and those that do not, as `ros2 topic pub` by default. A latching publisher reaches both.
"""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The last message reaches whoever comes later."""
