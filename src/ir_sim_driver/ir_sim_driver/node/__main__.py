"""`python -m ir_sim_driver.node`: the node as a process."""

import sys

from ir_sim_driver.node.node import main

sys.exit(main())
