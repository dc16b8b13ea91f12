"""`python -m ir_recorder.node` runs the recorder node."""

import sys

from ir_recorder.node import main

sys.exit(main())
