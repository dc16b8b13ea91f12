"""Quality of service that nodes and clients of the project share."""

from rclpy.qos import DurabilityPolicy, QoSProfile

REQUESTS_WAITING = 1000
"""Requests of a service that wait for their answers at most. ROS keeps 10 by default, and drops the eleventh
without a word to anybody; a request beyond this one is lost in the same way, so clients keep below it."""

SERVICE = QoSProfile(depth=REQUESTS_WAITING)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""The last message reaches whoever comes later."""
