"""Values: arrays, settings, YAML with lines, files, and the errors of the house.

Everything else is above this package: it knows neither robots nor cells nor ROS.
"""
