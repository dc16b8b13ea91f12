"""`ir view` in a real browser: it draws, its controls work, and nothing is asked of a network.

Needs Chromium. Without it this says `not checked: browser`; where CI=true it has to be there.
"""

from __future__ import annotations

import importlib.util
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

TOOL = Path(__file__).resolve().parents[2] / "tools" / "_chromium.py"
PATIENCE = 60.0  # s: a busy machine
SMALL = 500, 400
CELL = """\
format: ir_cell/1
name: small
robot: kr6_r900_2
home_deg: [0, -90, 90, 0, 45, 0]
tcp: {xyz: [0.05, 0, 0]}
equipment:
  - name: table
    pose: {xyz: [0.6, 0, 0]}
    bodies: [{name: top, kind: box, size: [0.4, 0.6, 0.2], xyz: [0, 0, 0.1]}]
    stations: [{name: pick, pose: {xyz: [-0.05, 0.1, 0.45], abc_deg: [0, 90, 0]}, approach_distance: 0.1}]
program: [{station: pick, dwell: 0.1}, {posture: home}]
"""


@pytest.fixture
def browser() -> Iterator[Any]:
    spec = importlib.util.spec_from_file_location("_chromium", TOOL)
    assert spec is not None
    assert spec.loader is not None
    tool = sys.modules["_chromium"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    if tool.chromium() is None:
        assert os.environ.get("CI") != "true", "no Chromium: this test must run here"
        sys.stderr.write("not checked: browser\n")
        yield None
        return
    with tool.Browser() as started:
        yield started


@pytest.mark.long
def test_the_page_draws_plays_and_follows_the_file(browser: Any, tmp_path: Path) -> None:
    if browser is None:
        return
    path = tmp_path / "small.yaml"
    path.write_text(CELL)
    command = [sys.executable, "-m", "ir_cli.main", "view", str(path), "--port", "0"]
    view = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert view.stdout is not None
        address = view.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{32}", address)
        page = browser.open(address, *SMALL)
        says = "document.body.innerText.includes({!r})".format
        page.wait(says("at the mains"), PATIENCE)
        page.wait("document.querySelector('canvas') !== null", PATIENCE)
        drawn = page.picture(tmp_path / "first.png").read_bytes()
        buttons = "[...document.querySelectorAll('button')].find((b) => b.innerText === {!r})".format
        page.run(f"{buttons('Play')}.click()")
        page.wait(says("kW"), PATIENCE)
        page.wait(f"Boolean({buttons('Stop')})", PATIENCE)
        deadline = time.monotonic() + PATIENCE
        while page.picture(tmp_path / "second.png").read_bytes() == drawn:
            assert time.monotonic() < deadline, "the robot is not drawn anew"
        path.write_text(CELL.replace("size: [0.4,", "size: [-0.4,"))
        page.wait(says("the last cell that could be read is shown"), PATIENCE)
        path.write_text(CELL.replace("name: pick", "name: place").replace("station: pick", "station: place"))
        page.wait(says("place with none"), PATIENCE)
        assert [fault for fault in page.faults if "THREE.Clock" not in fault] == []
        assert [asked for asked in page.requests if not asked.startswith(address.split("?")[0])] == []
        page.close()
    finally:
        view.send_signal(signal.SIGINT)
        assert view.wait(PATIENCE) == 130
