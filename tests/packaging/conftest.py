"""Where the tests of pages find what reads command lines."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))  # _documented.py
