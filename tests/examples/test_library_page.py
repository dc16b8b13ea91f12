"""The snippets of docs/library.md run one after the other, without ROS."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "library.md"


@pytest.mark.long
def test_every_snippet_runs_without_ros() -> None:
    snippets = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(snippets) >= 8
    assert len(snippets[0].strip().splitlines()) <= 7, "two imports and five lines"
    code = "\n".join(["import sys; sys.modules['rclpy'] = None", *snippets])
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    lines = ran.stdout.splitlines()
    assert re.fullmatch(
        r"MovementPlan\(\d+\.\d\d s, \d+ J, clearance \d+ mm, certified, id \w+\)", lines[0]
    )
    assert any("safety_distance is 7 m" in line for line in lines)
    assert any("against synchronous S-curve PTP" in line for line in lines)
