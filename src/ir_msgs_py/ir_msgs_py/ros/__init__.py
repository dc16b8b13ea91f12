"""What needs rclpy: conversions, parameters, a client for scripts and fixtures for tests."""
