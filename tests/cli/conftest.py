"""Modules beside the tests of the command line: cells that people get wrong."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # generated_cells.py
