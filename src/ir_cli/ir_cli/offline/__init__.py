"""Commands that need no ROS: they ask the planner as a library. `ir plan`, `ir move`, `ir ik` and
others.
"""
