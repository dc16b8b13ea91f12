"""Recordings of the cell: written by a node, read and explained without ROS."""
