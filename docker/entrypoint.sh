#!/bin/bash
# Runs a command with ROS 2 and the workspace sourced. colcon puts console scripts into lib/<package>, where only
# `ros2 run` looks: they come onto the path, so that a node started here is the process that gets the signals.
set -e
source /opt/ros/jazzy/setup.bash
source /ws/ros_ws/install/local_setup.bash
for folder in /ws/ros_ws/install/lib/ir_*/; do
  PATH="$PATH:${folder%/}"
done
export PATH
exec "$@"
