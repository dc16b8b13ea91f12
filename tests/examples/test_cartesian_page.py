"""The snippets of docs/cartesian.md run without ROS."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "cartesian.md"


@pytest.mark.long
def test_the_snippets_run_without_ros() -> None:
    snippets = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    code = "\n".join(["import sys; sys.modules['rclpy'] = None", *snippets])
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert "tool within 0.0" in ran.stdout
