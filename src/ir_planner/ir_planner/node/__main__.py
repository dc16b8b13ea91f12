"""`python -m ir_planner.node` starts the node."""

import sys

from ir_planner.node import main

sys.exit(main())
