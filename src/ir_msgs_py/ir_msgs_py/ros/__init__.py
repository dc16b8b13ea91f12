"""Parts that need rclpy: conversions, parameters, a client for scripts, fixtures for tests."""
