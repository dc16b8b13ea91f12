"""Playback of recordings into the ROS graph."""
