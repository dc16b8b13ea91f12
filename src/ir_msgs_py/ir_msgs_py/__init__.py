"""The shared vocabulary in Python: array types, names, values, settings; no ROS is needed to import
it.

Conversions to and from messages, the client for scripts and the test fixtures are in
`ir_msgs_py.ros`: nothing else here knows rclpy.
"""
