"""`python -m ir_planner.node` starts the node."""

from ir_planner.node import main

main()
