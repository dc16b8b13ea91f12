"""Recordings being written, without ROS: the file, and the session that fills it."""
