"""The recorder's ROS side: its node, its subscriptions, and what it asks other nodes for."""

from ir_recorder.node.recorder import (
    COMMAND_NODE,
    POLL_PERIOD,
    RecorderNode,
    declared_settings,
    main,
)

__all__ = ["COMMAND_NODE", "POLL_PERIOD", "RecorderNode", "declared_settings", "main"]
