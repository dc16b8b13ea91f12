"""Simulated KUKA KR210 on a KR C4: what a PLC and a ROS user see, and what the mains meter reads."""
