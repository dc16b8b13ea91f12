"""Times before 1970 on /clock are ignored: rclpy raises at each, and a node that only fails
ends.
"""

from __future__ import annotations

from rclpy.node import Node
from rosgraph_msgs.msg import Clock

_SAID_AGAIN = 60.0  # s


def heed_times_only(node: Node) -> None:
    """Let the node follow no /clock that says a negative time, whenever it begins to listen to
    one.
    """
    source = node._time_source
    take = source.clock_callback

    def heed(message: Clock) -> None:
        if message.clock.sec >= 0:
            take(message)
            return
        seconds = message.clock.sec
        node.get_logger().warning(
            f"/clock says {seconds} s, which is no time: ignored", throttle_duration_sec=_SAID_AGAIN
        )

    source.clock_callback = heed
    if source._clock_sub is not None:
        source._clock_sub.callback = heed
