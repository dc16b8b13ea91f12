"""Quality of service that nodes and clients of the project share."""

from rclpy.qos import DurabilityPolicy, QoSProfile

REQUESTS_WAITING = 1000
"""Requests of a service that wait for their answers at most. ROS keeps 10 by default, and drops the eleventh
without a word to anybody; a request beyond this one is lost in the same way, so clients keep below it."""

SERVICE = QoSProfile(depth=REQUESTS_WAITING)
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
"""Two subscriptions that hear every publisher of commands: those that latch, with what they said before, and
those that do not, as `ros2 topic pub` by default. A latching publisher reaches both."""

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The last message reaches whoever comes later."""
