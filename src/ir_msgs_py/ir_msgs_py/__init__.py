"""The shared vocabulary in Python: names, values, conversions, a client for scripts and test fixtures.

Nothing here but the `ros` folder knows rclpy.
"""
