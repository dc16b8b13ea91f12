"""Playback of recordings into the ROS graph: what is due when, and the node that publishes it."""

__all__ = []
